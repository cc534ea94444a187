#include "squeal/modes/modes.hpp"

#include "squeal/base/checkpoint.hpp"
#include "squeal/equilibrium/state.hpp"

#include <cstdio>

namespace squeal
{

namespace
{

constexpr const char* name_of_search = "modes";

/// All but the vectors of the modes, of which the numbers alone are set.
void describe_search(Checkpoint& checkpoint, Modes& modes)
{
  std::size_t found = modes.modes.size();
  describe_all(checkpoint, found, modes.outcome, modes.method, modes.shapes, modes.band, modes.decays,
               modes.beyond_band, modes.unstable_count, modes.beyond_inertia, modes.count.certified_by,
               modes.count.frequency, modes.count.expected, modes.count.found, modes.count_check);
  modes.modes.resize(found);
}

/// Hands each mode with the name of its checkpoint to `pass`: one checkpoint of all might not fit into the memory.
template <class Pass> void for_each_mode(Modes& modes, const Structure& structure, const Pass& pass)
{
  const FileOrder order(structure);
  std::size_t number = 0;
  for (ComplexMode& mode : modes.modes)
    pass(format("modes.%06zu", number++),
         [&](Checkpoint& checkpoint)
         {
           describe_all(checkpoint, mode.lambda, mode.backward_error, mode.reactions);
           order.describe(checkpoint, mode.real);
           order.describe(checkpoint, mode.imaginary);
         });
}

} // namespace

void keep_modes(Modes& modes, const Structure& structure)
{
  const MPI_Comm comm = comm_of(structure.load);
  for_each_mode(modes, structure,
                [&](const std::string& name, const Description& describe) { keep(name, comm, describe); });
  keep(name_of_search, comm, [&](Checkpoint& checkpoint) { describe_search(checkpoint, modes); }); // of all modes
}

std::optional<Modes> kept_modes(const Structure& structure)
{
  const MPI_Comm comm = comm_of(structure.load);
  Modes modes;
  if (!restore(name_of_search, comm, [&](Checkpoint& checkpoint) { describe_search(checkpoint, modes); })) return {};
  for (ComplexMode& mode : modes.modes)
  {
    mode.real = zeros_like(structure.load);
    mode.imaginary = zeros_like(structure.load);
  }
  bool all = true;
  for_each_mode(modes, structure,
                [&](const std::string& name, const Description& describe) { all &= restore(name, comm, describe); });
  if (!all) return {};
  if (rank_of(comm) == 0) std::printf("  of the checkpoint\n");
  return modes;
}

} // namespace squeal
