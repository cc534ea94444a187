#include "squeal/modes/modes_checkpoint.hpp"

#include "squeal/base/checkpoint.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/equilibrium/file_order.hpp"

#include <cstdio>

namespace squeal
{

namespace
{

constexpr const char* name_of_file = "modes";

/// The file of one mode: all of them may be more than what fits into the memory once more.
std::string file_of(const char* route, std::size_t number)
{
  return format("modes.%s.%06zu", route, number);
}

void describe_mode(Checkpoint& checkpoint, const FileOrder& order, ComplexMode& mode)
{
  describe_all(checkpoint, mode.lambda, mode.backward_error, mode.reactions);
  order.describe(checkpoint, mode.real);
  order.describe(checkpoint, mode.imaginary);
}

void keep_all(std::vector<ComplexMode>& modes, const FileOrder& order, const char* route)
{
  for (std::size_t i = 0; i < modes.size(); ++i)
  {
    Checkpoint checkpoint;
    describe_mode(checkpoint, order, modes[i]);
    if (rank_of(comm_of(modes[i].real)) == 0) keep(checkpoint, file_of(route, i));
  }
}

/// False: one of them is missing.
bool take_all(const Structure& structure, std::vector<ComplexMode>& modes, const char* route)
{
  const FileOrder order(structure);
  for (std::size_t i = 0; i < modes.size(); ++i)
  {
    std::optional<Checkpoint> checkpoint = kept_everywhere(file_of(route, i), comm_of(structure.load));
    if (!checkpoint) return false;
    modes[i].real = zeros_like(structure.load);
    modes[i].imaginary = zeros_like(structure.load);
    describe_mode(*checkpoint, order, modes[i]);
  }
  return true;
}

/// All but the modes themselves, of which only the numbers are kept.
void describe_search(Checkpoint& checkpoint, Modes& modes)
{
  std::size_t found = modes.modes.size(), projected = modes.projected.size();
  describe_all(checkpoint, found, projected, modes.outcome, modes.method, modes.shapes, modes.band, modes.beyond_band,
               modes.unstable_count, modes.routes_disagree, modes.beyond_inertia, modes.count.certified_by,
               modes.count.frequency, modes.count.expected, modes.count.found, modes.count_check);
  modes.modes.resize(found);
  modes.projected.resize(projected);
}

} // namespace

void keep_modes(Modes& modes, const Structure& structure)
{
  checkpoint_made();
  if (!checkpoints_are_kept()) return;
  const MPI_Comm comm = comm_of(structure.load);
  const FileOrder order(structure);
  keep_all(modes.modes, order, "found");
  keep_all(modes.projected, order, "projected");
  Checkpoint checkpoint;
  int ranks = ranks_of(comm);
  describe(checkpoint, ranks);
  describe_search(checkpoint, modes);
  if (rank_of(comm) == 0) keep(checkpoint, name_of_file);
}

std::optional<Modes> kept_modes(const Structure& structure)
{
  const MPI_Comm comm = comm_of(structure.load);
  std::optional<Checkpoint> checkpoint = kept_everywhere(name_of_file, comm);
  if (!checkpoint) return {};
  int ranks = 0;
  describe(*checkpoint, ranks);
  if (ranks != ranks_of(comm)) return {}; // pairs are numbered otherwise
  Modes modes;
  describe_search(*checkpoint, modes);
  if (!take_all(structure, modes.modes, "found") || !take_all(structure, modes.projected, "projected")) return {};
  if (rank_of(comm) == 0) std::printf("  of the checkpoint\n");
  return modes;
}

} // namespace squeal
