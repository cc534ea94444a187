#include "warnings.hpp"

#include "derived.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Sentences = std::vector<std::string>;

Sentences of_equilibrium(const Report& report)
{
  Sentences sentences;
  if (report.point.equilibrium.uniqueness == Uniqueness::not_assured)
    sentences.push_back("with this much friction other equilibria may exist beside this one");
  const Equilibrium& equilibrium = report.point.equilibrium;
  if (report.model.pairs > 0 && equilibrium.outcome.kind == OutcomeKind::converged &&
      std::none_of(equilibrium.closed.begin(), equilibrium.closed.end(), [](char closed) { return closed; }))
    sentences.push_back(
        "no contact pair is closed: nothing touches, and friction does nothing. Is the gap too large, or "
        "does a load pull the bodies apart?");
  return sentences;
}

/// What a count that disagrees may mean.
const char* count_remedy(const Modes& modes)
{
  if (modes.count.found > modes.count.expected)
    return "so none is known to be missing, but the count does not show it: friction or damping moves pairs across the "
           "end of the band; another modes.band may confirm it";
  if (modes.method == ModesMethod::projection)
    return "so an unstable one may be missing: raise modes.real_modes, or take modes.method = \"full\"";
  return "so one is overdamped or an unstable one is missing: with friction.direction_damping = false fewer are "
         "overdamped, and -modes_solver slices and toar seek them in different ways";
}

Sentences of_modes(const Report& report)
{
  Sentences sentences;
  const Modes& modes = report.point.modes;
  if (modes.modes.empty() && modes.outcome.kind == OutcomeKind::converged)
    sentences.push_back(format("no mode lies below %g Hz", modes.band) +
                        (report.model.length > 0
                             ? format(": is mesh.scale right (the model is %.3g m long), and are moduli and densities?",
                                      report.model.length)
                             : ": is modes.band right, and are the units of M and K?"));
  if (report.model.rounding_hz > 0.001 * modes.band)
    sentences.push_back(
        format("modes below %.3g Hz are lost in rounding beside the stiffest entry of K: make what is rigid "
               "a rigid body, not a stiff spring",
               report.model.rounding_hz));
  constexpr double narrow = 1e-4; // of |lambda|: less than a mesh or a damping value is known to
  const auto on_the_edge = std::count_if(modes.modes.begin(), modes.modes.end(),
                                         [](const ComplexMode& mode)
                                         { return std::abs(mode.growth_rate()) < narrow * std::abs(mode.lambda); });
  if (on_the_edge > 0)
    sentences.push_back(
        format("%ld of the modes are within 0.01 %% of the threshold: mesh and damping decide their sign",
               static_cast<long>(on_the_edge)));
  if (modes.routes_disagree)
    sentences.push_back("the two routes disagree on the number of unstable modes: raise modes.real_modes or "
                        "modes.residual_passes");
  if (modes.count.certified_by == Certificate::none && modes.count.expected != modes.count.found)
    sentences.push_back(format("%d pairs were found where %d are expected, %s", modes.count.found, modes.count.expected,
                               count_remedy(modes)));
  return sentences;
}

Sentences of_estimate(const Report& report)
{
  const Estimate& estimate = followed_estimate(report);
  const double lift_off = estimate.lift_off_amplitude;
  if (estimate.outcome.kind == OutcomeKind::no_balance && std::isfinite(lift_off))
    return {format("no amplitude is predicted; start = \"estimate\" is first lift-off times %g, %.5g m",
                   lift_off_multiple, lift_off_multiple * lift_off)};
  Sentences sentences;
  if (estimate.outcome.kind != OutcomeKind::balance) return sentences;
  if (estimate.amplitude > 3 * lift_off)
    sentences.push_back(format("%.2g times first lift-off: the cycle itself may be far smaller, down to that",
                               estimate.amplitude / lift_off));
  if (estimate.reversal_amplitude < lift_off)
    sentences.push_back(
        "slip reverses before anything lifts off: pairs will stick, and the cycle may be twice as large");
  return sentences;
}

