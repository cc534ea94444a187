#include "reduced_cycle.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// What the options mean is said in the program's option table.
ReducedOptions read_reduced_options()
{
  ReducedOptions options;
  const char* prefix = "reduced_";
  check(PetscOptionsGetReal(nullptr, prefix, "-margin", &options.margin, nullptr));
  check(PetscOptionsGetReal(nullptr, prefix, "-threshold", &options.threshold, nullptr));
  check(PetscOptionsGetInt(nullptr, prefix, "-modes", &options.modes, nullptr));
  check(PetscOptionsGetInt(nullptr, prefix, "-free_periods", &options.free_periods, nullptr));
  check(PetscOptionsGetInt(nullptr, prefix, "-corrections", &options.corrections, nullptr));
  return options;
}

/// Twice the fluctuating energy.
double doubled_energy(const ReducedModel& model, const ReducedState& state)
{
  return state.v.dot(model.M_z * state.v) + state.q.dot(model.K_z * state.q);
}

/// One period of the reduced model; returns its end and adds up the mean fluctuating energy.
ReducedState one_period(ReducedMap& map, double period, const ReducedState& start, double& energy)
{
  energy = 0;
  return integrate(map, period, start,
                   [&](const ReducedState& now) { energy += doubled_energy(map.model, now) / (2. * map.steps); });
}

/// The reduced model of the active pairs of motions up to an amplitude of the followed mode.
void build(Fitting& fitting, double amplitude)
{
  const double clock = MPI_Wtime();
  const Full& full = fitting.full;
  Reduced& reduced = fitting.reduced;
  // where its cycle is the answer, friction is left free
  const bool sliding = fitting.result.fidelity.asked != CycleModel::reduced &&
                       slide_throughout(full.interface, full.unstable.front(), amplitude);
  reduced.model = reduce(full.structure, full.interface, full.equilibrium, full.modes, fitting.active,
                         {static_cast<int>(fitting.options.modes), fitting.options.threshold, sliding});
  reduced.norm = small_structure(reduced.model);
  Fidelity& fidelity = fitting.result.fidelity;
  fidelity.size = reduced.model.size();
  fidelity.modes = reduced.model.modes;
  fidelity.attachment_shapes = reduced.model.attachments;
  fidelity.active_pairs = static_cast<int>(fitting.active.size());
  fidelity.sliding_pairs = 0;
  for (int pair = 0; pair < full.interface.pairs; ++pair)
    fidelity.sliding_pairs += full.equilibrium.closed[static_cast<std::size_t>(pair)] &&
                              !std::binary_search(fitting.active.begin(), fitting.active.end(), pair);
  fidelity.reduction_seconds += MPI_Wtime() - clock;
}

/// A motion on its way to the cycle.
struct Free
{
  ReducedState state;
  double period = 0; // [s] after which it comes nearest to where it was
  double energy = 0; // [J]
};

/// Free periods until one comes back to within half a percent, or its energy exceeds `most`.
void settle(Fitting& fitting, Free& free, double most)
{
  const double clock = MPI_Wtime();
  const ReducedModel& model = fitting.reduced.model;
  Fidelity& fidelity = fitting.result.fidelity;
  ReducedMap map = map_of(fitting, fitting.steps);
  Progress progress(comm_of(fitting.full.structure.load), "settling",
                    static_cast<double>(fitting.options.free_periods));
  double correction = 0;
  // judged every tenth period: whatever the rounding, it stops at the same
  for (double missed = 1; (missed > 5e-3 || fidelity.reduced_periods % 10 != 0) &&
                          fidelity.reduced_periods < fitting.options.free_periods;)
  {
    const Passage passage = pass(map, free.period, free.state);
    const ReducedState& f = passage.rate;
    ReducedState way{passage.end.q - free.state.q, passage.end.v - free.state.v};
    const double speed = doubled_energy(model, f);
    correction = -(way.q.dot(model.K_z * f.q) + way.v.dot(model.M_z * f.v)) / speed;
    way.q += correction * f.q;
    way.v += correction * f.v;
    free.state = passage.end;
    free.energy = doubled_energy(model, free.state) / 2;
    missed = std::sqrt(doubled_energy(model, way) / (2 * free.energy));
    ++fidelity.reduced_periods;
    progress.update(
        static_cast<double>(fidelity.reduced_periods),
        format("T %.6g s, energy %.3g J, comes back to %.1e", free.period + correction, free.energy, missed));
    if (free.energy > most || !std::isfinite(missed)) break;
    if (std::abs(correction) < 2e-3 * free.period) continue; // a new period costs new matrices
    free.period += std::clamp(correction, -.2 * free.period, .2 * free.period);
    correction = 0;
  }
  free.period += correction;
  fidelity.reduced_seconds += MPI_Wtime() - clock;
}

