#include "reduced_cycle.hpp"

#include "squeal/base/cost.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/cycle/floquet.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr double margin = 1.5;          // pairs that part at this many times the motion's amplitude keep their contact
constexpr double new_attachment = 1e-5; // an attachment shape is dropped when less than this part of it is new
constexpr int most_free_periods = 100;  // until the reduced model's motion is periodic
constexpr double runaway = 100;         // times the model's amplitude: contact that was not solved feeds the motion

/// Twice the fluctuating energy.
double doubled_energy(const ReducedModel& model, const ReducedState& state)
{
  return state.v.dot(model.M_z * state.v) + state.q.dot(model.K_z * state.q);
}

ReducedMap period_map_of(const ReducedSearch& search, int steps)
{
  ReducedMap map{search.model(), steps, search.problem.settings.theta, comm_of(search.problem.sliding.structure.load)};
  const std::vector<double>& still = search.model().reactions;
  map.reactions = Eigen::VectorXd::Map(still.data(), static_cast<Eigen::Index>(still.size()));
  map.contact.tolerance = search.fidelity.contact_tolerance;
  return map;
}

/// The coordinates of a motion (du, v).
ReducedState on_model(const ReducedSearch& search, Vec motion)
{
  return coordinates(search.model(), search.problem.sliding.structure, displacement(motion), velocity(motion));
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
  fidelity.size = search.model().size();
  fidelity.modes = search.model().modes;
  fidelity.attachment_shapes = search.model().attachments;
  fidelity.left_out_shapes = search.model().left_out;
  fidelity.lost_compliance = search.model().lost_compliance;
  fidelity.active_pairs = static_cast<int>(search.active.size());
  fidelity.sliding_pairs = 0;
  for (int pair = 0; pair < search.problem.sliding.interface.pairs; ++pair)
    fidelity.sliding_pairs += search.problem.sliding.equilibrium.closed[static_cast<std::size_t>(pair)] &&
                              !std::binary_search(search.active.begin(), search.active.end(), pair);
}

/// [Hz] up to which real modes join. Those from 3 to 4.5 times the frequency save a third of the periods of the full
/// model. They cost more than that where periods are dear but short.
double highest_joining(const ReducedSearch& search)
{
  constexpr int long_period = 128; // steps
  const int steps = search.problem.settings.steps_per_period;
  const bool dear = is_dear(steps * work_of_step(search.problem.sliding.structure));
  const double factor = dear && steps < long_period ? 3 : 4.5;
  return factor * search.problem.unstable.modes.front().frequency_hz();
}

/// Attachments at most. The start of a search on the full model needs no more than the vectors of its multipliers. A
/// cycle that is the answer needs all.
PetscInt attachments_of(const ReducedSearch& search)
{
  return search.fidelity.asked == CycleModel::reduced ? all_attachments : attachments_on_recorded_contact;
}

/// Makes the reduced model of the active pairs, for motions up to an amplitude of the followed mode.
void build_model(ReducedSearch& search, double amplitude)
{
  CycleProblem& problem = search.problem;
  // where its cycle is the answer, friction is left free
  const Interface& interface = problem.sliding.interface;
  const bool with_joints = std::ranges::any_of(search.active, [&](int pair)
                                               { return is_undriven(interface, static_cast<std::size_t>(pair)); });
  const bool sliding = search.fidelity.asked != CycleModel::reduced && !with_joints &&
                       pairs_that_may_turn(interface, problem.unstable.modes.front(), amplitude).empty();
  search.made.reset(); // before the next one takes memory
  problem.reduced.reset();
  search.made =
      std::make_shared<const ReducedModel>(reduce(problem.sliding, problem.modes, search.active,
                                                  {search.options.reduced_modes, new_attachment, attachments_of(search),
                                                   sliding, &search.real, problem.step.factor}));
  problem.reduced = search.made;
  describe_model(search);
}

/// Free periods from a motion until one comes back to within half a percent, or its fluctuation exceeds `most`.
Orbit run_free(ReducedSearch& search, ReducedMap& map, Vec motion, double period, double most)
{
  const Flow flow = flow_of(map, search.problem.sliding.structure);
  const Preconditioner none;
  Progress progress(map.comm, "reduced model, free", static_cast<double>(most_free_periods));
  ConvergenceLog log{progress};
  const OrbitProblem problem{flow, none, zeros_like(motion), period};
  Orbit free = integrate_free_periods(problem, log, motion, period, {most_free_periods, 5e-3, 0, 2e-3, most});
  search.fidelity.reduced_periods += log.convergence.periods;
  return free;
}

