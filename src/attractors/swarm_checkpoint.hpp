#pragma once
/// The checkpoint of trajectories that are integrated together from many starts.
#include "squeal/transient/transient.hpp"

#include <array>
#include <vector>

namespace squeal
{

inline constexpr std::size_t coordinates = 4; // of the least stable modes

/// What is seen of one trajectory.
struct Watched
{
  std::vector<double> energies; // [J] fluctuating, of each step
  std::array<double, coordinates> last{}, squares{};
  std::array<std::vector<double>, coordinates> crossings; // [s] upwards through zero
};

/// What they have reached after a step.
struct SwarmProgress
{
  const Structure& structure;
  double step_size; // [s]
  long& steps;
  std::vector<State>& states;
  std::vector<Watched>& watched;
};

/// Goes on from the checkpoint of the run that is restarted, if there is one of the same starts. Collective.
void restore_swarm(const SwarmProgress& progress);

/// Collective.
void keep_swarm(const SwarmProgress& progress);

} // namespace squeal
