#include "reduced_cycle.hpp"

#include "squeal/base/cost.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/cycle/floquet.hpp"
#include "squeal/cycle/preconditioner.hpp"
#include "step_refinement.hpp"

#include "squeal/shooting/secants.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr double margin = 1.5;          // pairs that part at this many times the motion's amplitude keep their contact
constexpr double new_attachment = 1e-5; // an attachment shape is dropped when less than this part of it is new
constexpr int most_free_periods = 100;  // until the reduced model's motion is periodic
constexpr double runaway = 1e3;         // times the energy a period before: contact that was not solved feeds it

/// Twice the fluctuating energy.
double doubled_energy(const ReducedModel& model, const ReducedState& state)
{
  return state.v.dot(model.M_z * state.v) + state.q.dot(model.K_z * state.q);
}

ReducedMap period_map_of(const ReducedSearch& search, int steps)
{
  ReducedMap map{search.model, steps, search.problem.settings.theta, comm_of(search.problem.sliding.structure.load)};
  const std::vector<double>& still = search.model.reactions;
  map.reactions = Eigen::VectorXd::Map(still.data(), static_cast<Eigen::Index>(still.size()));
  map.contact.tolerance = search.fidelity.contact_tolerance;
  return map;
}

/// The mean fluctuating energy over one period.
double mean_energy(ReducedMap& map, double period, const ReducedState& start)
{
  double energy = 0;
  integrate(map, period, start,
            [&](const ReducedState& now) { energy += doubled_energy(map.model, now) / (2. * map.steps); });
  MPI_Bcast(&energy, 1, MPI_DOUBLE, 0, map.comm);
  return energy;
}

/// Notes what the reduced model consists of.
void describe_model(ReducedSearch& search)
{
  Fidelity& fidelity = search.fidelity;
  fidelity.size = search.model.size();
  fidelity.modes = search.model.modes;
  fidelity.attachment_shapes = search.model.attachments;
  fidelity.left_out_shapes = search.model.left_out;
  fidelity.lost_compliance = search.model.lost_compliance;
  fidelity.active_pairs = static_cast<int>(search.active.size());
  fidelity.sliding_pairs = 0;
  for (int pair = 0; pair < search.problem.sliding.interface.pairs; ++pair)
    fidelity.sliding_pairs += search.problem.sliding.equilibrium.closed[static_cast<std::size_t>(pair)] &&
                              !std::binary_search(search.active.begin(), search.active.end(), pair);
}

/// [Hz] up to which real modes join. On the brake of 33 224 degrees of freedom those from 3 to 4.5 times the frequency
/// save 6 periods of 17 at 64 steps and cost what 18 do. At 128, where a period costs twice as much, they save 10 of 26
/// to 1e-8, and the whole run takes 8 % longer.
double highest_joining(const ReducedSearch& search)
{
  constexpr int long_period = 128; // steps
  const bool dear = is_dear(search.steps * work_of_step(search.problem.sliding.structure));
  const double factor = dear && search.steps < long_period ? 3 : 4.5;
  return factor * search.problem.unstable.modes.front().frequency_hz();
}

/// Attachments at most. The start of a search on the full model needs no more than the vectors of its multipliers do; a
/// cycle that is the answer needs all.
PetscInt attachments_of(const ReducedSearch& search)
{
  return search.fidelity.asked == CycleModel::reduced ? all_attachments : attachments_on_recorded_contact;
}

