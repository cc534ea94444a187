/// Results of motions in time: the transient, and the search for what vibrates.
#include "result.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// Relative errors of a mode by theta and the step, by the theory of the scheme; NaN of one that does not oscillate.
struct StepBias
{
  double growth = std::numeric_limits<double>::quiet_NaN();
  double frequency = std::numeric_limits<double>::quiet_NaN();
};

StepBias bias_of(std::complex<double> lambda, std::complex<double> discrete)
{
  if (lambda.imag() == 0) return {};
  return {discrete.real() / lambda.real() - 1, discrete.imag() / lambda.imag() - 1};
}

StepBias cycle_bias(const Report& report)
{
  const LimitCycle& cycle = report.motion.cycle;
  if (report.point.modes.modes.empty() || !(cycle.orbit.period > 0)) return {};
  const std::complex<double> lambda = report.point.modes.modes[report.motion.followed.index].lambda;
  return bias_of(lambda, discrete_eigenvalue(lambda, cycle.theta, cycle.orbit.period / cycle.steps_per_period));
}

/// The part of the normal force that alternates from step to step: rms of its second difference / 4, over its mean.
void add_chatter(Entry out, const History& history)
{
  const std::vector<double>& force = history.normal_force;
  double squares = 0, sum = 0;
  for (std::size_t i = 1; i + 1 < force.size(); ++i)
  {
    const double bend = force[i - 1] - 2 * force[i] + force[i + 1];
    squares += bend * bend;
    sum += force[i];
  }
  const double chatter = sum > 0 ? std::sqrt(squares * static_cast<double>(force.size() - 2)) / 4 / sum : 0;
  out.add("normal_force_chatter", "-", "part of the normal force that alternates between steps", chatter);
  if (chatter > 0.1)
    out.warn(Severity::note,
             format("the normal force jumps between steps by %.0f %% of its mean: impacts of the contact nodes' own "
                    "mass; average it over steps, or refine the contact surface",
                    100 * chatter));
}

void add_attempt(Entry out, const Attempt& attempt)
{
  out.show("name", "text", "way in which a motion was sought; in order", attempt.name);
  out.show("steps_per_period", "-", "time steps of the period with which it began", attempt.steps_per_period);
  out.show("outcome", "word", "its outcome, as of a stage", word(attempt.outcome.kind));
  out.text("reason", "why it ended so", attempt.outcome.reason);
}

void add_seen(Entry out, const SeenGrowth& seen)
{
  out.show("part", "-", "part of the cycle's fluctuation at which a watched motion beside it began", seen.part);
  out.show("periods", "-", "periods in which it stayed near", seen.periods);
  out.show("growth", "-", "growth of its distance from the cycle in a period", seen.growth);
  out.error("error", "error bar of that, by standard error, the cycle's residual and the distance", seen.error);
}

void add_verdict(Entry out, const Multipliers& multipliers)
{
  const auto& values = multipliers.values;
  out.show("stability", "verdict on the cycle", multipliers.stability);
  out.text("would_decide", "of an undecided cycle: what would decide", multipliers.would_decide);
  if (!out.has(!values.empty())) return; // the run was asked to end before
  out.show("method", "way to the multipliers", multipliers.method);
  out.show("largest", "-", "modulus of the largest multiplier", values.empty() ? 0 : std::abs(values.front()));
  out.error("largest_error", "its error bar", values.empty() ? 0 : multipliers.errors.front());
  out.show("upper_bound", "-", "bound of all moduli; below 1: stable", largest_upper_bound(multipliers));
  out.show("count", "-", "multipliers that were computed", values.size());
  out.add("trivial_error", "-", "distance from 1 of the multiplier of a shift in time, the largest of the grids",
          multipliers.trivial_error);
  out.add("periods_integrated", "-", "columns of the tangent, beside the periods of the cycle", multipliers.periods);
  add_multipliers(out, "values", multipliers);
  if (out.has(multipliers.offsets > 0))
    out.show("offsets_held", "-", "offsets of joints that stay as they are, each a multiplier 1 that is left out",
             multipliers.offsets);
  if (out.has(multipliers.crossing != Crossing::none))
    out.show("crossing", "way in which the largest multiplier of an unstable cycle is out", multipliers.crossing);
  out.text("refusal", "why the whole matrix took the place of the oblique projection", multipliers.refusal);
  if (out.has(!multipliers.seen.empty())) out.list("seen", add_seen, multipliers.seen);
}

