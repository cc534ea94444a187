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

/// Text as a list of its bytes.
std::vector<double> list_of(const std::string& text)
{
  return {text.begin(), text.end()};
}

std::string text_of(const std::vector<double>& list)
{
  std::string text;
  for (const double byte : list) text += static_cast<char>(byte);
  return text;
}

/// The file of one mode: all of them may be more than what fits into the memory once more.
std::string file_of(const char* route, std::size_t number)
{
  return format("modes.%s.%06zu", route, number);
}

void keep_mode(const ComplexMode& mode, const FileOrder& order, const std::string& file)
{
  std::vector<double> reactions;
  for (const std::complex<double>& reaction : mode.reactions)
  {
    reactions.push_back(reaction.real());
    reactions.push_back(reaction.imag());
  }
  Checkpoint checkpoint;
  checkpoint.set("numbers", std::vector<double>{mode.lambda.real(), mode.lambda.imag(), mode.backward_error});
  checkpoint.set("reactions", std::move(reactions));
  checkpoint.set("real", order.gather(mode.real));
  checkpoint.set("imaginary", order.gather(mode.imaginary));
  if (rank_of(comm_of(mode.real)) == 0) keep(checkpoint, file);
}

void keep_all(const std::vector<ComplexMode>& modes, const FileOrder& order, const char* route)
{
  for (std::size_t i = 0; i < modes.size(); ++i) keep_mode(modes[i], order, file_of(route, i));
}

ComplexMode mode_from(const Checkpoint& checkpoint, const Structure& structure, const FileOrder& order)
{
  const std::vector<double>& numbers = checkpoint.list("numbers");
  const std::vector<double>& reactions = checkpoint.list("reactions");
  ComplexMode mode;
  mode.lambda = {numbers.at(0), numbers.at(1)};
  mode.real = zeros_like(structure.load);
  mode.imaginary = zeros_like(structure.load);
  mode.backward_error = numbers.at(2);
  for (std::size_t i = 0; i + 1 < reactions.size(); i += 2) mode.reactions.emplace_back(reactions[i], reactions[i + 1]);
  order.scatter(checkpoint.list("real"), mode.real);
  order.scatter(checkpoint.list("imaginary"), mode.imaginary);
  return mode;
}

/// False: one of them is missing.
bool take_all(const Structure& structure, double count, const char* route, std::vector<ComplexMode>& modes)
{
  const FileOrder order(structure);
  while (static_cast<double>(modes.size()) < count)
  {
    const auto checkpoint = kept_everywhere(file_of(route, modes.size()), comm_of(structure.load));
    if (!checkpoint) return false;
    modes.push_back(mode_from(*checkpoint, structure, order));
  }
  return true;
}

} // namespace

void keep_modes(const Modes& modes, const Structure& structure)
{
  checkpoint_made();
  if (!checkpoints_are_kept()) return;
  const MPI_Comm comm = comm_of(structure.load);
  const FileOrder order(structure);
  Checkpoint checkpoint;
  keep_all(modes.modes, order, "found");
  keep_all(modes.projected, order, "projected");
  checkpoint.set("counts", std::vector<double>{static_cast<double>(modes.modes.size()),
                                               static_cast<double>(modes.projected.size())});
  checkpoint.set("numbers", std::vector<double>{
                                static_cast<double>(ranks_of(comm)), static_cast<double>(modes.outcome.kind),
                                static_cast<double>(modes.outcome.iterations), modes.outcome.residual,
                                static_cast<double>(modes.method), static_cast<double>(modes.shapes), modes.band,
                                static_cast<double>(modes.unstable_count), static_cast<double>(modes.routes_disagree),
                                static_cast<double>(modes.beyond_inertia), modes.count.frequency,
                                static_cast<double>(modes.count.expected), static_cast<double>(modes.count.found),
                                static_cast<double>(modes.count.certified_by)});
  checkpoint.set("beyond band", modes.beyond_band);
  checkpoint.set("reason", list_of(modes.outcome.reason));
  checkpoint.set("count check", list_of(modes.count_check));
  if (rank_of(comm) == 0) keep(checkpoint, name_of_file);
}

std::optional<Modes> kept_modes(const Structure& structure)
{
  const MPI_Comm comm = comm_of(structure.load);
  const auto checkpoint = kept_everywhere(name_of_file, comm);
  if (!checkpoint) return {};
  const std::vector<double>& numbers = checkpoint->list("numbers");
  if (static_cast<int>(numbers.at(0)) != ranks_of(comm)) return {}; // pairs are numbered otherwise
  const std::vector<double>& counts = checkpoint->list("counts");
  Modes modes;
  if (!take_all(structure, counts.at(0), "found", modes.modes)) return {};
  if (!take_all(structure, counts.at(1), "projected", modes.projected)) return {};
  modes.outcome = {static_cast<OutcomeKind>(numbers.at(1)), text_of(checkpoint->list("reason")),
                   static_cast<int>(numbers.at(2)), numbers.at(3)};
  modes.method = static_cast<ModesMethod>(numbers.at(4));
  modes.shapes = static_cast<ModeShapes>(numbers.at(5));
  modes.band = numbers.at(6);
  modes.unstable_count = static_cast<int>(numbers.at(7));
  modes.routes_disagree = numbers.at(8) != 0;
  modes.beyond_inertia = numbers.at(9) != 0;
  modes.count = {static_cast<Certificate>(numbers.at(13)), numbers.at(10), static_cast<int>(numbers.at(11)),
                 static_cast<int>(numbers.at(12))};
  modes.beyond_band = checkpoint->list("beyond band");
  modes.count_check = text_of(checkpoint->list("count check"));
  if (rank_of(comm) == 0) std::printf("  of the checkpoint\n");
  return modes;
}

} // namespace squeal