/// Makes the reduced model of the active pairs, for motions up to an amplitude of the followed mode.
void build_model(ReducedSearch& search, double amplitude)
{
  const double clock = MPI_Wtime();
  const CycleProblem& problem = search.problem;
  // where its cycle is the answer, friction is left free
  const Interface& interface = problem.sliding.interface;
  const bool with_joints = std::ranges::any_of(search.active, [&](int pair)
                                               { return is_undriven(interface, static_cast<std::size_t>(pair)); });
  const bool sliding = search.fidelity.asked != CycleModel::reduced && !with_joints &&
                       pairs_that_may_turn(interface, problem.unstable.modes.front(), amplitude).empty();
  {
    const ReducedModel released = std::move(search.model); // before the next one takes memory
  }
  search.model = reduce(problem.sliding, problem.modes, search.active,
                        {search.options.reduced_modes, new_attachment, attachments_of(search), sliding, &search.real,
                         problem.step.factor});
  search.energy = energy_matrices(search.model);
  describe_model(search);
  search.fidelity.reduction_seconds += MPI_Wtime() - clock;
}

/// A motion of the reduced model that is not yet periodic.
struct FreeMotion
{
  ReducedState state;
  double period = 0; // [s] after which it comes nearest to where it was
  double energy = 0; // [J]
};

/// One period of the free motion. Returns how far it misses its start, relative to its fluctuation, and sets the
/// `correction` [s] of its period that would bring it nearest.
double run_one_period(ReducedMap& map, FreeMotion& motion, double& correction)
{
  const ReducedModel& model = map.model;
  const PeriodEnd period_end = end_of_period(map, motion.period, motion.state);
  const ReducedState& f = period_end.rate;
  ReducedState defect{period_end.end.q - motion.state.q, period_end.end.v - motion.state.v};
  correction = -(defect.q.dot(model.K_z * f.q) + defect.v.dot(model.M_z * f.v)) / doubled_energy(model, f);
  defect.q += correction * f.q;
  defect.v += correction * f.v;
  motion.state = period_end.end;
  motion.energy = doubled_energy(model, motion.state) / 2;
  double decides[] = {std::sqrt(doubled_energy(model, defect) / (2 * motion.energy)), motion.energy, correction};
  MPI_Bcast(decides, 3, MPI_DOUBLE, 0, map.comm); // ranks that decide apart would wait for each other
  motion.energy = decides[1];
  correction = decides[2];
  return decides[0];
}

/// Free periods until one comes back to within half a percent, or its energy exceeds `most`.
void run_until_periodic(ReducedSearch& search, FreeMotion& motion, double most)
{
  const double clock = MPI_Wtime();
  Fidelity& fidelity = search.fidelity;
  ReducedMap map = period_map_of(search, search.steps);
  Progress progress(map.comm, "reduced model, free", static_cast<double>(most_free_periods));
  double missed = 1, correction = 0;
  const auto limited = [&] { return std::clamp(correction, -0.2 * motion.period, 0.2 * motion.period); };
  // compared every tenth period: whatever the rounding, it stops at the same
  const auto periodic = [&] { return missed <= 5e-3 && fidelity.reduced_periods % 10 == 0; };
  while (!periodic() && fidelity.reduced_periods < most_free_periods)
  {
    end_if_asked(map.comm);
    const double before = doubled_energy(search.model, motion.state) / 2;
    missed = run_one_period(map, motion, correction);
    if (motion.energy > runaway * before) motion.energy = HUGE_VAL;
    ++fidelity.reduced_periods;
    progress.update(
        static_cast<double>(fidelity.reduced_periods),
        format("T %.6g s, energy %.3g J, comes back to %.1e", motion.period + correction, motion.energy, missed));
    if (motion.energy > most || !std::isfinite(missed)) break;
    if (std::abs(correction) < 2e-3 * motion.period) continue; // a new period costs new matrices
    motion.period += limited();
    correction = 0;
  }
  motion.period += limited();
  fidelity.reduced_seconds += MPI_Wtime() - clock;
}