void add_iteration(Entry out, const NewtonRecord& record)
{
  out.add("stage", "kind of an iteration", record.stage);
  out.add("unknowns", "-", "number of unknowns", record.unknowns);
  out.add("periods", "-", "periods integrated so far", record.periods);
  out.add("period", "s", "period", record.period);
  out.add("residual_projected", "-", "residual on the subspace; `null`: there is none", record.residual_projected);
  out.add("residual_full", "-", "residual in the full space", record.residual_full);
}

void add_spread(Entry out, const OffsetSpread& spread)
{
  out.add("contact", "-", "number of a contact whose held pairs are moved all alike, from 0", spread.contact);
  out.add("direction", "-", "along which of their tangents, from 0", spread.direction);
  out.add("least", "m", "least offset from that of the cycle, where the first pair would slip", spread.least);
  out.add("greatest", "m", "greatest one", spread.greatest);
  out.add("period_by_offset", "s/m", "change of the period by the offset", spread.by_period);
  out.add("energy_by_offset", "J/m", "change of the mean fluctuating energy by it", spread.by_energy);
}

void add_joints(Entry out, const LimitCycle& cycle)
{
  const JointUse& joints = cycle.measured.joints;
  const std::vector<double>& work = cycle.measured.history.joint_work;
  out.show("held", "-", "pairs without a drive that stick in every step: each keeps its offset", joints.held);
  out.show("slipping", "-", "those that slip or open in some", joints.slipping);
  out.show("largest_use", "-", "largest friction of one over its limit", joints.largest);
  out.show("at_edge", "-", "pairs that stick throughout, with a use within 1e-3 of 1", joints.at_edge);
  out.add("work", "J", "their work in a period, of each contact, below zero: what they take", work);
  if (out.has(!cycle.spreads.empty())) out.list("offsets", add_spread, cycle.spreads);
}

/// Figures of the cycle, which would mislead where none was found.
void add_figures(Entry out, const LimitCycle& cycle, const StepBias& bias)
{
  const MeasuredPeriod& measured = cycle.measured;
  out.show("period", "s", "period of the cycle", cycle.orbit.period);
  out.brief("frequency_hz", "Hz", "frequency of the cycle", 1 / cycle.orbit.period);
  out.show("frequency_bias", "-", "relative error of the frequency by theta and the step", bias.frequency);
  out.add("growth_rate_bias", "-", "relative error of the mode's growth rate by theta and the step", bias.growth);
  out.show("mean_energy", "J", "mean mechanical energy over the period", measured.mean_energy);
  out.brief("mean_fluctuating_energy", "J", "mean energy about equilibrium", measured.mean_fluctuating_energy);
  out.show("open_pairs_mean", "-", "mean number of open pairs", measured.open_pairs_mean);
  out.show("open_pairs_max", "-", "largest number of open pairs", measured.open_pairs_max);
  out.show("stick_pairs_max", "-", "largest number of sticking pairs", measured.stick_pairs_max);
  add_probes(out, "peak_to_peak", "swing of the probe", measured.peak_to_peak);
  const JointUse& joints = measured.joints;
  if (out.has(joints.held + joints.slipping > 0)) add_joints(out.group("joints"), cycle);
}

void warn_of_cycle(Entry out, const Report& report, const StepBias& bias)
{
  const LimitCycle& cycle = report.motion.cycle;
  if (std::abs(bias.growth) > 0.1)
    out.warn(Severity::warning,
             format("theta and the step change the growth rate by %+.0f %%: the cycle's amplitude suffers",
                    100 * bias.growth));
  if (cycle.orbit.residual > 1e-3 && report.motion.fidelity.used == CycleModel::full)
    out.warn(Severity::warning, "a residual this large is no proof of a periodic motion");
  const auto grow = std::ranges::count_if(report.point.modes.unstable(),
                                          [](const ComplexMode& mode) { return mode.frequency_hz() > 0; });
  if (grow > 1 && !has_run(report.attractors.outcome))
    out.warn(Severity::note,
             format("%td modes are unstable, and other starts may lead to other motions: cycle.starts = 8 shows them, "
                    "by as many motions of some hundred periods",
                    grow));
  if (cycle.multipliers.stability == Stability::undecided)
    out.warn(Severity::warning,
             "whether a vibration settles on this cycle is undecided: " + cycle.multipliers.would_decide);
  if (cycle.multipliers.stability == Stability::not_examined)
    out.warn(Severity::warning, "whether this cycle attracts was not examined: -cycle_multipliers 20 does");
}

