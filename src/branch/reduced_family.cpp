#include "reduced_family.hpp"

#include "squeal/base/run_control.hpp"
#include "squeal/cycle/reduced_spectrum.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void need(const Outcome& outcome, const char* what, const BrakeBranchProblem& problem, double parameter)
{
  if (outcome.kind != OutcomeKind::converged)
    throw Error(format("the scene with %s = %.6g has no %s", problem.settings.key.c_str(), parameter, what));
}

/// The modes of the band at an equilibrium of the range.
Modes modes_at(const SlidingEquilibrium& sliding, const BrakeBranchProblem& problem)
{
  return find_modes(sliding, linearise(sliding), problem.modes, problem.modes_options);
}

constexpr std::size_t parts_of_motion = 8; // of the list below, those that motion depends on

/// What one polynomial in the parameter stands for.
std::vector<Eigen::Map<VectorXd>> parts_of(ReducedBrake& brake)
{
  ReducedModel& model = brake.model;
  std::vector<Eigen::Map<VectorXd>> parts;
  for (MatrixXd* const matrix : {&model.M, &model.C, &model.K, &model.H, &model.G, &model.M_z, &model.K_z})
    parts.emplace_back(matrix->data(), matrix->size());
  for (VectorXd* const vector : {&model.force, &brake.rest, &brake.pull})
    parts.emplace_back(vector->data(), vector->size());
  for (std::vector<double>* const list : {&model.compliance, &model.drive})
    parts.emplace_back(list->data(), static_cast<Index>(list->size()));
  const auto add_law = [&](FrictionLaw& law)
  {
    for (double* const number : {&law.coefficient, &law.static_coefficient, &law.decay_speed})
      parts.emplace_back(number, 1);
  };
  add_law(model.friction.common);
  for (FrictionLaw& law : model.friction.own) add_law(law);
  parts.emplace_back(&brake.energy, 1);
  return parts;
}

