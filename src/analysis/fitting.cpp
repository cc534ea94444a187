#include "fitting.hpp"

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

/// One period of the reduced model; returns its end and adds up the mean fluctuating energy.
ReducedState one_period(ReducedMap& map, double period, const ReducedState& start, double& energy)
{
  const ReducedModel& model = map.model;
  energy = 0;
  return integrate(map, period, start,
                   [&](const ReducedState& now)
                   { energy += (now.v.dot(model.M_z * now.v) + now.q.dot(model.K_z * now.q)) / (2. * map.steps); });
}

/// One recorded period of the full model from the candidate; returns its defect.
Owned<Vec> full_period(const Full& full, const Candidate& candidate, int steps, double tolerance, PeriodMap& map,
                       LimitCycle& cycle, Fidelity& fidelity)
{
  const double clock = MPI_Wtime();
  map.steps = steps;
  set_period(map, candidate.period);
  map.step.contact.tolerance = tolerance;
  cycle = {};
  cycle.period = candidate.period;
  cycle.steps_per_period = steps;
  cycle.theta = map.theta;
  cycle.start = {copy_of(displacement(candidate.state)), copy_of(velocity(candidate.state)), 0, {}};
  check(VecAXPY(cycle.start.u, 1, full.equilibrium.u));
  const State end = measure(map, full.equilibrium, full.probes, 32, cycle);
  Owned<Vec> defect = state_of(end.u, end.v);
  check(VecAXPY(displacement(defect), -1, cycle.start.u));
  check(VecAXPY(velocity(defect), -1, cycle.start.v));
  cycle.residual_full = energy_norm(full.norm(), defect) / energy_norm(full.norm(), candidate.state);
  ++fidelity.full_periods;
  fidelity.full_seconds += MPI_Wtime() - clock;
  return defect;
}

} // namespace

Fitting::Fitting(const Full& problem)
    : full(problem), options(read_reduced_options()), map{problem.structure, problem.interface,
                                                          problem.settings.steps_per_period, problem.settings.theta}
{
  map.reactions = problem.equilibrium.reactions;
}

void build(Fitting& fitting)
{
  const double clock = MPI_Wtime();
  const Full& full = fitting.full;
  Reduced& reduced = fitting.reduced;
  reduced.model = reduce(
      full.structure, full.interface, full.equilibrium, full.modes, fitting.active,
      {static_cast<int>(fitting.options.modes), fitting.options.threshold, fitting.result.fidelity.asked == "full"});
  reduced.norm = small_structure(reduced.model);
  reduced.modes = closed_modes(reduced.model, 3 * full.unstable.front().frequency_hz());
  reduced.sliding = sliding_modes(reduced.model, reduced.modes);
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

ReducedMap map_of(const Fitting& fitting, int steps)
{
  ReducedMap map{fitting.reduced.model, steps, fitting.full.settings.theta};
  const std::vector<double>& still = fitting.reduced.model.reactions;
  map.reactions = Eigen::VectorXd::Map(still.data(), static_cast<Eigen::Index>(still.size()));
  map.contact.tolerance = fitting.result.fidelity.contact_tolerance;
  return map;
}

ReducedOrbit shoot_reduced(Fitting& fitting, const ReducedState& start, const ReducedState& shift, double period,
                           int steps, int free)
{
  const double clock = MPI_Wtime();
  const Reduced& reduced = fitting.reduced;
  ReducedMap map = map_of(fitting, steps);
  map.shift = shift;
  const Owned<Vec> rest = small_vector(Eigen::VectorXd::Zero(reduced.model.size()));
  const Owned<Vec> u = small_vector(start.q), v = small_vector(start.v);
  ReducedOrbit orbit;
  orbit.cycle = shoot(flow_of(map, reduced.norm), {rest, u, v, period, {}, {}},
                      sliding_preconditioner(reduced.sliding, reduced.modes.shapes, reduced.norm.M, steps, map.theta),
                      fitting.tolerance, free);
  orbit.state = {entries_of(orbit.cycle.start.u), entries_of(orbit.cycle.start.v)};
  orbit.period = orbit.cycle.period;
  (void)one_period(map, orbit.period, orbit.state, orbit.energy);
  fitting.result.fidelity.reduced_periods += orbit.cycle.periods_integrated + 1;
  fitting.result.fidelity.reduced_seconds += MPI_Wtime() - clock;
  return orbit;
}

Candidate candidate_of(const Full& full, const Reduced& reduced, const ReducedOrbit& orbit)
{
  const Owned<Vec> zero = zeros_like(full.structure.load);
  Candidate candidate{state_of(zero, zero), orbit.period};
  add_motion(reduced.model, 1, orbit.state.q, displacement(candidate.state));
  add_motion(reduced.model, 1, orbit.state.v, velocity(candidate.state));
  return candidate;
}

std::vector<int> surprises(const Full& full, const std::vector<int>& active, const LimitCycle& cycle)
{
  std::vector<int> pairs;
  for (int pair = 0; pair < full.interface.pairs; ++pair)
  {
    const auto i = static_cast<std::size_t>(pair);
    if (std::binary_search(active.begin(), active.end(), pair)) continue;
    const ContactStatus expected = full.equilibrium.closed[i] ? ContactStatus::slip : ContactStatus::open;
    if (std::any_of(cycle.statuses.begin(), cycle.statuses.end(),
                    [&](const std::vector<ContactStatus>& status) { return status[i] != expected; }))
      pairs.push_back(pair);
  }
  return pairs;
}

Correction correct(Fitting& fitting)
{
  const Full& full = fitting.full;
  const ReducedModel& model = fitting.reduced.model;
  const Candidate& from = fitting.candidate;
  Fidelity& fidelity = fitting.result.fidelity;
  const Owned<Vec> defect =
      full_period(full, from, fitting.steps, fidelity.contact_tolerance, fitting.map, fitting.result.cycle, fidelity);
  const ReducedState seen = coordinates(model, full.structure, displacement(defect), velocity(defect));
  const ReducedState here = coordinates(model, full.structure, displacement(from.state), velocity(from.state));
  ReducedMap own = map_of(fitting, fitting.steps);
  double energy = 0;
  const ReducedState end = one_period(own, from.period, here, energy);
  Correction result;
  result.shift = {seen.q - (end.q - here.q), seen.v - (end.v - here.v)};
  result.orbit = shoot_reduced(fitting, here, result.shift, from.period, fitting.steps, 0);
  // in the shapes by the reduced model, outside them by its own defect
  result.to = {copy_of(from.state.get()), result.orbit.period};
  check(VecAXPY(result.to.state, 1, defect));
  add_motion(model, 1, result.orbit.state.q - here.q - seen.q, displacement(result.to.state));
  add_motion(model, 1, result.orbit.state.v - here.v - seen.v, velocity(result.to.state));

  // What is still to come is taken as twice the last move, or half of the one before: their signs alternate.
  const double frequency = std::abs(result.orbit.period / from.period - 1);
  const double motion = std::abs(result.orbit.energy / energy - 1);
  fidelity.frequency_error = std::max(2 * frequency, fitting.frequency_move / 2);
  fidelity.energy_error = std::max(2 * motion, fitting.energy_move / 2);
  fitting.frequency_move = frequency;
  fitting.energy_move = motion;
  return result;
}

} // namespace squeal