Sentences of_response(const Report& report)
{
  const Modes& modes = report.point.modes;
  if (modes.unstable_count > 0)
    return {format("%d of the modes are unstable: no vibration settles on these responses, and no rig measures them",
                   modes.unstable_count)};
  if (modes.outcome.kind != OutcomeKind::converged || modes.band < report.response.frequency_hz.back())
    return {"whether all modes of this band are stable is not known, without which no rig measures these responses: "
            "give modes.band its highest frequency"};
  return {};
}

void add_chatter(const History& history, Sentences& sentences)
{
  const double share = chatter(history);
  if (share > 0.1)
    sentences.push_back(
        format("the normal force jumps between steps by %.0f %% of its mean: impacts of the contact nodes' own "
               "mass; average it over steps, or refine the contact surface",
               100 * share));
}

Sentences of_transient(const Report& report)
{
  Sentences sentences;
  const Trajectory& transient = report.transient;
  const double bias = transient_bias(report).growth;
  if (std::abs(bias) > 0.1)
    sentences.push_back(format(
        "theta and the step change the growth rate by %+.0f %%: more steps a period, or theta = 1/2", 100 * bias));
  const double fit = transient.growth_rate_fit, predicted = transient.predicted.real();
  if (std::abs(fit - predicted) > 0.01 * std::abs(predicted))
    sentences.push_back("the fitted growth rate is not the predicted one: other motion than the mode is in the start");
  if (transient.energy_defect_max > 1e-8)
    sentences.push_back("the energy identity of the scheme is missed: tighten -transient_contact_tolerance");
  add_chatter(transient.history, sentences);
  return sentences;
}

Sentences of_cycle(const Report& report)
{
  Sentences sentences;
  const LimitCycle& cycle = report.motion.cycle;
  if (cycle.outcome.kind != OutcomeKind::converged) return sentences;
  const StepBias bias = cycle_bias(report);
  if (std::abs(bias.growth) > 0.1)
    sentences.push_back(format("theta and the step change the growth rate by %+.0f %%: the cycle's amplitude suffers",
                               100 * bias.growth));
  if (cycle.orbit.residual > 1e-3 && report.motion.fidelity.used == CycleModel::full)
    sentences.push_back("a residual this large is no proof of a periodic motion");
  add_chatter(cycle.measured.history, sentences);
  const auto grow = std::ranges::count_if(report.point.modes.unstable(),
                                          [](const ComplexMode& mode) { return mode.frequency_hz() > 0; });
  if (grow > 1 && !has_run(report.attractors.outcome))
    sentences.push_back(format("%td modes are unstable, and other starts may lead to other motions: cycle.starts = 8 "
                               "shows them, by as many motions of some hundred periods",
                               grow));
  if (cycle.multipliers.stability == Stability::undecided)
    sentences.push_back("whether a vibration settles on this cycle is undecided: " + cycle.multipliers.would_decide);
  if (cycle.multipliers.stability == Stability::not_examined)
    sentences.push_back("whether this cycle attracts was not examined: -cycle_multipliers 20 does");
  return sentences;
}

} // namespace

Warnings warnings_of(const Report& report)
{
  Warnings warnings;
  if (has_run(report.point.equilibrium.outcome)) warnings.equilibrium = of_equilibrium(report);
  if (has_run(report.point.modes.outcome)) warnings.modes = of_modes(report);
  if (has_run(followed_estimate(report).outcome)) warnings.estimate = of_estimate(report);
  if (has_run(report.response.outcome)) warnings.response = of_response(report);
  if (has_run(report.transient.outcome) && report.transient.outcome.kind != OutcomeKind::refused)
    warnings.transient = of_transient(report);
  if (has_run(report.motion.cycle.outcome)) warnings.cycle = of_cycle(report);
  return warnings;
}

} // namespace squeal