/// Weights of the samples at a value: the polynomial through Chebyshev points of the second kind (Berrut and Trefethen
/// 2004, eq. 4.2 and 5.4).
std::vector<double> weights_at(const std::vector<double>& nodes, double parameter)
{
  std::vector<double> weights(nodes.size(), 0.);
  double sum = 0;
  for (std::size_t i = 0; i < nodes.size(); ++i)
  {
    if (parameter == nodes[i])
    {
      std::fill(weights.begin(), weights.end(), 0.);
      weights[i] = 1;
      return weights;
    }
    const bool end = i == 0 || i + 1 == nodes.size();
    weights[i] = (i % 2 == 0 ? 1 : -1) * (end ? 0.5 : 1) / (parameter - nodes[i]);
    sum += weights[i];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

ReducedBrake combined(std::vector<ReducedBrake>& samples, const std::vector<double>& weights)
{
  ReducedBrake result = samples[static_cast<std::size_t>(std::ranges::max_element(weights) - weights.begin())];
  const std::vector<Eigen::Map<VectorXd>> sums = parts_of(result);
  for (Eigen::Map<VectorXd> sum : sums) sum.setZero();
  for (std::size_t i = 0; i < samples.size(); ++i)
  {
    const std::vector<Eigen::Map<VectorXd>> parts = parts_of(samples[i]);
    for (std::size_t k = 0; k < sums.size(); ++k) Eigen::Map<VectorXd>(sums[k]) += weights[i] * parts[k];
  }
  return result;
}

/// The largest relative distance between the parts that motion depends on.
double distance(ReducedBrake& found, ReducedBrake& exact)
{
  const std::vector<Eigen::Map<VectorXd>> a = parts_of(found), b = parts_of(exact);
  double largest = 0;
  for (std::size_t k = 0; k < parts_of_motion; ++k)
    largest = std::max(largest, (a[k] - b[k]).norm() / std::max(b[k].norm(), 1e-300));
  return largest;
}

/// The energy norm of the followed mode at an amplitude of 1.
double unit_norm(const BrakeBranchProblem& problem)
{
  const ComplexMode& mode = problem.followed;
  const Owned<Vec> v = zeros_like(mode.real);
  check(VecAXPY(v, mode.lambda.real(), mode.real));
  check(VecAXPY(v, -mode.lambda.imag(), mode.imaginary));
  const Owned<Vec> state = state_of(mode.real, v);
  Flow flow;
  flow.M = problem.sliding.structure.M;
  flow.K = problem.sliding.structure.K;
  return energy_norm(flow, state);
}

/// A state some part of a step later.
ReducedState moved_on(const ReducedMap& map, double time, ReducedState state)
{
  ReducedMap part{map.model, map.steps, map.theta};
  prepare(part, time * map.steps);
  ReducedContact contact{map.reactions};
  (void)advance(part, state, contact);
  return state;
}

/// The reactions at rest with the friction of this value. Those of another value would make pairs stick or slide at the
/// start of a period by the least change.
VectorXd sliding_reactions(const ReducedModel& model)
{
  VectorXd reactions = VectorXd::Map(model.reactions.data(), static_cast<Index>(model.reactions.size()));
  const PairView<double> r(reactions, model.directions);
  const TangentView drive(model.drive, model.directions);
  for (std::size_t i = 0; i < r.pairs(); ++i)
  {
    const double speed = length(drive.of(i));
    const double friction =
        speed > 0 ? friction_coefficient(model.friction.of(i), speed).value * r.normal(i) / speed : 0;
    for (std::size_t k = 0; k < drive.of(i).size(); ++k) r.tangential(i)[k] = friction * drive.of(i)[k];
  }
  return reactions;
}

} // namespace

void PairsSeen::add(std::size_t pair, ContactStatus status)
{
  (status == ContactStatus::open ? open : status == ContactStatus::slip ? slipping : sticking)[pair] = 1;
}

PairRoles PairsSeen::roles(const std::vector<double>& reactions) const
{
  PairRoles roles{{}, std::vector<char>(open.size(), 0), reactions};
  for (std::size_t i = 0; i < open.size(); ++i)
    if (sticking[i] || (open[i] && slipping[i]))
      roles.active.push_back(static_cast<int>(i));
    else if (slipping[i])
      roles.sliding[i] = 1;
  return roles;
}

PairsSeen pairs_seen_in(const BrakeBranchProblem& problem, double margin)
{
  const auto& [structure, interface, equilibrium] = problem.sliding;
  const auto pairs = static_cast<std::size_t>(interface.pairs);
  PairsSeen seen{std::vector<char>(pairs, 0), std::vector<char>(pairs, 0), std::vector<char>(pairs, 0)};
  for (std::size_t i = 0; i < pairs; ++i)
    seen.add(i, equilibrium.closed[i] ? ContactStatus::slip : ContactStatus::open);
  for (const std::vector<ContactStatus>& statuses : problem.cycle.measured.statuses)
    for (std::size_t i = 0; i < pairs; ++i) seen.add(i, statuses[i]);
  double amplitude = margin * problem.cycle.orbit.fluctuation / unit_norm(problem);
  MPI_Bcast(&amplitude, 1, MPI_DOUBLE, 0, comm_of(structure.load)); // sums may differ in their last bit
  for (const int pair : pairs_that_may_turn(interface, problem.followed, amplitude))
    if (equilibrium.closed[static_cast<std::size_t>(pair)])
      seen.add(static_cast<std::size_t>(pair), ContactStatus::stick);
  for (const int pair : pairs_that_may_change(interface, equilibrium, problem.followed, amplitude))
    for (const ContactStatus status : {ContactStatus::open, ContactStatus::slip})
      seen.add(static_cast<std::size_t>(pair), status);
  return seen;
}

ReducedFamily::At::At(double value, ReducedBrake made, int steps, double theta)
    : parameter(value), brake(std::move(made)), map{brake.model, steps, theta}
{
  map.reactions = sliding_reactions(brake.model);
}

ReducedFamily::ReducedFamily(BrakeFamily& full, const BrakeBranchProblem& problem, const PairsSeen& seen)
    : problem_(problem), least_(std::min(problem.settings.from, problem.settings.to)),
      greatest_(std::max(problem.settings.from, problem.settings.to)),
      roles_(seen.roles(problem.sliding.equilibrium.reactions))
{
  // shapes of the ends: their modes, and where they rest
  std::vector<Owned<Vec>> shapes;
  for (const double end : {least_, greatest_})
  {
    full.set_parameter(end);
    const SlidingEquilibrium sliding = full.sliding();
    need(sliding.equilibrium.outcome, "equilibrium", problem, end);
    Modes modes = modes_at(sliding, problem);
    need(modes.outcome, "modes", problem, end);
    shapes.push_back(copy_of(sliding.equilibrium.u.get()));
    check(VecAXPY(shapes.back(), -1, problem.sliding.equilibrium.u));
    for (ComplexMode& mode : modes.modes)
    {
      shapes.push_back(std::move(mode.real));
      shapes.push_back(std::move(mode.imaginary));
    }
  }
  std::erase_if(shapes,
                [](const Owned<Vec>& shape)
                {
                  double norm = 0;
                  check(VecNorm(shape, NORM_2, &norm));
                  return norm == 0;
                });
  const std::vector<Vec> more(shapes.begin(), shapes.end());
  Reduction reduction;
  reduction.modes = static_cast<PetscInt>(problem.own_modes.size());
  reduction.factor = problem.step.factor;
  reduction.more = more;
  own_ = reduce(problem.sliding, problem.own_modes, roles_, reduction);
  energy_ = energy_matrices(own_);
  probes_ = problem.probes ? whole_product(problem.probes, own_.shapes) : MatrixXd(0, own_.size());
  open_pairs_ = problem.sliding.interface.pairs - static_cast<int>(roles_.active.size()) -
                static_cast<int>(std::count(roles_.sliding.begin(), roles_.sliding.end(), 1));
  take_samples(full);
  set_parameter(problem.settings.own);
}

ReducedBrake ReducedFamily::sample(BrakeFamily& full, double parameter)
{
  full.set_parameter(parameter);
  const SlidingEquilibrium sliding = full.sliding();
  need(sliding.equilibrium.outcome, "equilibrium", problem_, parameter);
  check_shapes_fit(sliding.interface);
  ReducedBrake brake{on_the_same_shapes(own_, problem_.sliding, sliding, roles_), {}, {}};
  const Vec u0 = problem_.sliding.equilibrium.u;
  const Owned<Vec> moved = copy_of(sliding.equilibrium.u.get()), zero = zeros_like(moved), force = zeros_like(moved);
  check(VecAXPY(moved, -1, u0));
  brake.rest = coordinates(own_, problem_.sliding.structure, moved, zero).q;
  check(MatMult(sliding.structure.K, u0, force));
  brake.pull = inner_products(own_.shapes, columns_of(std::array{force.get()})).col(0);
  check(VecDot(force, u0, &brake.energy));
  brake.energy /= 2;
  MPI_Bcast(&brake.energy, 1, MPI_DOUBLE, 0, comm_of(u0));
  return brake;
}

void ReducedFamily::check_shapes_fit(const Interface& other) const
{
  constexpr double rounding = 1e-12; // of directions found anew
  const Interface& own = problem_.sliding.interface;
  const Owned<Mat> moved = copy_of(own.B);
  double change = 0, whole = 0;
  check(MatAXPY(moved, -1, other.B, DIFFERENT_NONZERO_PATTERN));
  check(MatNorm(moved, NORM_FROBENIUS, &change));
  check(MatNorm(own.B, NORM_FROBENIUS, &whole));
  bool same = change <= rounding * whole;
  for (std::size_t i = 0; i < own.gap.size(); ++i)
    same = same && own.gap[i] == other.gap[i] && (compliance_of(own, i) == 0) == (compliance_of(other, i) == 0);
  if (!same)
    throw Error(format("%s moves the contact itself, which a reduced model for all values cannot: set fidelity = "
                       "\"full\"",
                       problem_.settings.key.c_str()));
}

void ReducedFamily::take_samples(BrakeFamily& full)
{
  constexpr int first_intervals = 4, most_intervals = 32;
  constexpr double close_enough = 1e-7; // of each matrix
  const auto node = [&](int i, int intervals)
  { return (least_ + greatest_) / 2 - (greatest_ - least_) / 2 * std::cos(std::numbers::pi * i / intervals); };
  for (int intervals = first_intervals;; intervals *= 2)
  {
    std::vector<double> nodes;
    std::vector<ReducedBrake> samples;
    double error = samples_.empty() ? 1 : 0;
    for (int i = 0; i <= intervals; ++i)
    {
      nodes.push_back(node(i, intervals));
      const bool known = !samples_.empty() && i % 2 == 0;
      samples.push_back(known ? samples_[static_cast<std::size_t>(i / 2)] : sample(full, nodes.back()));
      if (known || samples_.empty()) continue;
      ReducedBrake between = interpolated(nodes.back());
      error = std::max(error, distance(between, samples.back()));
    }
    nodes_ = std::move(nodes);
    samples_ = std::move(samples);
    interpolation_error_ = error;
    if (error <= close_enough || intervals == most_intervals) return;
  }
}

ReducedBrake ReducedFamily::interpolated(double parameter)
{
  return combined(samples_, weights_at(nodes_, parameter));
}

void ReducedFamily::set_parameter(double parameter)
{
  if (at_ && at_->parameter == parameter) return;
  other_grid_.reset(); // of the model that goes
  at_ = std::make_unique<At>(parameter, interpolated(parameter), problem_.steps_per_period, problem_.cycle.theta);
  at_->map.contact.tolerance = problem_.step.contact.tolerance;
  at_->flow = flow_of(at_->map, energy_);
}

Orbit ReducedFamily::reduced(const Orbit& orbit)
{
  const Owned<Vec> moved = copy_of(displacement(orbit.state));
  check(VecAXPY(moved, -1, problem_.sliding.equilibrium.u));
  const Owned<Vec> state = vector_of(coordinates(own_, problem_.sliding.structure, moved, velocity(orbit.state)));
  double period = orbit.period;
  MPI_Bcast(&period, 1, MPI_DOUBLE, 0, comm_of(moved)); // every rank follows the branch by itself
  return {copy_of(state.get()), period, zeros_like(state), zeros_like(state), orbit.fluctuation, orbit.residual};
}

Owned<Vec> ReducedFamily::lifted(const VectorXd& state) const
{
  const Owned<Vec> still = zeros_like(problem_.sliding.structure.load);
  Owned<Vec> result = state_of(problem_.sliding.equilibrium.u, still);
  coordinates_in(own_, problem_.sliding.structure).add(state, result);
  return result;
}

SlowMotions ReducedFamily::slow_motions(double period, Vec start)
{
  ReducedMap& map = at_->map;
  const ReducedState state = reduced_state(start);
  const auto moved = record_contacts(map, period, moved_on(map, period / map.steps / 2, state));
  other_grid_.reset();
  recorded_ = record_contacts(map, period, state);
  const ReducedSpectrum spectrum = large_multipliers(map, period, recorded_);
  SlowMotions slow = slow_motions_of(spectrum, own_, own_coordinates(), start);
  slow.periods = 2;
  add_changes(multipliers_along(spectrum, map, period, moved), 1, slow);
  return slow;
}

PointMeasures ReducedFamily::measure(const Orbit& orbit)
{
  const ReducedBrake& brake = at_->brake;
  const ReducedModel& model = brake.model;
  ReducedMap& map = at_->map;
  const ReducedState start = reduced_state(orbit.state);
  PointMeasures measures;
  const Index probes = probes_.rows();
  VectorXd least = VectorXd::Constant(probes, std::numeric_limits<double>::infinity()), most = -least;
  const auto watch = [&](const ReducedState& now)
  {
    const VectorXd moved = now.q - brake.rest;
    const double kinetic = now.v.dot(model.M_z * now.v);
    measures.mean_fluctuating_energy += (kinetic + moved.dot(model.K_z * moved)) / (2. * map.steps);
    measures.mean_energy +=
        (brake.energy + brake.pull.dot(now.q) + (kinetic + now.q.dot(model.K_z * now.q)) / 2) / map.steps;
    const VectorXd values = probes_ * now.q;
    least = least.cwiseMin(values);
    most = most.cwiseMax(values);
  };
  (void)integrate(map, orbit.period, start, watch);
  for (Index i = 0; i < probes; ++i) measures.peak_to_peak.push_back(most[i] - least[i]);
  std::vector<std::vector<ContactStatus>> statuses;
  for (const StepRecord& contact : record_contacts(map, orbit.period, start))
    statuses.push_back(contact_status(PairView(contact.reactions, model.directions),
                                      PairView(contact.contact_velocity, model.directions), model.friction));
  count_statuses(statuses, measures);
  measures.slips_nonlinearly = depends_on_speed(model.friction);
  double open = 0;
  for (const auto& status : statuses)
    open += static_cast<double>(std::count(status.begin(), status.end(), ContactStatus::open));
  measures.open_pairs_mean = open_pairs_ + open / static_cast<double>(statuses.size());
  return measures;
}

FlowFamily ReducedFamily::flows()
{
  FlowFamily family;
  family.flow.M = energy_.M;
  family.flow.K = energy_.K;
  family.flow.integrate = [this](double period, Vec start, Vec end, Vec rate)
  {
    if (is_asked_here()) throw Interrupted{}; // every rank follows the branch by itself
    at_->flow.integrate(period, start, end, rate);
  };
  family.flow.record_period = [this](double period, Vec start, const TimeGrid& grid)
  {
    const int steps = grid.steps(at_->map.steps);
    other_grid_.reset();
    if (steps != at_->map.steps)
    {
      other_grid_.emplace(at_->map);
      other_grid_->steps = steps;
    }
    ReducedMap& map = other_grid_ ? *other_grid_ : at_->map;
    const ReducedState state = reduced_state(start);
    recorded_ =
        record_contacts(map, period, grid.shift > 0 ? moved_on(map, grid.shift * period / steps, state) : state);
  };
  family.flow.apply_tangent = [this](std::span<const Vec> states)
  {
    ReducedMap& map = other_grid_ ? *other_grid_ : at_->map;
    copy_columns(apply_tangent(map, map.h * map.steps, recorded_, columns_of_states(states)), states);
  };
  family.flow.slow_motions = [this](double period, Vec start) { return slow_motions(period, start); };
  family.set_parameter = [this](double parameter) { set_parameter(parameter); };
  family.rest = [this] { return vector_of(ReducedState{at_->brake.rest, VectorXd::Zero(own_.size())}); };
  family.parameter_column = [this](double period, Vec start, Vec column)
  { difference_column(flows(), at_->parameter, greatest_ - least_, period, start, column); };
  family.measure = [this](const Orbit& orbit) { return measure(orbit); };
  family.preconditioner = preconditioner_of(correction_, own_coordinates());
  family.renew_preconditioner = [this](double period, Vec start)
  { correction_ = monodromy_correction(at_->map, period, reduced_state(start)); };
  return family;
}

} // namespace squeal
