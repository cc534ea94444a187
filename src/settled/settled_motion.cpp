#include "squeal/settled/settled_motion.hpp"

#include "squeal/base/cost.hpp"
#include "squeal/base/mean.hpp"
#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace squeal
{

namespace
{

enum Channel : std::size_t
{
  fluctuating_energy,
  energy,
  damping_power,
  contact_power,
  load_power,
  open_pairs,
  stick_pairs,
  slip_pairs,
  probes, // and those after it
};

/// Appends a history to another.
void append(const History& from, History& to)
{
  const auto join = [](auto, auto, const auto& tail, auto& all) { all.insert(all.end(), tail.begin(), tail.end()); };
  for_each_series(join, from, to);
  to.probes.resize(from.probes.size());
  for (std::size_t i = 0; i < from.probes.size(); ++i) join("", "", from.probes[i], to.probes[i]);
}

double swing(const std::vector<double>& probe)
{
  const auto [least, greatest] = std::minmax_element(probe.begin(), probe.end());
  return *greatest - *least;
}

/// The probe that swings most in a period; -1 without probes.
int largest_probe(const History& history)
{
  const auto largest = std::max_element(history.probes.begin(), history.probes.end(),
                                        [](const auto& a, const auto& b) { return swing(a) < swing(b); });
  return history.probes.empty() ? -1 : static_cast<int>(largest - history.probes.begin());
}

const std::vector<double>& series_of(const History& history, int probe)
{
  return probe < 0 ? history.normal_force : history.probes[static_cast<std::size_t>(probe)];
}

PeriodSample sample_of(const History& history, int probe)
{
  PeriodSample sample{{mean(history.fluctuating_energy), mean(history.energy), mean(history.damping_power),
                       mean(history.contact_power), mean(history.load_power), mean(history.open), mean(history.stick),
                       mean(history.slip)},
                      series_of(history, probe),
                      probe < 0 ? std::vector<double>() : history.normal_force};
  for (const auto& one : history.probes) sample.means.push_back(swing(one));
  return sample;
}

/// Integrates one period of the brake, recorded for its tangent. Appends its history to the motion's, and samples to
/// its shapes.
PeriodSample integrate_period(PeriodMap& map, Mat probe_rows, Vec state, PetscInt shapes, SettledMotion& motion)
{
  History& all = motion.history;
  const bool first = all.time.empty();
  const double begun = first ? 0 : all.time.back();
  State now{copy_of(displacement(state)), copy_of(velocity(state)), begun, map.reactions};
  map.records.clear();
  map.records.resize(static_cast<std::size_t>(map.steps));
  map.recorded_start = {};
  History history;
  long step = 0;
  const Monitor keep_sample = [&](const State& at, const StepReport&, const StepWork& work)
  {
    if (shapes > 0 && ++step % motion.sampled_steps == 0)
      add_sample(motion.shapes, map.sliding.structure.M, at.v, work.Mv, shapes);
  };
  const MarchSummary summary =
      march(map.step, map.rest.about(map.sliding), map.steps, now, {probe_rows, history, keep_sample, map.records});
  if (summary.interrupted) throw Interrupted{};
  map.unconverged += summary.unconverged;
  map.reactions = now.reactions;
  note_joints(map, state);
  check(VecCopy(now.u, displacement(state)));
  check(VecCopy(now.v, velocity(state)));
  append(history, all);
  if (first) motion.spectrum_probe = largest_probe(history);
  return sample_of(history, motion.spectrum_probe);
}

/// Names the parts of what was examined.
void name_means(SettledMotion& motion, int pairs)
{
  const std::vector<MeanValue>& means = motion.examined.means;
  const auto fraction = [&](Channel channel) {
    return MeanValue{means[channel].value / pairs, means[channel].error / pairs};
  };
  motion.fluctuating_energy = means[fluctuating_energy];
  motion.energy = means[energy];
  motion.damping_power = means[damping_power];
  motion.contact_power = means[contact_power];
  motion.load_power = means[load_power];
  motion.open_fraction = fraction(open_pairs);
  motion.stick_fraction = fraction(stick_pairs);
  motion.slip_fraction = fraction(slip_pairs);
  motion.peak_to_peak.assign(means.begin() + probes, means.end());
  const auto kept = std::span(motion.examined.channels[fluctuating_energy])
                        .subspan(motion.examined.discarded % motion.examined.periods());
  const auto [least, greatest] = std::minmax_element(kept.begin(), kept.end());
  motion.least_energy = *least;
  motion.greatest_energy = *greatest;
}

/// Gives what an undecided kind is between as the reason.
void note_undecided(SettledMotion& motion)
{
  const MotionVerdict& verdict = motion.examined.verdict;
  if (verdict.kind == MotionKind::undecided)
    motion.outcome.reason = "undecided between " + verdict.between + ": " + verdict.would_decide;
}

/// The frequency of the line nearest to another one; that one where there is none.
double nearest_line(const Spectrum& spectrum, double frequency)
{
  const auto nearest = std::ranges::min_element(
      spectrum.lines, {}, [&](const Line& line) { return std::abs(line.frequency_hz - frequency); });
  return nearest == spectrum.lines.end() ? frequency : nearest->frequency_hz;
}

/// Sets what half as many steps a period change, from where the motion ends: the mean fluctuating energy, and as part
/// of their bars the frequencies of lines. Seen is the second half of as many periods as cost a quarter of the motion's
/// own.
void add_step_errors(const CycleProblem& problem, double theta, Vec end, SettledMotion& motion)
{
  PeriodMap map{problem.sliding, problem.step, std::max(motion.steps_per_period / 2, 1), theta};
  set_period(map, motion.period);
  State now{copy_of(displacement(end)), copy_of(velocity(end)), 0, problem.sliding.equilibrium.reactions};
  std::vector<double> energies, signal;
  const std::size_t periods = std::max<std::size_t>(motion.examined.periods() / 2, 1);
  while (energies.size() < periods)
  {
    History history;
    if (march(map.step, map.sliding, map.steps, now, {problem.probes, history, nullptr}).interrupted)
      throw Interrupted{};
    energies.push_back(mean(history.fluctuating_energy));
    const std::vector<double>& series = series_of(history, motion.spectrum_probe);
    if (energies.size() > periods / 2) signal.insert(signal.end(), series.begin(), series.end());
  }
  motion.step_error =
      std::abs(batch_mean(std::span(energies).subspan(periods / 2)).value - motion.fluctuating_energy.value);
  const double first = motion.examined.base.first;
  const double part = std::abs(nearest_line(spectrum_of(signal, motion.period / map.steps), first) / first - 1);
  for (Line& line : motion.examined.spectrum.lines)
    if (std::isfinite(part)) line.frequency_error += part * line.frequency_hz;
}

/// The largest exponent with four times as many steps a period, from where the motion ends, over as many periods as
/// cost a quarter of what the motion did, or 32. Its first quarter is left out, where the tangent turns to what grows
/// most.
MeanValue exponent_by_finer_steps(const CycleProblem& problem, const SettledMotion& motion, double theta, Vec end)
{
  constexpr int finer = 4;
  constexpr std::size_t fewest = 32;
  PeriodMap map{problem.sliding, problem.step, finer * motion.steps_per_period, theta};
  map.reactions = problem.sliding.equilibrium.reactions;
  Flow flow = flow_of(map);
  set_period(map, motion.period);
  SettledMotion fine;
  const Owned<Vec> state = copy_of(end);
  TangentBundle bundle = make_bundle(flow, state, 1);
  const std::size_t periods = std::max(motion.examined.periods() / (4 * finer), fewest);
  for (std::size_t k = 0; k < periods; ++k)
  {
    fine.history = {};
    integrate_period(map, problem.probes, state, 0, fine);
    follow_period(flow, bundle);
  }
  return exponents_of(bundle, periods / 4).front();
}

/// An exponent above zero that four times as many steps change by more than both bars, and by a tenth, is of the grid
/// of time: masses that contact hits within steps, or feet without mass, scatter a motion that is regular.
void hold_against_finer_steps(const CycleProblem& problem, double theta, Vec end, SettledMotion& motion)
{
  if (motion.examined.verdict.kind != MotionKind::irregular) return;
  const MeanValue coarse = motion.examined.exponents.front(),
                  fine = exponent_by_finer_steps(problem, motion, theta, end);
  if (!(std::abs(coarse.value - fine.value) <= coarse.error + fine.error + 0.1 * coarse.value)) // NaN does not confirm
    leave_to_finer_steps(
        motion, format("four times as many change the largest exponent to %.2g +- %.1g", fine.value, fine.error));
}

} // namespace

void leave_to_finer_steps(SettledMotion& motion, const std::string& seen)
{
  MotionVerdict& verdict = motion.examined.verdict;
  if (verdict.kind == MotionKind::undecided) return;
  verdict.between =
      format("%s and what finer steps than %d a period would show", word(verdict.kind), motion.steps_per_period);
  verdict.would_decide = (seen.empty() ? "" : seen + ": ") +
                         std::string("steps that change neither the energy nor the largest exponent would decide "
                                     "(cycle.steps_per_period)");
  verdict.kind = MotionKind::undecided;
  note_undecided(motion);
}

bool depends_on_steps(const SettledMotion& motion)
{
  return motion.step_error > 0.2 * motion.fluctuating_energy.value;
}

void take_as_answer(const SettledMotion& motion, Outcome& of_cycle)
{
  if (motion.outcome.kind != OutcomeKind::settled) return;
  of_cycle.reason = std::string(word(of_cycle.kind)) + ": " + of_cycle.reason;
  of_cycle.kind = OutcomeKind::settled;
}

SettledMotion find_settled_motion(const CycleProblem& problem, const LimitCycle& cycle, SettledOptions options)
{
  const double of_period = cycle.steps_per_period * work_of_step(problem.sliding.structure);
  if (options.periods == 0) options.periods = is_dear(of_period) ? 512 : 2048;
  SettledMotion motion;
  PeriodMap map{problem.sliding, problem.step, cycle.steps_per_period, cycle.theta};
  map.reactions = problem.sliding.equilibrium.reactions;
  Flow flow = flow_of(map);
  set_period(map, cycle.free.period);
  motion.steps_per_period = cycle.steps_per_period;
  motion.period = cycle.free.period;
  Owned<Vec> state = copy_of(cycle.free.state.get());
  motion.shapes = no_shapes(problem.sliding.structure.M);
  motion.sampled_steps = steps_between_samples(motion.steps_per_period, motion.period / motion.steps_per_period);
  const auto sampler = [&](Vec now) { return integrate_period(map, problem.probes, now, options.shapes, motion); };
  motion.examined = examine_motion(flow, sampler, state, motion.period, options);
  name_means(motion, problem.sliding.interface.pairs);
  motion.end = {copy_of(displacement(state)), copy_of(velocity(state)), motion.history.time.back(), map.reactions};
  const std::size_t windows = motion.examined.periods(), samples = motion.shapes.squares.size() / windows;
  keep_strongest(motion.shapes, motion.examined.discarded % windows * samples);
  add_step_errors(problem, cycle.theta, state, motion);
  const bool stationary = motion.examined.discarded < motion.examined.periods();
  motion.outcome = {OutcomeKind::settled, "", static_cast<int>(motion.examined.periods()), 0};
  if (!stationary) motion.outcome.kind = OutcomeKind::not_converged;
  note_undecided(motion);
  hold_against_finer_steps(problem, cycle.theta, state, motion);
  return motion;
}

} // namespace squeal