void add_reached(Entry out, const ReachedMotion& motion)
{
  out.brief("kind", "what the motion does; one whose energy has a trend is unsettled", motion.kind);
  out.show("mean_fluctuating_energy", "J", "mean energy about equilibrium", motion.energy.value);
  out.error("energy_error", "its error bar", motion.energy.error);
  out.brief("frequency_hz", "Hz", "frequency of the mode's coordinate that moves most", motion.frequency.value);
  out.error("frequency_error", "its error bar", motion.frequency.error);
  out.brief("starts", "-", "numbers of the starts that lead to this motion, from 0", motion.starts);
}

void add_line(Entry out, const Line& line)
{
  out.add("frequency_hz", "Hz", "the strongest lines of its spectrum", line.frequency_hz);
  out.add("frequency_error", "Hz", "their error bars, by the length and half as many steps", line.frequency_error);
  out.add("amplitude", "m or N", "their amplitudes", line.amplitude);
}

void add_exponent(Entry out, const MeanValue& exponent)
{
  out.show("mean", "-", "a Lyapunov exponent a period, the largest first", exponent.value);
  out.error("error", "its error bar", exponent.error);
}

void add_base(Entry out, const BaseFrequencies& base)
{
  out.show("first", "Hz", "the strongest line of the spectrum", base.first);
  out.show("second", "Hz", "the strongest that is no multiple of it; 0: none", base.second);
  out.show("closes_after", "-", "periods of the first after which the motion closes; 0: none", base.closes_after);
  out.add("explained", "-", "part of the power beside the first's multiples in combinations of both", base.explained);
}

} // namespace

void add_multipliers(Entry out, const char* name, const Multipliers& multipliers)
{
  const auto add = [](Entry one, const std::complex<double>& value, double error)
  {
    one.add("real", "-", "real part of a multiplier, the largest first", value.real());
    one.add("imaginary", "-", "its imaginary part", value.imag());
    one.add("error", "-", "its error bar", error);
  };
  out.list(name, add, multipliers.values, multipliers.errors);
}

void add_transient(Entry out, const Report& report)
{
  const Trajectory& run = report.transient;
  const std::vector<ComplexMode>& modes = report.point.modes.modes;
  const bool follows = !modes.empty() && std::isfinite(run.predicted.real());
  const StepBias bias = follows ? bias_of(modes.front().lambda, run.predicted) : StepBias{};
  const Entry of_mode = follows ? out : out.hidden();
  const double fit = run.growth_rate_fit, predicted = run.predicted.real();
  out.show("theta", "-", "parameter of the theta-method", run.theta);
  out.show("steps", "-", "time steps made", run.steps);
  out.show("step_size", "s", "time step", run.step_size);
  of_mode.show("periods", "-", "length in periods of the followed mode", run.periods);
  of_mode.show("growth_rate_fit", "1/s", "its growth rate before first lift-off; `null`: too short",
               run.growth_rate_fit);
  of_mode.show("growth_rate_predicted", "1/s", "growth rate by the theory of the scheme", run.predicted.real());
  of_mode.show("growth_rate_bias", "-", "relative error of the growth rate by theta and the step", bias.growth);
  of_mode.show("frequency_bias", "-", "relative error of the frequency by theta and the step", bias.frequency);
  add_chatter(out, run.history);
  out.check(run.energy_defect_max <= 1e-8, "energy_defect_max", "-",
            "largest defect of the energy identity over the energy", run.energy_defect_max);
  if (out.has(!run.history.joint_work.empty()))
    out.add("joint_work", "J", "work of the pairs without a drive of each contact, below zero: what they take",
            run.history.joint_work);
  out.show("residual", "-", "largest natural map of a pair over the largest reaction", run.outcome.residual);
  out.add("contact_iterations_mean", "-", "mean number of contact iterations a step", run.contact_iterations_mean);
  out.add("seconds_per_step", "s", "time of a step", run.seconds_per_step);
  if (std::abs(bias.growth) > 0.1)
    out.warn(Severity::warning,
             format("theta and the step change the growth rate by %+.0f %%: more steps a period, or theta = 1/2",
                    100 * bias.growth));
  if (std::abs(fit - predicted) > 0.01 * std::abs(predicted))
    out.warn(Severity::note,
             "the fitted growth rate is not the predicted one: other motion than the mode is in the start");
  if (run.energy_defect_max > 1e-8)
    out.warn(Severity::warning, "the energy identity of the scheme is missed: tighten -transient_contact_tolerance");
}

