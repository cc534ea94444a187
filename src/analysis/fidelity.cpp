#include "squeal/analysis/fidelity.hpp"

#include "squeal/analysis/reduced.hpp"
#include "squeal/analysis/shooting.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>

namespace squeal
{

namespace
{

struct Options
{
  PetscReal margin = 1, threshold = 1e-5;
  PetscInt modes = 100000, free_periods = 100, corrections = 40;
};

/// What the options mean is said in the program's option table.
Options read_options()
{
  Options options;
  const char* prefix = "reduced_";
  check(PetscOptionsGetReal(nullptr, prefix, "-margin", &options.margin, nullptr));
  check(PetscOptionsGetReal(nullptr, prefix, "-threshold", &options.threshold, nullptr));
  check(PetscOptionsGetInt(nullptr, prefix, "-modes", &options.modes, nullptr));
  check(PetscOptionsGetInt(nullptr, prefix, "-free_periods", &options.free_periods, nullptr));
  check(PetscOptionsGetInt(nullptr, prefix, "-corrections", &options.corrections, nullptr));
  return options;
}

/// The problem as given.
struct Full
{
  const Structure& structure;
  const Interface& interface;
  const Equilibrium& equilibrium;
  const std::vector<ComplexMode>& modes;
  const CycleSettings& settings;
  Mat probes = nullptr;
  double amplitude = 0, phase = 0; // [m], [rad] of the start on the followed mode

  Flow norm() const { return {nullptr, structure.M, structure.K, {}}; }
};

/// The reduced model, ready to be shot at.
struct Reduced
{
  ReducedModel model;
  Structure norm;
  RealModes modes; // of the preconditioner
  std::vector<DenseEigenpair> sliding;
};

struct ReducedOrbit
{
  LimitCycle cycle;
  ReducedState state;
  double period = 0, energy = 0; // [s], [J] mean, fluctuating
};

/// A state of the full model, about the equilibrium, and its period.
struct Candidate
{
  Owned<Vec> state; // nest (u - u0, v)
  double period = 0;
};

/// One period of the reduced model; returns its end and adds up the mean fluctuating energy.
ReducedState one_period(ReducedMap& map, double period, const ReducedState& start, double& energy)
{
  const ReducedModel& model = map.model;
  energy = 0;
  return integrate(map, period, start,
                   [&](const ReducedState& now)
                   { energy += (now.v.dot(model.M_z * now.v) + now.q.dot(model.K_z * now.q)) / (2. * map.steps); });
}

/// The fitting so far.
struct Fitting
{
  explicit Fitting(const Full& problem)
      : full(problem), options(read_options()), map{problem.structure, problem.interface,
                                                    problem.settings.steps_per_period, problem.settings.theta}
  {
    map.reactions = problem.equilibrium.reactions;
  }