/// The state of the next period in which the motion passes through zero along `reference`, upwards: cycles of a given
/// number of steps differ a little by where among them they begin, and shooting keeps that.
ReducedState in_phase(const Fitting& fitting, const Free& free, const ReducedState& reference)
{
  ReducedMap map = map_of(fitting, fitting.steps);
  const Eigen::VectorXd image = fitting.reduced.model.K_z * reference.q;
  ReducedState found = free.state, last = free.state;
  double before = image.dot(last.q);
  bool passed = false;
  integrate(map, free.period, free.state,
            [&](const ReducedState& now)
            {
              const double after = image.dot(now.q), part = before / (before - after);
              if (!passed && before < 0 && after >= 0)
                found = {last.q + part * (now.q - last.q), last.v + part * (now.v - last.v)};
              passed = passed || (before < 0 && after >= 0);
              before = after;
              last = now;
            });
  return found;
}

void see_inside(Fitting& fitting, const ReducedState& state, double period)
{
  const double clock = MPI_Wtime();
  ReducedMap map = map_of(fitting, fitting.steps);
  fitting.reduced.inside = inside_of(map, period, state, comm_of(fitting.full.structure.load));
  fitting.result.fidelity.reduced_seconds += MPI_Wtime() - clock;
}

/// What rank 0 found, bit by bit: ranks that decide apart would wait for each other.
void share(ReducedOrbit& orbit, MPI_Comm comm)
{
  std::vector<double> values = {orbit.converged ? 1. : 0., orbit.period, orbit.energy};
  values.insert(values.end(), orbit.state.q.begin(), orbit.state.q.end());
  values.insert(values.end(), orbit.state.v.begin(), orbit.state.v.end());
  MPI_Bcast(values.data(), static_cast<int>(values.size()), MPI_DOUBLE, 0, comm);
  orbit.converged = values[0] > 0;
  orbit.period = values[1];
  orbit.energy = values[2];
  const Eigen::Index n = orbit.state.q.size();
  orbit.state.q = Eigen::VectorXd::Map(&values[3], n);
  orbit.state.v = Eigen::VectorXd::Map(&values[3] + n, n);
}

} // namespace

Fitting::Fitting(const Full& problem) : full(problem), options(read_reduced_options()) {}

ReducedMap map_of(const Fitting& fitting, int steps)
{
  ReducedMap map{fitting.reduced.model, steps, fitting.full.settings.theta};
  const std::vector<double>& still = fitting.reduced.model.reactions;
  map.reactions = Eigen::VectorXd::Map(still.data(), static_cast<Eigen::Index>(still.size()));
  map.contact.tolerance = fitting.result.fidelity.contact_tolerance;
  return map;
}

Owned<Vec> motion_of(const Full& full, const ReducedModel& model, const ReducedState& state)
{
  const Owned<Vec> zero = zeros_like(full.structure.load);
  Owned<Vec> motion = state_of(zero, zero);
  add_motion(model, 1, state.q, displacement(motion));
  add_motion(model, 1, state.v, velocity(motion));
  return motion;
}