/// The state of the next period in which the motion passes through zero along `reference`, upwards. Cycles of a given
/// number of steps differ a little by where among them they begin, and shooting keeps that.
ReducedState state_in_phase(const ReducedSearch& search, const FreeMotion& motion, const ReducedState& reference)
{
  ReducedMap map = period_map_of(search, search.steps);
  const Eigen::VectorXd image = search.model.K_z * reference.q;
  ReducedState found = motion.state, last = motion.state;
  double before = image.dot(last.q);
  bool passed = false;
  integrate(map, motion.period, motion.state,
            [&](const ReducedState& now)
            {
              const double after = image.dot(now.q), part = before / (before - after);
              if (!passed && before < 0 && after >= 0)
                found = {last.q + part * (now.q - last.q), last.v + part * (now.v - last.v)};
              passed = passed || (before < 0 && after >= 0);
              before = after;
              last = now;
            });
  share_state(found, map.comm);
  return found;
}

/// Makes the preconditioner that of the motion.
void update_correction(ReducedSearch& search, const FreeMotion& motion)
{
  const double clock = MPI_Wtime();
  ReducedMap map = period_map_of(search, search.steps);
  search.correction = monodromy_correction(map, motion.period, motion.state);
  search.fidelity.reduced_seconds += MPI_Wtime() - clock;
}

/// Shoots from `start`. Every rank does so by itself, on periods that are the same on all.
ReducedCycle shoot(ReducedSearch& search, const ReducedCycle& start, ReducedMap& map)
{
  const Flow flow = flow_of(map, search.energy);
  const Preconditioner preconditioner = preconditioner_of(search.correction, own_coordinates());
  Progress progress(map.comm, "reduced", 20);
  ConvergenceLog log{progress};
  const Owned<Vec> first = vector_of(start.state);
  OrbitProblem problem{flow, preconditioner, zeros_like(first), start.period, search.tolerance, 0};
  const ShootingOptions& shooting = search.options.shooting;
  Orbit begin = evaluate(problem, log, first, start.period);
  problem.least_fluctuation = begin.fluctuation * std::sqrt(0.1);
  StageResult found = shoot_in_full_space(problem, shooting, log, std::move(begin));
  if (found.ending == StageEnding::converged)
    found = prefer_fewer_rounds(problem, shooting, log, 2, std::move(found)); // which spares the full model that test
  const bool at_rest = found.ending == StageEnding::collapsed;
  ReducedCycle cycle{found.ending == StageEnding::converged, reduced_state(found.orbit.state), found.orbit.period, 0,
                     at_rest ? std::nan("") : found.orbit.residual};
  share_state(cycle.state, map.comm); // ranks of other processors may round otherwise
  MPI_Bcast(&cycle.period, 1, MPI_DOUBLE, 0, map.comm);
  search.fidelity.reduced_periods += log.convergence.periods;
  return cycle;
}

/// Why a reduced model of the active pairs would not be small; empty if it would.
std::string size_refusal(const ReducedSearch& search)
{
  const CycleProblem& problem = search.problem;
  PetscInt dofs = 0;
  check(VecGetSize(problem.sliding.structure.load, &dofs));
  const std::size_t rows = PairRows<std::size_t>(problem.sliding.interface.directions).rows_of(search.active.size());
  const std::size_t shapes = std::min(problem.modes.size(), static_cast<std::size_t>(search.options.reduced_modes)) +
                             std::min(rows, static_cast<std::size_t>(attachments_of(search)));
  if (2 * shapes <= static_cast<std::size_t>(dofs)) return {};
  return "a reduced model of " + std::to_string(shapes) + " shapes is not small next to " + std::to_string(dofs) +
         " degrees of freedom";
}

/// The fluctuation (du, v) of a state.
Owned<Vec> fluctuation_of(const CycleProblem& problem, const State& state)
{
  const Owned<Vec> moved = copy_of(state.u.get());
  check(VecAXPY(moved, -1, problem.sliding.equilibrium.u));
  return state_of(moved, state.v);
}

} // namespace