void add_cycle(Entry out, const Report& report)
{
  const LimitCycle& cycle = report.motion.cycle;
  const StepBias bias = cycle_bias(report);
  const bool is_found = cycle.outcome.kind == OutcomeKind::converged;
  add_figures(is_found ? out : out.hidden(), cycle, bias);
  out.add("mode", "-", "place of the followed mode in `modes.modes`, from 0", report.motion.followed.index);
  const bool is_answer = cycle.outcome.kind != OutcomeKind::settled, // where another motion is, nothing rests on it
      closes = cycle.tolerance > 0 ? cycle.orbit.residual <= cycle.tolerance : is_found;
  out.check(is_answer ? std::optional(closes) : std::nullopt, "residual_full", "-",
            "distance of end and start over that from equilibrium", cycle.orbit.residual);
  out.show("tolerance", "-", "largest residual of a cycle; 0: `accuracy` decided instead", cycle.tolerance);
  out.add("residual_projected", "-", "residual on the subspace; `null`: not tried",
          cycle.convergence.residual_projected);
  out.show("newton_iterations", "-", "iterations of the shooting", cycle.convergence.iterations);
  out.show("periods_integrated", "-", "periods integrated in all", cycle.convergence.periods);
  out.show("steps_per_period", "-", "time steps of the period", cycle.steps_per_period);
  add_chatter(is_found ? out : out.hidden(), cycle.measured.history);
  if (out.has(cycle.multipliers.stability != Stability::not_examined))
    add_verdict(out.group("multipliers"), cycle.multipliers);
  out.list("newton", add_iteration, cycle.convergence.records);
  if (is_found) warn_of_cycle(out, report, bias);
}

void add_attempts(Entry out, const std::vector<Attempt>& attempts)
{
  if (out.has(!attempts.empty())) out.list("attempts", add_attempt, attempts);
}

void add_settled(Entry out, const Report& report)
{
  const SettledMotion& settled = report.motion.settled;
  const ExaminedMotion& motion = settled.examined;
  const auto& probes = out.scene().probes;
  const bool of_probe = motion.followed >= 0;
  out.brief("kind", "kind of the motion", motion.verdict.kind);
  out.add("between", "text", "of an undecided one: between what", motion.verdict.between);
  out.add("would_decide", "text", "of an undecided one: what would decide", motion.verdict.would_decide);
  out.show("periods", "-", "periods that were integrated", motion.periods());
  out.show("discarded", "-", "of these, before the motion was stationary", motion.discarded);
  out.show("period", "s",
           "that of the strongest line, or its multiple that closes; the search's where fewer than 16 were seen",
           motion.period);
  out.add("steps_per_period", "-", "time steps of a period, rounded", settled.steps_per_period);
  out.mean("mean_energy", "J", "mean mechanical energy", settled.energy);
  out.mean("mean_fluctuating_energy", "J", "mean energy about equilibrium", settled.fluctuating_energy);
  out.show("step_error", "J", "change of that with half as many steps a period", settled.step_error);
  out.show("least_energy", "J", "least mean of it over one period", settled.least_energy);
  out.show("greatest_energy", "J", "greatest mean of it over one period", settled.greatest_energy);
  out.add("shapes", "-", "number of shapes on which the motion is kept", settled.shapes.coordinates.size());
  out.add("energy_beside_shapes", "-", "part of its kinetic energy that they leave out", settled.shapes.left_out);
  out.mean("damping_power", "W", "mean power that damping takes", settled.damping_power);
  out.mean("contact_power", "W", "mean power of the contact forces", settled.contact_power);
  out.mean("load_power", "W", "mean power of the load", settled.load_power);
  out.mean("open_fraction", "-", "mean part of the pairs that are open", settled.open_fraction);
  out.mean("stick_fraction", "-", "mean part of the pairs that stick", settled.stick_fraction);
  out.mean("slip_fraction", "-", "mean part of the pairs that slip", settled.slip_fraction);
  const auto add_swing = [swings = out.group("peak_to_peak")](const std::string& name, const MeanValue& swing)
  { swings.mean(name, "m", "mean swing of the probe within a period", swing); };
  for (std::size_t i = 0; i < std::min(probes.size(), settled.peak_to_peak.size()); ++i)
    add_swing(probes[i].name, settled.peak_to_peak[i]);
  if (out.is_example()) add_swing("<probe>", {});
  out.list("exponents", add_exponent, motion.exponents);
  add_base(out.group("base_frequencies_hz"), motion.base);
  out.add("spectrum_of", "text", "the probe that swings most, or `normal force` without probes",
          of_probe ? probes[static_cast<std::size_t>(motion.followed)].name : "normal force");
  constexpr std::size_t most = 20;
  std::vector<Line> lines = motion.spectrum.lines;
  lines.resize(std::min(most, lines.size()));
  out.list("lines", add_line, lines);
}