ReducedOrbit shoot_reduced(Fitting& fitting, const ReducedState& start, double period, int steps)
{
  const double clock = MPI_Wtime();
  const Reduced& reduced = fitting.reduced;
  ReducedMap map = map_of(fitting, steps);
  const Owned<Vec> rest = small_vector(Eigen::VectorXd::Zero(reduced.model.size()));
  const Owned<Vec> u = small_vector(start.q), v = small_vector(start.v);
  const Flow flow = flow_of(map, reduced.norm);
  const Preconditioner preconditioner = reduced_preconditioner(reduced.inside);
  Progress progress(PETSC_COMM_SELF, "reduced", 20);
  Shooting shooting = begin_shooting(flow, preconditioner, {rest, u, v, period, {}, {}}, fitting.tolerance, progress);
  const Owned<Vec> first = state_of(u, v);
  Orbit begin = evaluate(shooting, first, period);
  shooting.least_fluctuation = begin.fluctuation * std::sqrt(0.1);
  const Finish finish = finish_in_full_space(shooting, std::move(begin));
  ReducedOrbit orbit{finish.ending == Ending::converged,
                     {entries_of(displacement(finish.orbit.state)), entries_of(velocity(finish.orbit.state))},
                     finish.orbit.period,
                     0};
  (void)one_period(map, orbit.period, orbit.state, orbit.energy);
  fitting.result.fidelity.reduced_periods += shooting.periods + 1;
  fitting.result.fidelity.reduced_seconds += MPI_Wtime() - clock;
  share(orbit, comm_of(fitting.full.structure.load));
  return orbit;
}

std::string first_orbit(Fitting& fitting, ReducedOrbit& orbit)
{
  const Full& full = fitting.full;
  const ComplexMode& mode = full.unstable.front();
  PetscInt dofs = 0;
  check(VecGetSize(full.structure.load, &dofs));
  double amplitude = start_amplitude_factor() * start_amplitude(full.estimate);
  const State first = mode_state(full.equilibrium, mode, amplitude, full.estimate.phase);
  check(VecAXPY(first.u, -1, full.equilibrium.u));
  const Owned<Vec> estimated = state_of(first.u, first.v);
  Owned<Vec> motion = copy_of(estimated.get());
  Free free{{}, 1 / mode.frequency_hz(), 0};
  double unit = 0; // [J] energy at amplitude 1
  for (;;)
  {
    fitting.active = pairs_that_may_change(full.interface, full.equilibrium, mode, fitting.options.margin * amplitude);
    const std::size_t shapes = std::min(full.modes.size(), static_cast<std::size_t>(fitting.options.modes)) +
                               fitting.active.size() * static_cast<std::size_t>(full.interface.block());
    if (2 * shapes > static_cast<std::size_t>(dofs))
      return "a reduced model of " + std::to_string(shapes) + " shapes is not small next to " + std::to_string(dofs) +
             " degrees of freedom";
    build(fitting, fitting.options.margin * amplitude);
    const ReducedModel& model = fitting.reduced.model;
    free.state = coordinates(model, full.structure, displacement(motion), velocity(motion));
    if (unit == 0) unit = doubled_energy(model, free.state) / 2 / (amplitude * amplitude);
    settle(fitting, free, 1.5 * unit * amplitude * amplitude);
    const double reached = std::sqrt(free.energy / unit);
    if (reached > 1.2 * amplitude && fitting.result.fidelity.reduced_periods < fitting.options.free_periods)
    {
      motion = motion_of(full, model, free.state);
      amplitude = 1.5 * reached; // it was still growing
      continue;
    }
    free.state =
        in_phase(fitting, free, coordinates(model, full.structure, displacement(estimated), velocity(estimated)));
    ++fitting.result.fidelity.reduced_periods;
    see_inside(fitting, free.state, free.period);
    orbit = shoot_reduced(fitting, free.state, free.period, fitting.steps);
    return orbit.converged ? "" : "no cycle of the reduced model was found";
  }
}

} // namespace squeal
