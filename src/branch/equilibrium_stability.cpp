#include "equilibrium_stability.hpp"

#include "squeal/algebra/root.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr int intervals = 10;         // of the range
constexpr double close_enough = 1e-5; // of the range

EquilibriumStability stability_at(BrakeFamily& family, const BrakeBranchProblem& problem, double parameter)
{
  EquilibriumStability stability;
  stability.parameter = parameter;
  family.set_parameter(parameter);
  const SlidingEquilibrium sliding = family.sliding();
  if (sliding.equilibrium.outcome.kind != OutcomeKind::converged) return stability;
  const Modes modes = modes_at(sliding, problem);
  if (modes.outcome.kind != OutcomeKind::converged) return stability;
  stability.known = true;
  stability.unstable_modes = modes.unstable_count;
  for (const ComplexMode& mode : modes.modes)
    if (mode.frequency_hz() > 0)
    {
      stability.growth_rates.push_back(mode.growth_rate());
      stability.frequencies.push_back(mode.frequency_hz());
    }
  if (stability.growth_rates.empty()) return stability;
  stability.growth_rate = stability.growth_rates.front();
  stability.frequency_hz = stability.frequencies.front();
  return stability;
}

/// Where the growth rate of this rank crosses zero between two values.
BranchEvent crossing(BrakeFamily& family, const BrakeBranchProblem& problem, std::size_t rank,
                     const EquilibriumStability& from, const EquilibriumStability& to)
{
  const double tolerance = close_enough * std::abs(problem.settings.to - problem.settings.from);
  double frequency = to.frequencies[rank];
  const auto growth = [&](double parameter) -> std::optional<double>
  {
    const EquilibriumStability now = stability_at(family, problem, parameter);
    if (!now.known || now.growth_rates.size() <= rank) return std::nullopt;
    frequency = now.frequencies[rank];
    return now.growth_rates[rank];
  };
  const Bracket bracket{from.parameter, to.parameter, from.growth_rates[rank], to.growth_rates[rank]};
  const Root root = find_root(growth, bracket, tolerance);
  const int change = to.growth_rates[rank] > 0 ? 1 : -1;
  return {BranchEventKind::hopf, root.x, std::max(root.error, tolerance), 1 / frequency, 0, change};
}

} // namespace

Modes modes_at(const SlidingEquilibrium& sliding, const BrakeBranchProblem& problem)
{
  ModesSettings settings = problem.modes;
  if (settings.method != ModesMethod::projection) settings.method = ModesMethod::full; // which decides there
  return find_modes(sliding, linearise(sliding), settings, problem.modes_options);
}

std::vector<EquilibriumStability> equilibria_along(BrakeFamily& family, const BrakeBranchProblem& problem)
{
  const BranchSettings& settings = problem.settings;
  std::vector<double> values = {problem.settings.own};
  for (int i = 0; i <= intervals; ++i) values.push_back(settings.from + i * (settings.to - settings.from) / intervals);
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  std::vector<EquilibriumStability> equilibria;
  for (const double value : values) equilibria.push_back(stability_at(family, problem, value));
  return equilibria;
}

std::vector<BranchEvent> hopf_points(BrakeFamily& family, const BrakeBranchProblem& problem,
                                     const std::vector<EquilibriumStability>& equilibria)
{
  std::vector<BranchEvent> events;
  for (std::size_t i = 1; i < equilibria.size(); ++i)
  {
    const EquilibriumStability &from = equilibria[i - 1], &to = equilibria[i];
    if (!from.known || !to.known) continue;
    const std::size_t ranks = std::min(from.growth_rates.size(), to.growth_rates.size());
    for (std::size_t rank = 0; rank < ranks; ++rank)
      if ((from.growth_rates[rank] > 0) != (to.growth_rates[rank] > 0))
        events.push_back(crossing(family, problem, rank, from, to));
  }
  return events;
}

int unstable_modes_at(double parameter, const std::vector<EquilibriumStability>& equilibria,
                      const std::vector<BranchEvent>& hopf_points)
{
  const EquilibriumStability* below = nullptr;
  for (const EquilibriumStability& equilibrium : equilibria)
    if (equilibrium.known && equilibrium.parameter <= parameter) below = &equilibrium;
  if (!below) return -1;
  int count = below->unstable_modes;
  for (const BranchEvent& hopf : hopf_points)
    if (hopf.parameter > below->parameter && hopf.parameter <= parameter) count += hopf.change;
  return count;
}

} // namespace squeal