  const Full& full;
  Options options;
  PeriodMap map;
  FittedCycle result;
  std::vector<int> active; // pairs
  Reduced reduced;
  int steps = 0;
  Candidate candidate;
  double frequency_move = 0, energy_move = 0; // of the last correction, relative
};

void build(Fitting& fitting)
{
  const double clock = MPI_Wtime();
  const Full& full = fitting.full;
  Reduced& reduced = fitting.reduced;
  reduced.model = reduce(full.structure, full.interface, full.equilibrium, full.modes, fitting.active,
                         {static_cast<int>(fitting.options.modes), fitting.options.threshold});
  reduced.norm = small_structure(reduced.model);
  reduced.modes = closed_modes(reduced.model, 3 * full.modes.front().frequency_hz());
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

/// The cycle of Phi_r + shift near `start`, after some free periods.
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
                      make_preconditioner(reduced.sliding, reduced.modes.shapes, reduced.norm.M, steps, map.theta),
                      1e-3 * fitting.result.fidelity.accuracy, free);
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

/// One recorded period of the full model from the candidate; returns its defect.
Owned<Vec> full_period(const Full& full, const Candidate& candidate, int steps, double tolerance, PeriodMap& map,
                       LimitCycle& cycle, Fidelity& fidelity)
{
  const double clock = MPI_Wtime(), h = candidate.period / steps;
  map.steps = steps;
  if (map.step.h != h) map.step = make_theta_step(full.structure, full.interface, h, map.theta);
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

/// Pairs taken as sliding, or as open, that were seen to do something else.
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

/// Candidates and where one correction took them; the next one makes the remaining move least (Anderson).
struct Acceleration
{
  const Full& full;
  std::deque<std::pair<Candidate, Candidate>> tried{}; // newest first: candidate, corrected
  std::size_t memory = 6;

  Candidate next(Candidate from, Candidate to)
  {
    tried.emplace_front(std::move(from), std::move(to));
    if (tried.size() > memory) tried.pop_back();
    const Flow norm = full.norm();
    const auto move = [](const std::pair<Candidate, Candidate>& pair)
    {
      Owned<Vec> result = copy_of(pair.second.state.get());
      check(VecAXPY(result, -1, pair.first.state));
      return result;
    };
    // least squares on the differences of moves; T counts through the states
    const Owned<Vec> latest = move(tried.front());
    std::vector<Owned<Vec>> differences;
    for (std::size_t i = 1; i < tried.size(); ++i)
    {
      differences.push_back(copy_of(latest.get()));
      check(VecAXPY(differences.back(), -1, move(tried[i])));
    }
    const auto n = static_cast<Eigen::Index>(differences.size());
    Candidate result{copy_of(tried.front().second.state.get()), tried.front().second.period};
    if (n == 0) return result;
    Eigen::MatrixXd A(n, n);
    Eigen::VectorXd b(n);
    for (Eigen::Index i = 0; i < n; ++i)
    {
      b(i) = energy_product(norm, differences[static_cast<std::size_t>(i)], latest);
      for (Eigen::Index j = 0; j <= i; ++j)
        A(i, j) = A(j, i) =
            energy_product(norm, differences[static_cast<std::size_t>(i)], differences[static_cast<std::size_t>(j)]);
    }
    A.diagonal() *= 1 + 1e-8;
    const Eigen::VectorXd weight = A.ldlt().solve(b);
    for (Eigen::Index i = 0; i < n; ++i)
    {
      const Candidate& old = tried[static_cast<std::size_t>(i) + 1].second;
      check(VecAXPY(result.state, weight(i), old.state));
      check(VecAXPY(result.state, -weight(i), tried.front().second.state));
      result.period += weight(i) * (old.period - tried.front().second.period);
    }
    return result;
  }
};

/// A full period from the candidate and the reduced model's answer to it.
struct Correction
{
  Candidate to;
  ReducedOrbit orbit; // of the shifted reduced model
  ReducedState shift;
};

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

/// Of the step size, from the orbit at twice as many steps; as if of order 1, which impacts can make it. False without
/// such an orbit.
bool judge_steps(Fitting& fitting, const ReducedOrbit& orbit, const ReducedState& shift)
{
  const ReducedOrbit fine = shoot_reduced(fitting, orbit.state, shift, orbit.period, 2 * fitting.steps, 0);
  Fidelity& fidelity = fitting.result.fidelity;
  const bool good = fine.cycle.outcome.word == "converged";
  fidelity.step_frequency_error = good ? 2 * std::abs(fine.period / orbit.period - 1) : std::nan("");
  fidelity.step_energy_error = good ? 2 * std::abs(fine.energy / orbit.energy - 1) : std::nan("");
  return good;
}

double step_error(const Fidelity& fidelity)
{
  return std::max(fidelity.step_frequency_error, fidelity.step_energy_error);
}

/// Steps a period for which the step's errors are half the wish, and its growth rate's (omega h)^2/4 is the wish; as if
/// of the order given.
int steps_for(const Fidelity& fidelity, int steps, int order)
{
  const double measured = 1.1 * steps * std::pow(2 * step_error(fidelity) / fidelity.accuracy, 1. / order);
  const double theory = std::numbers::pi / std::sqrt(fidelity.accuracy);
  return 8 * static_cast<int>(std::ceil(std::max(measured, theory) / 8));
}

/// The candidate at as many steps a period as the wish needs; says what is in the way.
std::string refine_steps(Fitting& fitting, Correction correction, int order)
{
  const int steps = std::max(fitting.steps, steps_for(fitting.result.fidelity, fitting.steps, order));
  const ReducedOrbit fine =
      shoot_reduced(fitting, correction.orbit.state, correction.shift, correction.orbit.period, steps, 0);
  if (fine.cycle.outcome.word != "converged")
    return "the reduced model has no cycle at " + std::to_string(steps) + " steps a period";
  fitting.energy_move = fitting.frequency_move = 1; // nothing is known yet at this many
  fitting.candidate = std::move(correction.to);
  fitting.candidate.period = fine.period;
  add_motion(fitting.reduced.model, 1, fine.state.q - correction.orbit.state.q, displacement(fitting.candidate.state));
  add_motion(fitting.reduced.model, 1, fine.state.v - correction.orbit.state.v, velocity(fitting.candidate.state));
  fitting.steps = steps;
  return {};
}

/// The reduced model and its cycle, the first candidate; says what is in the way.
std::string start(Fitting& fitting)
{
  const Full& full = fitting.full;
  const ComplexMode& mode = full.modes.front();
  fitting.active =
      pairs_that_may_change(full.interface, full.equilibrium, mode, fitting.options.margin * full.amplitude);
  PetscInt dofs = 0;
  check(VecGetSize(full.structure.load, &dofs));
  const std::size_t shapes = std::min(full.modes.size(), static_cast<std::size_t>(fitting.options.modes)) +
                             fitting.active.size() * static_cast<std::size_t>(full.interface.block());
  if (2 * shapes > static_cast<std::size_t>(dofs))
    return "a reduced model of " + std::to_string(shapes) + " shapes is not small next to " + std::to_string(dofs) +
           " degrees of freedom";
  build(fitting);
  const State first = mode_state(full.equilibrium, mode, full.amplitude, full.phase);
  const Owned<Vec> du = copy_of(first.u.get());
  check(VecAXPY(du, -1, full.equilibrium.u));
  const ReducedOrbit orbit =
      shoot_reduced(fitting, coordinates(fitting.reduced.model, full.structure, du, first.v), {},
                    1 / mode.frequency_hz(), fitting.steps, static_cast<int>(fitting.options.free_periods));
  if (orbit.cycle.outcome.word != "converged") return "the cycle of the reduced model: " + orbit.cycle.outcome.word;
  fitting.candidate = candidate_of(full, fitting.reduced, orbit);
  return {};
}

void note(Fitting& fitting, std::vector<NewtonRecord>& records)
{
  LimitCycle& cycle = fitting.result.cycle;
  const Fidelity& fidelity = fitting.result.fidelity;
  records.push_back({"full period", 2 * fidelity.size + 1, fidelity.full_periods, cycle.period,
                     std::max(fidelity.frequency_error, fidelity.energy_error), cycle.residual_full});
  cycle.records = records;
  cycle.newton_iterations = static_cast<int>(fidelity.full_periods);
  cycle.periods_integrated = fidelity.full_periods;
  cycle.residual_projected = std::nan("");
  cycle.outcome = {"converged", "", cycle.newton_iterations, cycle.residual_full};
}

/// One full period, or as many as the wish needs; says what is in the way.
std::string fit(Fitting& fitting)
{
  const bool adaptive = fitting.result.fidelity.asked == "auto";
  Fidelity& fidelity = fitting.result.fidelity;
  std::vector<NewtonRecord> records;
  Acceleration acceleration{fitting.full};
  bool rough = adaptive; // the steps are not yet what the wish needs
  for (PetscInt pass = 0; pass < (adaptive ? fitting.options.corrections : 1); ++pass)
  {
    fidelity.steps_per_period = fitting.steps;
    Correction correction = correct(fitting);
    note(fitting, records);
    if (correction.orbit.cycle.outcome.word != "converged")
      return adaptive ? "the corrected cycle of the reduced model: " + correction.orbit.cycle.outcome.word : "";
    const double error = std::max(fidelity.frequency_error, fidelity.energy_error);
    const bool near = error <= (rough ? 4 : .5) * fidelity.accuracy;
    if (!adaptive || near)
    {
      if (!judge_steps(fitting, correction.orbit, correction.shift) && adaptive)
        return "the reduced model has no cycle at twice as many steps a period";
      if (!adaptive || (!rough && step_error(fidelity) <= fidelity.accuracy / 2)) return {};
      const std::string problem = refine_steps(fitting, std::move(correction), rough ? 2 : 1); // 2 was not enough
      if (!problem.empty()) return problem;
      rough = false;
      acceleration.tried.clear();
      continue;
    }
    const std::vector<int> odd = surprises(fitting.full, fitting.active, fitting.result.cycle);
    if (odd.empty() || pass > 1)
    {
      fitting.candidate = acceleration.next(std::move(fitting.candidate), std::move(correction.to));
      continue;
    }
    fitting.active.insert(fitting.active.end(), odd.begin(), odd.end());
    std::sort(fitting.active.begin(), fitting.active.end());
    fitting.candidate = std::move(correction.to);
    acceleration.tried.clear();
    build(fitting);
  }
  return "the wish was not met in " + std::to_string(fidelity.full_periods) + " periods of the full model";
}

} // namespace

FittedCycle find_fitted_cycle(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                              const Modes& modes, const Estimate& estimate, const CycleSettings& settings,
                              const std::string& asked, double accuracy, Mat probes)
{
  const Full full{structure,     interface, equilibrium, modes.modes, settings, probes, start_amplitude(estimate),
                  estimate.phase};
  const bool adaptive = asked == "auto";
  Fitting fitting(full);
  fitting.steps = adaptive ? std::min(64, settings.steps_per_period) : settings.steps_per_period;
  Fidelity& fidelity = fitting.result.fidelity;
  fidelity.asked = asked;
  fidelity.used = "reduced";
  fidelity.accuracy = accuracy;
  fidelity.contact_tolerance = 1e-3 * accuracy;
  std::string problem = modes.unstable_count > 1 && adaptive
                            ? "several modes are unstable: their cycle is sought on the full model"
                            : start(fitting);
  if (problem.empty()) problem = fit(fitting);
  FittedCycle& result = fitting.result;
  if (problem.empty())
  {
    if (!settings.save_state.empty()) write_state(result.cycle.start, structure, settings.save_state);
    return std::move(result);
  }
  fidelity.reason = problem;
  if (asked == "reduced")
  {
    result.cycle.outcome.word = "not converged";
    result.cycle.outcome.reason = problem;
    return std::move(result);
  }
  fidelity.used = "full";
  const double clock = MPI_Wtime();
  CycleSettings refined = settings;
  refined.steps_per_period = std::max(settings.steps_per_period, fitting.steps);
  result.cycle = find_cycle(structure, interface, equilibrium,
                            std::span(modes.modes).first(static_cast<std::size_t>(std::max(modes.unstable_count, 1))),
                            estimate, refined, probes);
  fidelity.steps_per_period = refined.steps_per_period;
  fidelity.full_seconds += MPI_Wtime() - clock;
  fidelity.full_periods += result.cycle.periods_integrated;
  return std::move(result);
}

} // namespace squeal