/// The state of the next period in which the motion passes through zero along `reference`, upwards. Cycles of a given
/// number of steps differ a little by where among them they begin, and shooting keeps that.
Owned<Vec> state_in_phase(const ReducedSearch& search, ReducedMap& map, const Orbit& motion, Vec reference)
{
  const Eigen::VectorXd image = map.model.K_z * on_model(search, reference).q;
  ReducedState found = on_model(search, motion.state), last = found;
  double before = image.dot(last.q);
  bool passed = false;
  integrate(map, motion.period, last,
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
  Owned<Vec> state = zeros_like(reference);
  add_motion(map.model, found, displacement(state), velocity(state));
  return state;
}

/// Shoots from near a cycle.
ReducedCycle shoot_at(ReducedSearch& search, ReducedMap& map, Vec from, double period)
{
  const Structure& structure = search.problem.sliding.structure;
  const Flow flow = flow_of(map, structure);
  if (search.correction.left.size() == 0) search.correction = monodromy_correction(map, period, on_model(search, from));
  const Preconditioner preconditioner = preconditioner_of(search.correction, {map.model, structure});
  ShootingOptions options = search.options.shooting;
  options.multipliers = 0;
  options.free_periods = most_free_periods;
  ShootingSettings settings{search.tolerance};
  settings.title = "reduced";
  const Owned<Vec> rest = zeros_like(displacement(from));
  ShootingResult found =
      shoot(flow, preconditioner, {rest, displacement(from), velocity(from), period}, settings, options);
  const bool at_rest = found.outcome.kind == OutcomeKind::collapsed_to_equilibrium;
  ReducedCycle cycle{found.outcome.kind == OutcomeKind::converged, std::move(found.orbit.state), found.orbit.period, 0,
                     at_rest ? std::nan("") : found.orbit.residual};
  cycle.energy = mean_energy(map, cycle.period, on_model(search, cycle.motion));
  search.fidelity.reduced_periods += found.convergence.periods + 1;
  return cycle;
}

/// Why a reduced model of the active pairs would not be small; empty if it would.
std::string size_refusal(const ReducedSearch& search)
{
  const CycleProblem& problem = search.problem;
  const PetscInt dofs = entry_count(problem.sliding.structure.load);
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

ReducedCycle cycle_at_twice_the_steps(ReducedSearch& search, const ReducedCycle& cycle)
{
  ReducedMap finer = period_map_of(search, 2 * search.problem.settings.steps_per_period);
  return shoot_at(search, finer, cycle.motion, cycle.period);
}

std::string find_first_reduced_cycle(ReducedSearch& search, ReducedCycle& cycle)
{
  CycleProblem& problem = search.problem;
  const ComplexMode& mode = problem.unstable.modes.front();
  if (!problem.start) return "there is no amplitude to start from";
  const double expected = problem.start->resumed ? 1 : 2.5; // times the start: beyond it a second model is made
  const State& start = problem.start->state;
  const double first = equivalent_amplitude(problem, start);
  const Owned<Vec> estimated = fluctuation_of(problem, start);
  Owned<Vec> motion = copy_of(estimated.get());
  search.real = real_modes_beyond(problem, highest_joining(search));
  double amplitude = expected * first, period = 1 / mode.frequency_hz(), unit = 0; // unit: fluctuation at amplitude 1
  for (;;)
  {
    const std::vector<int> change = pairs_that_may_change(problem.sliding.interface, problem.sliding.equilibrium, mode,
                                                          margin * amplitude),
                           slip = pairs_that_may_slip(problem.sliding, problem.linearised, mode, margin * amplitude);
    search.active.clear();
    std::ranges::set_union(change, slip, std::back_inserter(search.active));
    if (const std::string refusal = size_refusal(search); !refusal.empty()) return refusal;
    build_model(search, margin * amplitude);
    ReducedMap map = period_map_of(search, problem.settings.steps_per_period);
    if (unit == 0) unit = std::sqrt(doubled_energy(map.model, on_model(search, motion))) / first;
    Orbit free = run_free(search, map, motion, period, 1.2 * unit * amplitude);
    const double reached = free.fluctuation / unit;
    if (!(reached <= runaway * amplitude)) return "the motion of the reduced model grew beyond all bounds";
    if (reached > 1.2 * amplitude && search.fidelity.reduced_periods < most_free_periods)
    {
      motion = std::move(free.state);
      period = free.period;
      amplitude = 1.5 * reached; // it was still growing
      continue;
    }
    const Owned<Vec> in_phase = state_in_phase(search, map, free, estimated);
    cycle = shoot_at(search, map, in_phase, free.period);
    break;
  }
  if (cycle.converged) return {};
  if (std::isnan(cycle.residual)) return "no cycle of the reduced model was found: its shooting fell to rest";
  return format("no cycle of the reduced model was found: its shooting ended at a residual of %.1e, %.0e asked for",
                cycle.residual, search.tolerance);
}

} // namespace squeal