Owned<Vec> full_motion(const ReducedSearch& search, const ReducedState& state)
{
  const Owned<Vec> zero = zeros_like(search.problem.sliding.structure.load);
  Owned<Vec> motion = state_of(zero, zero);
  add_motion(search.model, 1, state.q, displacement(motion));
  add_motion(search.model, 1, state.v, velocity(motion));
  return motion;
}

ReducedCycle find_reduced_cycle(ReducedSearch& search, const ReducedCycle& start, int steps)
{
  const double clock = MPI_Wtime();
  ReducedMap map = period_map_of(search, steps);
  ReducedCycle cycle = shoot(search, start, map);
  cycle.energy = mean_energy(map, cycle.period, cycle.state);
  ++search.fidelity.reduced_periods;
  search.fidelity.reduced_seconds += MPI_Wtime() - clock;
  return cycle;
}

void estimate_reduced_step_errors(ReducedSearch& search, const ReducedCycle& cycle)
{
  Fidelity& fidelity = search.fidelity;
  const ReducedCycle twice = find_reduced_cycle(search, cycle, 2 * search.steps);
  const RelativeChange errors =
      step_errors_of({{2 * search.steps, twice.period, twice.energy}, {search.steps, cycle.period, cycle.energy}});
  fidelity.step_frequency_error = twice.converged ? errors.frequency : std::nan("");
  fidelity.step_energy_error = twice.converged ? errors.energy : std::nan("");
}

std::string find_first_reduced_cycle(ReducedSearch& search, ReducedCycle& cycle)
{
  const CycleProblem& problem = search.problem;
  const ComplexMode& mode = problem.unstable.modes.front();
  const std::optional<State> start = cycle_start(problem);
  if (!start) return "there is no amplitude to start from";
  constexpr double expected = 2.5; // times the start: to grow beyond it costs a second model and its periods
  const double first = equivalent_amplitude(problem, *start);
  double amplitude = expected * first;
  const Owned<Vec> estimated = fluctuation_of(problem, *start);
  Owned<Vec> motion = copy_of(estimated.get());
  search.real = real_modes_beyond(problem, highest_joining(search));
  FreeMotion free{{}, 1 / mode.frequency_hz(), 0};
  double unit = 0; // [J] energy at amplitude 1
  const auto on_model = [&](Vec x)
  { return coordinates(search.model, problem.sliding.structure, displacement(x), velocity(x)); };
  for (;;)
  {
    const std::vector<int> change = pairs_that_may_change(problem.sliding.interface, problem.sliding.equilibrium, mode,
                                                          margin * amplitude),
                           slip = pairs_that_may_slip(problem.sliding, problem.linearised, mode, margin * amplitude);
    search.active.clear();
    std::ranges::set_union(change, slip, std::back_inserter(search.active));
    if (const std::string refusal = size_refusal(search); !refusal.empty()) return refusal;
    build_model(search, margin * amplitude);
    free.state = on_model(motion);
    if (unit == 0) unit = doubled_energy(search.model, free.state) / 2 / (first * first);
    run_until_periodic(search, free, 1.5 * unit * amplitude * amplitude);
    if (!std::isfinite(free.energy)) return "the motion of the reduced model grew beyond all bounds";
    const double reached = std::sqrt(free.energy / unit);
    if (reached <= 1.2 * amplitude || search.fidelity.reduced_periods >= most_free_periods) break;
    motion = full_motion(search, free.state);
    amplitude = 1.5 * reached; // it was still growing
  }
  free.state = state_in_phase(search, free, on_model(estimated));
  ++search.fidelity.reduced_periods;
  update_correction(search, free);
  cycle = find_reduced_cycle(search, {false, free.state, free.period, 0}, search.steps);
  if (cycle.converged) return {};
  if (std::isnan(cycle.residual)) return "no cycle of the reduced model was found: its shooting fell to rest";
  return format("no cycle of the reduced model was found: its shooting ended at a residual of %.1e, %.0e asked for",
                cycle.residual, search.tolerance);
}

} // namespace squeal
