#include "squeal/settled/settled_motion.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/base/statistics.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Eigenvalues>

namespace squeal
{

namespace
{

constexpr double sampling_hz = 96e3;
constexpr double missed = 2e-3; // part of the largest velocity, in the norm of M
constexpr double spared = 1e-6; // part of the kinetic energy

/// V'x
Eigen::VectorXd on_shapes(const MotionShapes& motion, Vec x)
{
  return inner_products(motion.V, columns_of(std::array{x}));
}

/// r -= V a
void subtract(const MotionShapes& motion, const Eigen::VectorXd& a, Vec r)
{
  const Owned<Vec> sum = zeros_like(r);
  copy_column(combination(motion.V, a), 0, sum);
  check(VecAXPY(r, -1, sum));
}

/// Adds the part of v that V misses as a shape of its own, unless it has no mass.
void add_shape(MotionShapes& motion, Mat M, Vec v, Vec Mv)
{
  const Owned<Vec> rest = copy_of(v), image = copy_of(Mv);
  double square = 0;
  for (int pass = 0; pass < 2; ++pass) // the second takes out what rounding left
  {
    if (motion.V.columns() > 0) subtract(motion, on_shapes(motion, image), rest);
    check(MatMult(M, rest, image));
    square = dot(rest, image);
  }
  if (!(square > 0)) return;
  check(VecScale(rest, 1 / std::sqrt(square)));
  append(motion.V, rest);
  motion.coordinates.emplace_back(motion.squares.size(), 0.);
}

/// The number of steps between samples. It is a divisor of `steps`, the largest one by which samples are not slower
/// than 96 kHz, nearly five times what is heard.
int steps_between_samples(int steps, double step_size)
{
  int best = 1;
  for (int every = 2; every <= steps; ++every)
    if (steps % every == 0 && every * step_size * sampling_hz <= 1) best = every;
  return best;
}

/// Appends a sample. V gains a shape where it misses 2e-3 of the largest velocity seen, up to `most` shapes.
void add_sample(MotionShapes& motion, Mat M, Vec v, Vec Mv, PetscInt most)
{
  const double square = dot(v, Mv);
  motion.largest = std::max(motion.largest, square);
  Eigen::VectorXd q(0);
  if (motion.V.columns() > 0) q = on_shapes(motion, Mv);
  if (square - q.squaredNorm() > missed * missed * motion.largest && motion.V.columns() < most)
  {
    add_shape(motion, M, v, Mv);
    if (motion.V.columns() > 0) q = on_shapes(motion, Mv);
  }
  motion.squares.push_back(square);
  for (Eigen::Index i = 0; i < q.size(); ++i) motion.coordinates[static_cast<std::size_t>(i)].push_back(q(i));
}

/// Turns the shapes to the principal axes of the samples from `first` on, the strongest first. Those of least energy go
/// that hold 1e-6 of it together.
void keep_strongest(MotionShapes& motion, std::size_t first)
{
  const auto count = static_cast<Eigen::Index>(motion.squares.size()), shapes = motion.V.columns();
  if (shapes == 0 || count == 0) return;
  Eigen::MatrixXd q(shapes, count);
  for (Eigen::Index i = 0; i < shapes; ++i)
    q.row(i) = Eigen::Map<const Eigen::RowVectorXd>(motion.coordinates[static_cast<std::size_t>(i)].data(), count);
  const auto seen = q.rightCols(count - static_cast<Eigen::Index>(first));
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(seen * seen.transpose()); // ascending
  double total = 0;
  for (std::size_t i = first; i < motion.squares.size(); ++i) total += motion.squares[i];
  Eigen::Index dropped = 0;
  for (double sum = 0; dropped < shapes - 1; ++dropped)
    if ((sum += axes.eigenvalues()(dropped)) > spared * total) break;
  const Eigen::MatrixXd kept = axes.eigenvectors().rightCols(shapes - dropped).rowwise().reverse();
  combine(motion.V, kept);
  q = (kept.transpose() * q).eval();
  motion.coordinates.clear();
  for (Eigen::Index i = 0; i < q.rows(); ++i) motion.coordinates.emplace_back(q.row(i).begin(), q.row(i).end());
  const double held = q.rightCols(count - static_cast<Eigen::Index>(first)).squaredNorm();
  motion.left_out = total > 0 ? std::max(0., 1 - held / total) : 0;
}

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

MotionSeries series_of(const History& history)
{
  const auto counted = [](const std::vector<int>& pairs) { return std::vector<double>(pairs.begin(), pairs.end()); };
  return {{history.fluctuating_energy, history.energy, history.damping_power, history.contact_power, history.load_power,
           counted(history.open), counted(history.stick), counted(history.slip)},
          history.probes,
          history.normal_force};
}

const std::vector<double>& followed_series(const History& history, int probe)
{
  return probe < 0 ? history.normal_force : history.probes[static_cast<std::size_t>(probe)];
}

/// The windows of time that a motion is integrated by.
struct Windows
{
  const CycleProblem& problem;
  double length, theta; // [s]
  int steps;
};

/// A map of a window, in so many steps.
PeriodMap map_of(const Windows& windows, int steps)
{
  PeriodMap map{windows.problem.sliding, windows.problem.step, steps, windows.theta};
  map.reactions = windows.problem.sliding.equilibrium.reactions;
  set_period(map, windows.length);
  return map;
}

/// Integrates one window of the brake, recorded for its tangent. Appends its history to the motion's, and samples to
/// its shapes. Returns its mean fluctuating energy.
double integrate_window(PeriodMap& map, Mat probe_rows, Vec state, PetscInt shapes, SettledMotion& motion)
{
  History& all = motion.history;
  const double begun = all.time.empty() ? 0 : all.time.back();
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
  return mean(history.fluctuating_energy);
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
  const ExaminedMotion& seen = motion.examined;
  const auto kept = std::span(seen.channels[fluctuating_energy]).subspan(seen.discarded % seen.periods());
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

/// Sets what half as many steps a period change from where the motion ends. These are the mean fluctuating energy and,
/// as part of their bars, the frequencies of lines. Seen is the second half of as many windows as cost a quarter of the
/// motion's own.
void add_step_errors(const Windows& windows, Vec end, SettledMotion& motion)
{
  const CycleProblem& problem = windows.problem;
  PeriodMap map = map_of(windows, std::max(windows.steps / 2, 1));
  State now{copy_of(displacement(end)), copy_of(velocity(end)), 0, problem.sliding.equilibrium.reactions};
  History history;
  const std::size_t count = std::max<std::size_t>(motion.examined.windows / 2, 1), half = count / 2;
  for (std::size_t k = 0; k < count; ++k)
  {
    if (k == half) history = {};
    if (march(map.step, map.sliding, map.steps, now, {problem.probes, history, nullptr}).interrupted)
      throw Interrupted{};
  }
  const double step = windows.length / map.steps;
  const std::vector<double> energies = means_over(history.fluctuating_energy, motion.examined.period / step);
  motion.step_error = std::abs(batch_mean(energies).value - motion.fluctuating_energy.value);
  const double first = motion.examined.base.first;
  const Spectrum spectrum = spectrum_of(followed_series(history, motion.examined.followed), step);
  double part = HUGE_VAL; // to the nearest line
  for (const Line& line : spectrum.lines) part = std::min(part, std::abs(line.frequency_hz / first - 1));
  for (Line& line : motion.examined.spectrum.lines)
    if (std::isfinite(part)) line.frequency_error += part * line.frequency_hz;
}

/// The largest exponent with four times as many steps a period, from where the motion ends. Its windows, at least 32,
/// cost a quarter of what the motion did. The first quarter is left out, where the tangent turns to what grows most.
MeanValue exponent_by_finer_steps(const Windows& windows, const SettledMotion& motion, Vec end)
{
  constexpr int finer = 4;
  constexpr std::size_t fewest = 32;
  PeriodMap map = map_of(windows, finer * windows.steps);
  Flow flow = flow_of(map);
  SettledMotion fine;
  const Owned<Vec> state = copy_of(end);
  TangentBundle bundle = make_bundle(flow, state, 1);
  const std::size_t count = std::max(motion.examined.windows / (4 * finer), fewest);
  for (std::size_t k = 0; k < count; ++k)
  {
    fine.history = {};
    integrate_window(map, windows.problem.probes, state, 0, fine);
    follow_period(flow, bundle);
  }
  return exponents_of(bundle, count / 4, motion.examined.period / windows.length).front();
}

/// An exponent above zero comes from the grid of time where four times as many steps change it beyond both bars and a
/// tenth. Masses that contact hits within steps, or feet without mass, scatter a regular motion. Exponents of zero
/// beside a broad spectrum of energies always pass.
void hold_against_finer_steps(const Windows& windows, Vec end, SettledMotion& motion)
{
  if (motion.examined.verdict.kind != MotionKind::irregular) return;
  const MeanValue coarse = motion.examined.exponents.front(), fine = exponent_by_finer_steps(windows, motion, end);
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
                         format("steps that change neither the energy nor the largest exponent would decide "
                                "(--set cycle.steps_per_period=%d)",
                                4 * motion.steps_per_period);
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
  constexpr int many = 256; // steps, beside which a small model's entries do not tell the time
  if (options.periods == 0) options.periods = is_dear(of_period) || cycle.steps_per_period > many ? 512 : 2048;
  const Windows windows{problem, cycle.free.period, cycle.theta, cycle.steps_per_period};
  const double step = windows.length / windows.steps;
  SettledMotion motion;
  PeriodMap map = map_of(windows, windows.steps);
  Flow flow = flow_of(map);
  Owned<Vec> state = copy_of(cycle.free.state.get());
  motion.shapes.V = empty_multivector(problem.sliding.structure.M);
  motion.sampled_steps = steps_between_samples(windows.steps, step);
  const auto advance = [&](Vec now) { return integrate_window(map, problem.probes, now, options.shapes, motion); };
  const auto series = [&] { return series_of(motion.history); };
  motion.examined = examine_motion(flow, {windows.length, advance, series}, state, options);
  const ExaminedMotion& seen = motion.examined;
  motion.steps_per_period = static_cast<int>(std::lround(seen.period / step));
  name_means(motion, problem.sliding.interface.pairs);
  motion.end = {copy_of(displacement(state)), copy_of(velocity(state)), motion.history.time.back(), map.reactions};
  const double discarded = static_cast<double>(seen.discarded % seen.periods()) * seen.period;
  keep_strongest(motion.shapes, static_cast<std::size_t>(discarded / step / motion.sampled_steps));
  add_step_errors(windows, state, motion);
  motion.outcome = {OutcomeKind::settled, "", static_cast<int>(seen.periods()), 0};
  if (seen.discarded == seen.periods()) motion.outcome.kind = OutcomeKind::not_converged;
  note_undecided(motion);
  hold_against_finer_steps(windows, state, motion);
  return motion;
}

} // namespace squeal
