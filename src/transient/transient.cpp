#include "squeal/transient/transient.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/equilibrium/state.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <Eigen/Core>
#include <limits>

namespace squeal
{

ModeAmplitude follow(const Structure& structure, const Equilibrium& equilibrium, const ComplexMode& mode)
{
  ModeAmplitude amplitude;
  amplitude.mode = &mode;
  amplitude.v_real = zeros_like(structure.load);
  amplitude.v_imaginary = zeros_like(structure.load);
  const double sigma = mode.lambda.real(), omega = mode.lambda.imag();
  check(VecAXPBYPCZ(amplitude.v_real, sigma, -omega, 0, mode.real, mode.imaginary));
  check(VecAXPBYPCZ(amplitude.v_imaginary, omega, sigma, 0, mode.real, mode.imaginary));

  amplitude.K_real = product(mode.real, structure.K, equilibrium.u);
  amplitude.K_imaginary = product(mode.imaginary, structure.K, equilibrium.u);
  amplitude.rr = product(mode.real, structure.K, mode.real) + product(amplitude.v_real, structure.M, amplitude.v_real);
  amplitude.ri =
      product(mode.real, structure.K, mode.imaginary) + product(amplitude.v_real, structure.M, amplitude.v_imaginary);
  amplitude.ii = product(mode.imaginary, structure.K, mode.imaginary) +
                 product(amplitude.v_imaginary, structure.M, amplitude.v_imaginary);
  return amplitude;
}

void observe(ModeAmplitude& amplitude, double time, Vec Ku, Vec Mv)
{
  const std::array<Vec, 4> left = {amplitude.mode->real, amplitude.v_real, amplitude.mode->imaginary,
                                   amplitude.v_imaginary};
  const std::array<Vec, 4> right = {Ku, Mv, Ku, Mv};
  std::array<double, 4> product{};
  for (std::size_t i = 0; i < 4; ++i) check(VecDotBegin(left[i], right[i], &product[i]));
  for (std::size_t i = 0; i < 4; ++i) check(VecDotEnd(left[i], right[i], &product[i]));
  const double a = product[0] - amplitude.K_real + product[1], b = product[2] - amplitude.K_imaginary + product[3];
  const double determinant = amplitude.rr * amplitude.ii - amplitude.ri * amplitude.ri;
  const double x = (amplitude.ii * a - amplitude.ri * b) / determinant;
  const double y = (amplitude.rr * b - amplitude.ri * a) / determinant;
  amplitude.time.push_back(time);
  amplitude.log_modulus.push_back(std::log(std::hypot(x, y)));
}

double growth_rate(const ModeAmplitude& amplitude, double period)
{
  const std::vector<double>&t = amplitude.time, &y = amplitude.log_modulus;
  const double slack = 1 + 1e-9; // a whole period must not be lost to rounding
  const double length = t.empty() ? 0 : period * std::floor((t.back() - t.front()) / period * slack);
  if (!(length > 0)) return std::numeric_limits<double>::quiet_NaN();
  const auto count = std::upper_bound(t.begin(), t.end(), t.front() + length * slack) - t.begin();
  const Eigen::Map<const Eigen::ArrayXd> at(t.data(), count), log(y.data(), count);
  const Eigen::ArrayXd away = at - at.mean();
  return (away * (log - log.mean())).sum() / away.square().sum();
}

// The time loop: marching with a history, and the run that follows one mode (headers: the equations).

namespace
{

constexpr const char* name_of_checkpoint = "transient";

/// Distance of a state to the equilibrium, and its products, at the current step.
struct Fluctuation
{
  Vec u0 = nullptr;
  Owned<Vec> Ku0, du, Kdu;
};

/// Differences are taken before products: near equilibrium du'K du is a small part of u'K u.
void update(Fluctuation& fluctuation, const State& state, const StepWork& work)
{
  check(VecWAXPY(fluctuation.du, -1, fluctuation.u0, state.u));
  check(VecWAXPY(fluctuation.Kdu, -1, fluctuation.Ku0, work.Ku));
}

double energy(const Fluctuation& fluctuation, const State& state, const StepWork& work)
{
  double kinetic = 0, potential = 0;
  check(VecDotBegin(state.v, work.Mv, &kinetic));
  check(VecDotBegin(fluctuation.du, fluctuation.Kdu, &potential));
  check(VecDotEnd(state.v, work.Mv, &kinetic));
  check(VecDotEnd(fluctuation.du, fluctuation.Kdu, &potential));
  return (kinetic + potential) / 2;
}

void record(const StepReport& report, double h, const State& state, int directions, Vec probe_values,
            const Recorder& recorder)
{
  History& history = recorder.history;
  history.time.push_back(state.time);
  history.energy.push_back(report.energy);
  history.damping_power.push_back(report.damping_work / h);
  history.contact_power.push_back(report.contact_work / h);
  history.load_power.push_back(report.load_work / h);
  history.drive_power.push_back(report.drive_work / h);
  history.joint_work.resize(std::max(history.joint_work.size(), report.joint_work.size()));
  for (std::size_t i = 0; i < report.joint_work.size(); ++i) history.joint_work[i] += report.joint_work[i];
  const PairView reactions(state.reactions, directions);
  double normal_force = 0;
  for (std::size_t pair = 0; pair < reactions.pairs(); ++pair) normal_force += reactions.normal(pair);
  history.normal_force.push_back(normal_force);
  history.open.push_back(report.open);
  history.stick.push_back(report.stick);
  history.slip.push_back(report.slip);
  if (!recorder.probes) return;
  check(MatMult(recorder.probes, state.u, probe_values));
  const std::vector<double> values = all_entries(probe_values);
  for (std::size_t i = 0; i < values.size(); ++i) history.probes[i].push_back(values[i]);
}

/// Persistent sliding: the pairs closed at equilibrium are closed, none sticks, none slips backwards.
bool slides_as_at_equilibrium(const Interface& interface, const Equilibrium& equilibrium,
                              const std::vector<double>& drive, const State& state)
{
  const std::vector<double>& reactions = state.reactions;
  const std::vector<ContactStatus> status = contact_status(interface, reactions, state.v);
  for (std::size_t i = 0; i < status.size(); ++i)
  {
    if (equilibrium.closed[i] != (status[i] != ContactStatus::open)) return false;
    if (is_undriven(interface, i)) continue; // the modes take it as stuck, whatever it does
    if (status[i] == ContactStatus::stick) return false;
    const std::span<const double> friction = PairView(reactions, interface.directions).tangential(i);
    if (dot(TangentView(drive, interface.directions).of(i), friction) < 0) return false;
  }
  return true;
}

/// The largest factor on mu r_n. Between two times of the ramps it is a parabola.
double largest_friction(const Ramps& ramps)
{
  std::vector<double> times{0};
  for (const FactorTable* factor : {&ramps.load, &ramps.friction})
    times.insert(times.end(), factor->at.begin(), factor->at.end());
  std::sort(times.begin(), times.end());
  double largest = factor_at(ramps.load, 0) * factor_at(ramps.friction, 0);
  for (std::size_t i = 1; i < times.size(); ++i)
  {
    const double a = factor_at(ramps.load, times[i - 1]), b = factor_at(ramps.friction, times[i - 1]);
    const double da = factor_at(ramps.load, times[i]) - a, db = factor_at(ramps.friction, times[i]) - b;
    const double top = da * db < 0 ? std::clamp(-(a * db + b * da) / (2 * da * db), 0., 1.) : 1;
    largest = std::max({largest, (a + top * da) * (b + top * db), (a + da) * (b + db)});
  }
  return largest;
}

bool counts_steps(const TransientSettings& settings)
{
  return settings.steps > 0 && settings.step_size > 0;
}

/// Step size and number of steps.
long plan(Trajectory& trajectory, const ComplexMode* mode, TransientSettings settings)
{
  if (mode) settings = planned(settings, *mode);
  if (!counts_steps(settings))
    throw Error("transient.periods counts periods of a mode, and there is none to follow: give transient.steps and "
                "transient.step_size");
  trajectory.theta = settings.theta;
  trajectory.step_size = settings.step_size;
  trajectory.growth_rate_fit = std::numeric_limits<double>::quiet_NaN();
  trajectory.predicted = mode ? discrete_eigenvalue(mode->lambda, settings.theta, settings.step_size)
                              : std::complex<double>(std::numeric_limits<double>::quiet_NaN(), 0);
  return settings.steps;
}

void conclude(Trajectory& trajectory, long asked)
{
  const MarchSummary& summary = trajectory;
  Outcome& outcome = trajectory.outcome;
  outcome.kind = OutcomeKind::completed;
  if (trajectory.theta < 0.5) outcome.reason = "theta below 1/2 adds (1/2 - theta) h omega^2 to every growth rate";
  if (summary.unconverged > 0)
  {
    outcome.kind = OutcomeKind::not_converged;
    outcome.reason =
        format("contact did not converge in %ld of %ld steps, first at t = %.4g s (largest residual %.4g): "
               "shorten the step",
               summary.unconverged, summary.steps, summary.first_unconverged, summary.contact_residual_max);
  }
  if (summary.fall_of_friction_max >= 1)
  {
    outcome.kind = OutcomeKind::not_converged;
    outcome.reason = format("friction falls so steeply that a step may have had several solutions, |mu'| r_n W_t = "
                            "%.4g: take at least %.3g times as many steps",
                            summary.fall_of_friction_max, 1.1 * summary.fall_of_friction_max);
  }
  if (summary.interrupted)
  {
    outcome.kind = OutcomeKind::interrupted;
    outcome.reason = format("ended %s after %ld of %ld steps", who_asked_to_end().c_str(), summary.steps, asked);
  }
  else if (summary.steps < asked)
  {
    outcome.kind = OutcomeKind::not_converged;
    outcome.reason = format("the energy is no longer finite at t = %.4g s", trajectory.end.time);
  }
  outcome.residual = summary.contact_residual_max;
  outcome.iterations = static_cast<int>(summary.contact_iterations_mean * static_cast<double>(summary.steps) + 0.5);
}

/// How far a march has come. `iterations`: of contact in all.
void describe_march(Checkpoint& checkpoint, const FileOrder& order, MarchSummary& summary, double& iterations,
                    State& state, History& history)
{
  describe_all(checkpoint, summary.steps, summary.unconverged, summary.first_unconverged, summary.contact_residual_max,
               summary.fall_of_friction_max, summary.energy_defect_max, iterations, state.time, state.reactions,
               state.slip, history.probes, history.joint_work);
  for_each_series([&](auto, auto, auto& series) { describe(checkpoint, series); }, history);
  order.describe(checkpoint, state.u);
  order.describe(checkpoint, state.v);
}

} // namespace

MarchSummary march(const ThetaStep& step, const SlidingEquilibrium& sliding, long steps, State& state,
                   const Recorder& recorder)
{
  const auto& [structure, interface, equilibrium] = sliding;
  const auto& [probes, history, monitor, records, checkpoint, ramps] = recorder;
  MarchSummary summary;
  Fluctuation fluctuation{equilibrium.u, product(structure.K, equilibrium.u), zeros_like(structure.load),
                          zeros_like(structure.load)};
  Owned<Vec> probe_values;
  if (probes)
  {
    probe_values = vector_of_rows(probes);
    history.probes.resize(static_cast<std::size_t>(row_count(probes)));
  }
  double iterations = 0;
  const MPI_Comm comm = comm_of(structure.load);
  const Description described = [&](Checkpoint& kept)
  {
    describe_march(kept, FileOrder(structure), summary, iterations, state, history);
    checkpoint(kept);
  };
  if (checkpoint && restore(name_of_checkpoint, comm, described) && rank_of(comm) == 0)
    std::printf("  goes on from the checkpoint after %ld of %ld steps\n", summary.steps, steps);
  const auto after = [&](const StepReport& report, const StepWork& work)
  {
    ++summary.steps;
    if (!report.contact_converged && summary.unconverged++ == 0) summary.first_unconverged = state.time;
    summary.contact_residual_max = std::max(summary.contact_residual_max, report.contact_residual);
    summary.fall_of_friction_max = std::max(summary.fall_of_friction_max, report.fall_of_friction);
    iterations += report.contact_iterations;
    const double defect = std::abs(report.energy_defect);
    const double scale = std::max({report.energy, std::abs(report.contact_work), std::abs(report.load_work)});
    if (defect > 0) summary.energy_defect_max = std::max(summary.energy_defect_max, defect / scale);
    update(fluctuation, state, work);
    record(report, step.h, state, interface.directions, probe_values, recorder);
    history.fluctuating_energy.push_back(energy(fluctuation, state, work));
    if (monitor) monitor(state, report, work);
    if (!std::isfinite(report.energy)) return false;
    summary.interrupted = end_is_asked(comm) && summary.steps < steps;
    if (!summary.interrupted && checkpoint && checkpoint_is_due()) keep(name_of_checkpoint, comm, described);
    return !summary.interrupted;
  };
  StepWatch watch{records, {}, after};
  if (ramps) watch.factors = [&](double time) { return step_factors(*ramps, step, time); };
  (void)take_steps(step, structure, interface, state, steps - summary.steps, watch);
  if (checkpoint && (summary.interrupted || checkpoint_is_worth_it(comm))) keep(name_of_checkpoint, comm, described);
  summary.contact_iterations_mean = iterations / static_cast<double>(std::max(summary.steps, 1L));
  return summary;
}

TransientSettings planned(TransientSettings settings, const ComplexMode& mode)
{
  if (counts_steps(settings)) return settings;
  settings.step_size = two_pi / (std::abs(mode.lambda.imag()) * settings.steps_per_period);
  settings.steps = std::lround(settings.periods * settings.steps_per_period);
  return settings;
}

namespace
{

/// But for slip positions, unless a file has them.
State start_of_motion(const SlidingEquilibrium& sliding, const UnstableModes& unstable,
                      const TransientSettings& settings)
{
  if (settings.start.kind == StartKind::file) return read_state(settings.start.file, sliding.structure);
  if (settings.start.kind == StartKind::rest)
    return {zeros_like(sliding.structure.load), zeros_like(sliding.structure.load), 0, {}};
  if (settings.start.kind == StartKind::equilibrium)
    return {copy_of(sliding.equilibrium.u), zeros_like(sliding.structure.load), 0, sliding.equilibrium.reactions};
  const ComplexMode& followed = unstable.modes.front();
  const Estimate& estimate = unstable.estimates.front();
  if (settings.start.kind == StartKind::mode)
    return mode_state(sliding.equilibrium, followed,
                      settings.amplitude > 0 ? settings.amplitude : 0.1 * limiting_event(estimate), estimate.phase);
  State start = mode_state(sliding.equilibrium, followed, estimate.start_amplitude, estimate.phase);
  for (std::size_t i = 1; i < unstable.modes.size(); ++i)
    if (const auto motion = estimated_motion(sliding.equilibrium, unstable.modes[i], unstable.estimates[i]))
      add_motion(*motion, 1, start);
  return start;
}

} // namespace

State transient_start(const SlidingEquilibrium& sliding, const UnstableModes& unstable,
                      const TransientSettings& settings)
{
  State start = start_of_motion(sliding, unstable, settings);
  if (settings.start.kind == StartKind::rest)
    start.slip.assign(sliding.interface.size(), 0.);
  else if (settings.start.kind != StartKind::file)
    start.slip = slip_positions(sliding.interface, sliding.equilibrium.u, sliding.equilibrium.reactions);
  return start;
}

Trajectory integrate(const SlidingEquilibrium& sliding, const ComplexMode* mode, const TransientSettings& settings,
                     const StepOptions& options, State start, Mat probes)
{
  const auto& [structure, interface, equilibrium] = sliding;
  Trajectory trajectory;
  const long steps = plan(trajectory, mode, settings);
  trajectory.outcome.reason = step_refusal(mode, trajectory.theta, trajectory.step_size, options);
  if (trajectory.outcome.reason.empty())
    trajectory.outcome.reason = friction_refusal(sliding, mode, trajectory.theta, trajectory.step_size, options,
                                                 largest_friction(settings.ramps));
  if (!trajectory.outcome.reason.empty()) trajectory.outcome.kind = OutcomeKind::refused;
  trajectory.end = std::move(start);
  if (trajectory.outcome.kind == OutcomeKind::refused) return trajectory;

  const ThetaStep step = make_theta_step(structure, interface, trajectory.step_size, settings.theta, options);
  const std::vector<double> drive = drive_directions(interface);
  ModeAmplitude amplitude;
  const bool follows = mode && !are_given(settings.ramps); // a mode belongs to constant load, speed and friction
  if (follows) amplitude = follow(structure, equilibrium, *mode);
  bool slides = follows; // so far
  Progress progress(comm_of(structure.load), "transient", static_cast<double>(steps));
  const Monitor watch = [&](const State& state, const StepReport& report, const StepWork& work)
  {
    slides = slides && slides_as_at_equilibrium(interface, equilibrium, drive, state);
    if (slides) observe(amplitude, state.time, work.Ku, work.Mv);
    progress.update(static_cast<double>(trajectory.history.time.size()),
                    format("energy %.4g J, open %d, stick %d", report.energy, report.open, report.stick));
  };
  const Description followed = [&](Checkpoint& checkpoint)
  { describe_all(checkpoint, slides, amplitude.time, amplitude.log_modulus); };
  const double wall = MPI_Wtime();
  static_cast<MarchSummary&>(trajectory) =
      march(step, sliding, steps, trajectory.end, {probes, trajectory.history, watch, {}, followed, &settings.ramps});
  trajectory.seconds_per_step = (MPI_Wtime() - wall) / static_cast<double>(std::max(trajectory.steps, 1L));
  trajectory.factor_seconds = step.factor_seconds;
  trajectory.condensed_seconds = step.condensed_seconds;
  if (mode)
  {
    trajectory.periods = static_cast<double>(trajectory.steps) * step.h * std::abs(mode->lambda.imag()) / two_pi;
    if (follows) trajectory.growth_rate_fit = growth_rate(amplitude, two_pi / std::abs(trajectory.predicted.imag()));
  }
  conclude(trajectory, steps);
  if (!settings.save_state.empty()) write_state(trajectory.end, structure, settings.save_state);
  return trajectory;
}

} // namespace squeal