void add_fidelity(Entry whole, const Fidelity& fidelity)
{
  const bool is_chosen = fidelity.asked != CycleModel::full; // by squeal, or by the scene
  const Entry out = is_chosen ? whole : whole.hidden();
  out.show("asked", "the scene's `fidelity`", fidelity.asked);
  out.brief("used", "model on which the cycle was sought", fidelity.used);
  out.text("reason", "why that model was used", fidelity.reason);
  if (!out.has(is_chosen)) return;
  out.show("accuracy", "-", "the scene's `accuracy`", fidelity.accuracy);
  const Entry reduced = fidelity.used == CycleModel::reduced ? out : out.hidden();
  reduced.show("size", "-", "shapes of the reduced model", fidelity.size);
  reduced.show("modes", "-", "shapes of modes among them", fidelity.modes);
  reduced.show("attachment_shapes", "-", "attachment shapes among them", fidelity.attachment_shapes);
  out.add("left_out_shapes", "-", "attachment shapes that are left out", fidelity.left_out_shapes);
  out.add("lost_compliance", "-", "mean part of the active pairs' compliance in those", fidelity.lost_compliance);
  reduced.show("active_pairs", "-", "pairs with unilateral contact and friction in it", fidelity.active_pairs);
  reduced.show("sliding_pairs", "-", "pairs taken to stay closed and sliding; the rest stay open",
               fidelity.sliding_pairs);
  out.add("steps_per_period", "-", "time steps a period that were chosen", fidelity.steps_per_period);
  out.show("verdict_steps", "-", "time steps a period at which the verdict was given", fidelity.verdict_steps);
  out.add("contact_tolerance", "-", "contact tolerance that was chosen", fidelity.contact_tolerance);
  reduced.show("reduced_periods", "-", "periods of the reduced model integrated", fidelity.reduced_periods);
  out.show("full_periods", "-", "periods of the full model integrated", fidelity.full_periods);
  const Entry errors = out.group("error_estimates");
  errors.check(!(fidelity.frequency_error > fidelity.accuracy), "frequency", "-",
               "relative error of the frequency by the model", fidelity.frequency_error);
  errors.check(!(fidelity.energy_error > fidelity.accuracy), "energy", "-",
               "relative error of the mean fluctuating energy by the model", fidelity.energy_error);
  // the accuracy bounds the error of steps that squeal chooses; that of the scene's own steps is a result
  const double most = fidelity.chooses_steps ? fidelity.accuracy : HUGE_VAL;
  errors.check(!(fidelity.step_frequency_error > most), "step_frequency", "-",
               "relative error of the frequency by the step", fidelity.step_frequency_error);
  errors.check(!(fidelity.step_energy_error > most), "step_energy", "-", "relative error of that energy by the step",
               fidelity.step_energy_error);
}

void add_attractors(Entry out, const Report& report)
{
  const Attractors& attractors = report.attractors;
  out.show("periods", "-", "periods of the mode that each start was integrated over", attractors.periods);
  out.add("starts", "text", "what each start is made of", attractors.starts);
  out.list("motions", add_reached, attractors.motions);
}

} // namespace squeal
