#include "squeal/report/table.hpp"

#include "branch_results.hpp"
#include "derived.hpp"
#include "response_results.hpp"
#include "robustness_results.hpp"
#include "sensitivity_results.hpp"
#include "squeal/report/heard.hpp"
#include "sweep_results.hpp"
#include "warnings.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>

namespace squeal
{

namespace
{

constexpr std::size_t modes_shown = 12;

std::string row(const std::string& head, const std::string& text)
{
  return format("  %-12s ", head.c_str()) + text + "\n";
}

std::string warning_rows(const std::vector<std::string>& sentences)
{
  std::string text;
  for (const std::string& sentence : sentences) text += row("", "WARNING: " + sentence);
  return text;
}

/// "converged", "NOT CONVERGED: reason": what is not a success must not look like one.
std::string outcome_text(const Outcome& outcome)
{
  std::string text = word(outcome.kind);
  if (!succeeded(outcome))
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text + (outcome.reason.empty() ? "" : ": " + outcome.reason);
}

/// Nothing of a stage that is off.
std::string outcome_row(const char* stage, const Outcome& outcome)
{
  return outcome.kind == OutcomeKind::off ? "" : row(stage, outcome_text(outcome));
}

std::string equilibrium_text(const Equilibrium& equilibrium, int pairs)
{
  std::string text = outcome_row("equilibrium", equilibrium.outcome);
  if (!has_run(equilibrium.outcome) || equilibrium.outcome.kind == OutcomeKind::no_equilibrium) return text;
  const NormalForces normal = normal_forces(equilibrium);
  text += row(
      "", format("%d of %d pairs closed after %d iterations", normal.closed, pairs, equilibrium.outcome.iterations));
  text +=
      row("", format("normal force %.9g N in all, %.4g to %.4g N a pair", normal.sum, normal.least, normal.greatest));
  text += row("", format("force residual %.1e, contact residual %.1e", equilibrium.force_residual,
                         equilibrium.outcome.residual));
  if (const auto& history = equilibrium.history)
    text +=
        row("", format("undriven pairs: %d stick, %d slipped last, %d open, %d near their limit; %d increments, the "
                       "last doubling of which changed reactions by %.1e",
                       history->stick, history->slip, history->open, history->at_limit, history->increments,
                       history->change));
  if (equilibrium.auxiliary_stiffness > 0)
    text +=
        row("", "a body is held by contact: solved with springs across the pairs, whose force is taken off exactly");
  return text;
}

std::string mode_line(const ComplexMode& mode)
{
  return row("", format("%12.7g %14.5g %12.5f %16.1e  %s", mode.frequency_hz(), mode.growth_rate(),
                        100 * mode.damping_ratio(), mode.backward_error, is_unstable(mode.lambda) ? "unstable" : ""));
}

std::string modes_text(const Modes& modes)
{
  std::string text = outcome_row("modes", modes.outcome);
  if (!has_run(modes.outcome)) return text;
  text +=
      row("", format("%d unstable of %zu modes below %.5g Hz, method \"%s\", largest backward error %.1e",
                     modes.unstable_count, modes.modes.size(), modes.band, word(modes.method), modes.outcome.residual));
  if (!modes.count_check.empty()) text += row("", "count: " + modes.count_check);
  text += row("", format("%12s %14s %12s %16s", "frequency", "growth rate", "damping", "backward error"));
  text += row("", format("%12s %14s %12s %16s", "[Hz]", "[1/s]", "[%]", "[-]"));
  const std::size_t unstable = static_cast<std::size_t>(std::max(modes.unstable_count, 0));
  const std::size_t shown = std::min(modes.modes.size(), std::max(modes_shown, unstable));
  for (std::size_t i = 0; i < shown; ++i) text += mode_line(modes.modes[i]);
  if (shown < modes.modes.size())
    text += row("", format("%zu more, all less unstable, are in report.json", modes.modes.size() - shown));
  return text;
}

std::string estimate_text(const Estimate& estimate)
{
  std::string text = outcome_row("estimate", estimate.outcome);
  if (!has_run(estimate.outcome)) return text;
  if (estimate.outcome.kind == OutcomeKind::balance) text += row("", format("amplitude %.5g m", estimate.amplitude));
  text += row("", format("first lift-off at %.5g m, first slip reversal at %.5g m", estimate.lift_off_amplitude,
                         estimate.reversal_amplitude));
  text += row("", format("friction injects %.5g 1/s, damping takes %.5g 1/s of the energy",
                         estimate.friction_rate_linear, estimate.damping_rate));
  return text;
}

std::string transient_text(const Report& report)
{
  const Trajectory& transient = report.transient;
  std::string text = outcome_row("transient", transient.outcome);
  if (!has_run(transient.outcome)) return text;
  text += row("", format("%ld steps of %.5g s, %.5g periods, theta %.4g", transient.steps, transient.step_size,
                         transient.periods, transient.theta));
  const std::string fit = std::isfinite(transient.growth_rate_fit) ? format("%.6g 1/s", transient.growth_rate_fit)
                                                                   : std::string("too short to fit");
  text +=
      row("", "growth rate before first lift-off: " + fit + format(", predicted %.6g 1/s", transient.predicted.real()));
  const StepBias bias = transient_bias(report);
  if (std::isfinite(bias.growth))
    text += row("", format("the step's own error: growth rate %+.1e, frequency %+.1e", bias.growth, bias.frequency));
  text += row("", format("energy defect %.1e of the energy, contact residual %.1e", transient.energy_defect_max,
                         transient.outcome.residual));
  if (transient.contact_steps_as_one > 0)
    text += row("", format("contact did not converge by patches or pieces in %ld steps: all pairs were swept as one",
                           transient.contact_steps_as_one));
  return text;
}

std::string cycle_text(const Report& report, const Scene& scene)
{
  const LimitCycle& cycle = report.motion.cycle;
  std::string text = outcome_row("cycle", cycle.outcome);
  if (!has_run(cycle.outcome) || cycle.outcome.kind == OutcomeKind::refused) return text;
  const std::string projected = std::isfinite(cycle.convergence.residual_projected)
                                    ? format("%.2e", cycle.convergence.residual_projected)
                                    : std::string("not tried");
  const std::string judged =
      cycle.tolerance > 0 ? format("tolerance %.0e", cycle.tolerance) : std::string("ended by the accuracy below");
  if (std::isfinite(cycle.orbit.residual))
    text +=
        row("", format("residual: full space %.2e (%s), projected ", cycle.orbit.residual, judged.c_str()) + projected);
  text += row("", format("%d Newton steps, %ld periods integrated, %d steps a period", cycle.convergence.iterations,
                         cycle.convergence.periods, cycle.steps_per_period));
  for (const SeenGrowth& seen : cycle.multipliers.seen)
    text += row("", format("seen over %ld periods from %.2g %% beside it: grows %.6f times a period, error bar %.1e",
                           seen.periods, 100 * seen.part, seen.growth, seen.error));
  if (cycle.outcome.kind != OutcomeKind::converged) return text; // the figures of no cycle would mislead
  text += row("", format("period %.10g s, frequency %.8g Hz", cycle.orbit.period, 1 / cycle.orbit.period));
  if (const double bias = cycle_bias(report).frequency; std::isfinite(bias))
    text += row("", format("the step's own error of the period: about %+.1e", -bias));
  text += row("", format("mean energy %.7g J, fluctuating %.7g J", cycle.measured.mean_energy,
                         cycle.measured.mean_fluctuating_energy));
  text +=
      row("", format("open pairs: %.2f on average, %d at most; sticking: %d at most", cycle.measured.open_pairs_mean,
                     cycle.measured.open_pairs_max, cycle.measured.stick_pairs_max));
  if (!cycle.multipliers.values.empty())
    text += row("", format("%s by %zu multipliers at %d steps a period: the largest is %.6f, error bar %.1e",
                           word(cycle.multipliers.stability), cycle.multipliers.values.size(),
                           report.motion.fidelity.verdict_steps, std::abs(cycle.multipliers.values.front()),
                           cycle.multipliers.errors.front()));
  const std::size_t probes = std::min(scene.probes.size(), cycle.measured.peak_to_peak.size());
  for (std::size_t i = 0; i < probes; ++i)
    text +=
        row("", format("probe %s: %.6g m peak to peak", scene.probes[i].name.c_str(), cycle.measured.peak_to_peak[i]));
  return text;
}

std::string mean_text(const char* name, const MeanValue& mean, const char* unit)
{
  return format("%s %.4g +- %.1g %s", name, mean.value, mean.error, unit);
}

std::string settled_text(const SettledMotion& settled, const Scene& scene)
{
  if (!has_run(settled.outcome)) return "";
  const ExaminedMotion& motion = settled.examined;
  std::string text = row("settled", outcome_text(settled.outcome));
  text += row("", format("%s: %zu periods of %.6g s, the first %zu left out; error bars of 95 %%",
                         word(motion.verdict.kind), motion.periods(), settled.period, motion.discarded));
  text += row("", mean_text("mean energy", settled.energy, "J,") + " " +
                      mean_text("fluctuating", settled.fluctuating_energy, "J") +
                      format(", of single periods %.3g to %.3g J", settled.least_energy, settled.greatest_energy));
  text +=
      row("", format("with half as many steps a period the fluctuating energy changes by %.1g J", settled.step_error));
  text += row("", mean_text("power of damping", settled.damping_power, "W,") + " " +
                      mean_text("of contact", settled.contact_power, "W,") + " " +
                      mean_text("of the load", settled.load_power, "W"));
  text +=
      row("", format("of the pairs %.1f %% are open, %.1f %% stick, %.1f %% slip", 100 * settled.open_fraction.value,
                     100 * settled.stick_fraction.value, 100 * settled.slip_fraction.value));
  std::string exponents = "Lyapunov exponents a period:";
  for (const MeanValue& one : motion.exponents) exponents += format(" %.4f +- %.4f", one.value, one.error);
  text += row("", exponents);
  text += row("", format("base frequencies %.6g and %.6g Hz, of %zu lines", motion.base.first, motion.base.second,
                         motion.spectrum.lines.size()));
  const std::size_t probes = std::min(scene.probes.size(), settled.peak_to_peak.size());
  for (std::size_t i = 0; i < probes; ++i)
    text +=
        row("", mean_text(("probe " + scene.probes[i].name + ":").c_str(), settled.peak_to_peak[i], "m peak to peak"));
  return text;
}

std::string fidelity_text(const Fidelity& fidelity)
{
  if (fidelity.asked == CycleModel::full) return "";
  std::string outcome = std::string(word(fidelity.asked)) + ": ";
  if (fidelity.full_periods + fidelity.reduced_periods > 0)
    outcome += format("%s model %s", word(fidelity.used), fidelity.full_periods > 0 ? "used" : "tried") +
               (fidelity.reason.empty() ? "" : ", ");
  std::string text = row("fidelity", outcome + fidelity.reason);
  if (fidelity.full_periods == 0) return text;
  if (fidelity.used == CycleModel::reduced)
    text +=
        row("", format("%d shapes: %d of modes, %d of attachment; %d pairs in contact with friction, %d taken to slide",
                       fidelity.size, fidelity.modes, fidelity.attachment_shapes, fidelity.active_pairs,
                       fidelity.sliding_pairs));
  if (fidelity.left_out_shapes > 0)
    text +=
        row("", format("%d more attachment shapes were left out, with %.1e of these pairs' own compliance on average",
                       fidelity.left_out_shapes, fidelity.lost_compliance));
  text += row("", format("%ld periods of the reduced model, %ld of the full one", fidelity.reduced_periods,
                         fidelity.full_periods));
  if (std::isfinite(fidelity.frequency_error))
    text += row("", format("error estimates (asked for %.0e): frequency %.1e, energy %.1e; of the steps %.1e, %.1e",
                           fidelity.accuracy, fidelity.frequency_error, fidelity.energy_error,
                           fidelity.step_frequency_error, fidelity.step_energy_error));
  return text;
}

/// The outcome of a stage, and the lines that it has if it ran.
template <class Lines> std::string optional_text(const char* head, const Outcome& outcome, Lines lines)
{
  std::string text = outcome_row(head, outcome);
  if (has_run(outcome))
    for (const std::string& line : lines()) text += row("", line);
  return text;
}

/// The attempts to find a motion, where one did not suffice.
std::string attempts_text(const std::vector<Attempt>& attempts)
{
  std::string text;
  if (attempts.size() < 2) return text;
  for (const auto& [name, steps, outcome] : attempts)
    text += row(text.empty() ? "attempts" : "", name + format(", %d steps a period: ", steps) + outcome_text(outcome));
  return text;
}

std::vector<std::string> coarse_lines(const CoarseStart& coarse)
{
  if (coarse.outcome.kind != OutcomeKind::converged) return {};
  return {format("cycle of %lld degrees of freedom and %d contact pairs, frequency %.8g Hz, fluctuating energy %.7g J, "
                 "%ld periods integrated",
                 static_cast<long long>(coarse.dofs), coarse.pairs, 1 / coarse.period, coarse.mean_fluctuating_energy,
                 coarse.periods)};
}

std::string timings_text(const Report& report)
{
  double total = 0;
  std::string text;
  for (const auto& [stage, seconds, processor_seconds] : report.timings)
  {
    text += row(text.empty() ? "time" : "", format("%10.2f s  %s", seconds, word(stage)));
    total += seconds;
  }
  return text + row("", format("%10.2f s  in all", total));
}

} // namespace

std::string table(const Report& report, const Scene& scene)
{
  const ModelSummary& model = report.model;
  std::string text = "\n" + (scene.title.empty() ? scene.file.filename().string() : scene.title) + "\n";
  text += row("model", format("%lld degrees of freedom, %ld elements, %d contact pairs, %d rank%s",
                              static_cast<long long>(model.dofs), model.elements, model.pairs, model.ranks,
                              model.ranks == 1 ? "" : "s")) +
          warning_rows(model.warnings);
  const Warnings warnings = warnings_of(report);
  text += equilibrium_text(report.point.equilibrium, model.pairs) + warning_rows(warnings.equilibrium);
  text += modes_text(report.point.modes) + warning_rows(warnings.modes);
  text += estimate_text(followed_estimate(report)) + warning_rows(warnings.estimate);
  text += optional_text("response", report.response.outcome, [&] { return response_lines(report.response, scene); }) +
          warning_rows(warnings.response);
  text += transient_text(report) + warning_rows(warnings.transient);
  text += optional_text("coarse start", report.coarse.outcome, [&] { return coarse_lines(report.coarse); });
  text += cycle_text(report, scene) + warning_rows(warnings.cycle);
  text += settled_text(report.motion.settled, scene);
  text += fidelity_text(report.motion.fidelity) + attempts_text(report.motion.attempts);
  text += optional_text("attractors", report.attractors.outcome, [&] { return attractor_lines(report.attractors); });
  text += optional_text("branch", report.branch.outcome, [&] { return branch_lines(report.branch, scene); });
  text += optional_text("sensitivity", report.sensitivity.outcome,
                        [&] { return sensitivity_lines(report.sensitivity, scene); });
  text += optional_text("sweep", report.sweep.outcome, [&] { return sweep_lines(report.sweep, scene); });
  text += optional_text("robustness", report.robustness.outcome,
                        [&] { return robustness_lines(report.robustness, scene); });
  return text + timings_text(report) + row("heard", heard(report, scene));
}

void print_table(const Report& report, const Scene& scene, MPI_Comm comm)
{
  if (rank_of(comm) != 0) return;
  std::fputs(table(report, scene).c_str(), stdout);
  std::fflush(stdout);
}

} // namespace squeal
