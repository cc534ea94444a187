#include "squeal/chain.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// Whether several modes oscillate and grow, each of which may lead to a motion of its own, and a few trajectories of
/// the model cost little.
bool may_lead_elsewhere(const Chain& chain)
{
  const auto oscillates = [](const ComplexMode& mode) { return mode.frequency_hz() > 0; };
  return is_small(chain) && std::ranges::count_if(chain.report.modes.unstable(), oscillates) > 1;
}

/// The modes, their pairs and five random sums; as many as are integrated together at most.
int starts_beside(int unstable)
{
  constexpr int random = 5, together = 16;
  return std::min(unstable * (unstable + 1) / 2 + random, together);
}

} // namespace

Attractors run_attractors(const Chain& chain)
{
  constexpr int enough = 256; // steps a period to recognise a cycle of more steps by
  CycleSettings settings = chain.scene.cycle;
  if (settings.steps_per_period == 0)
    settings.steps_per_period = std::clamp(chain.report.cycle.steps_per_period, first_steps, enough);
  if (!settings.enabled || (settings.starts == 0 && !may_lead_elsewhere(chain)))
    return not_run<Attractors>(OutcomeKind::off, "cycle.starts is 0, and no other starts are sought by themselves");
  const std::vector<ComplexMode>& modes = chain.report.modes.modes;
  const bool stable = !modes.empty() && chain.report.modes.unstable_count == 0 && chain.model.interface.pairs > 0;
  const bool chosen = settings.starts == 0;
  if (chosen) settings.starts = starts_beside(chain.report.modes.unstable_count);
  const auto attractors = [&](const UnstableModes& started)
  {
    Attractors found = find_attractors({chain.sliding(), modes, started, settings, chain.options.step});
    if (chosen && found.outcome.kind == OutcomeKind::not_converged) found.outcome.kind = OutcomeKind::completed;
    return found;
  };
  if (!stable)
  {
    const std::string reason = no_unstable_mode(chain.report);
    return reason.empty() ? attractors(chain.unstable()) : not_run<Attractors>(OutcomeKind::skipped, reason);
  }
  // a motion may go on beside a stable equilibrium: from the mode that decays slowest, or that a given start has most
  // of, and from random sums of modes
  const Estimate estimate = estimate_amplitude(chain.sliding(), *chain.linearised, modes.front());
  if (!std::isfinite(estimate.start_amplitude))
    return not_run<Attractors>(OutcomeKind::skipped, "no amplitude is known at which contact opens or slip reverses");
  return attractors({std::span(modes).first(1), std::span(&estimate, 1)});
}

} // namespace squeal
