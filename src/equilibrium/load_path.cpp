#include "load_path.hpp"

#include "balance.hpp"
#include "squeal/algebra/lent_cores.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd as_vector(const std::vector<double>& values)
{
  return VectorXd::Map(values.data(), static_cast<Index>(values.size()));
}

/// u + K'^-1 (load + B' forces - K' u): a step of iterative refinement.
void displace(const Held& held, const Interface& interface, Vec load, const std::vector<double>& forces, Vec u)
{
  const auto rhs = copy_of(load), residual = zeros_like(load), correction = zeros_like(load);
  add_reactions(interface, forces, rhs);
  check(MatMult(held.augmented, u, residual));
  check(VecAYPX(residual, -1, rhs));
  solve(held.factor, residual, correction);
  check(VecAXPY(u, 1, correction));
}

/// The steps of the path with the motion of the rows by their loads alone. Collective.
std::vector<PathEnd> ends_of(const PathOperators& operators, const Structure& structure, const Interface& interface)
{
  std::vector<PathEnd> ends;
  const std::vector<double> nothing(interface.size(), 0.);
  const auto add = [&](const std::string& name, Vec load, double friction)
  {
    const auto u = zeros_like(load);
    for (int pass = 0; pass < 2; ++pass) displace(operators.held, interface, load, nothing, u);
    ends.push_back({name, as_vector(relative(interface, u)), friction});
  };
  for (const PathStep& step : structure.path) add(step.name, step.load, step.driven_friction);
  if (ends.empty()) add("load", structure.load, 1);
  return ends;
}

std::vector<int> contacts_of(const Interface& interface)
{
  std::vector<int> contact;
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
    contact.push_back(static_cast<int>(interface.friction.contact_of(i)));
  return contact;
}

StickSlipFriction friction_of(const Interface& interface)
{
  StickSlipFriction friction{drive_friction(interface), drive_directions(interface)};
  for (std::size_t i = 0; i < friction.mu.size(); ++i)
    if (drive_speed(interface, i) == 0) friction.mu[i] = friction_coefficient(interface.friction.of(i), 0).value;
  return friction;
}

/// N = 1 - kappa D and M = D, to which compliances c in series with the rows add: the unknown motions are w + c r.
StickSlipOperator operator_of(const PathOperators& operators, const Interface& interface)
{
  MatrixXd N = -operators.held.kappa * operators.D, M = operators.D;
  N.diagonal().array() += 1;
  N = (N.array().abs() < 1e-13).select(0, N); // rounding of 1 - 1: the pair alone holds its body
  if (const std::vector<double> c = compliance_of_rows(interface); !c.empty()) M += N * as_vector(c).asDiagonal();
  return make_stick_slip_operator(std::move(N), std::move(M), interface.directions, contacts_of(interface));
}

/// The result that rank 0 finds on the rows of the pairs, and every rank has then.
struct Found
{
  int stopped = 0, completed = 0, increments = 0, iterations = 0, index = 0;
  double change = 0, reciprocal_condition = 0;
  std::string reason{};
  std::vector<double> r, w, offset;
  std::vector<ContactStatus> statuses;
};

void share(Found& found, MPI_Comm comm)
{
  for (int* number : {&found.stopped, &found.completed, &found.increments, &found.iterations, &found.index})
    MPI_Bcast(number, 1, MPI_INT, 0, comm);
  for (double* number : {&found.change, &found.reciprocal_condition}) MPI_Bcast(number, 1, MPI_DOUBLE, 0, comm);
  broadcast(found.reason, comm);
  for (std::vector<double>* list : {&found.r, &found.w, &found.offset}) broadcast(*list, comm);
  broadcast(found.statuses, comm);
}

std::vector<double> as_list(const VectorXd& x)
{
  return {x.data(), x.data() + x.size()};
}

std::string place_of(const Interface& interface, std::size_t pair)
{
  if (interface.geometry.empty()) return format("pair %zu", pair);
  const ContactPair& at = interface.geometry[pair];
  return format("pair %zu of contact %d at (%g, %g, %g)", pair, at.contact, at.position[0], at.position[1],
                at.position[2]);
}

std::size_t pair_that_moves_most(const Interface& interface, const VectorXd& motion)
{
  Index row = 0;
  motion.cwiseAbs().maxCoeff(&row);
  return PairRows<std::size_t>(interface.directions).pair_of(static_cast<std::size_t>(row));
}

/// Why the walk ended: its own reason, the pairs that slip there, and the proof where there is one.
std::string mechanism(const PathProblem& problem, const PathWalk& walk, const Interface& interface)
{
  std::string text = walk.reason;
  if (walk.increments > 0)
  {
    const std::vector<ContactStatus> statuses = StatusSystem(problem.of, walk.friction, walk.state).statuses();
    std::size_t slipping = 0;
    for (std::size_t i = 0; i < statuses.size(); ++i)
      slipping += statuses[i] == ContactStatus::slip && is_undriven(interface, i);
    text += format("; %zu undriven pairs slip there, and %s moves most", slipping,
                   place_of(interface, pair_that_moves_most(interface, walk.state.w)).c_str());
  }
  const auto motion = unresisted_motion(problem, problem.friction, problem.ends.back().q);
  if (!motion) return text;
  return text +
         "; it is proved that no forces within friction balance the load: nothing resists a rigid motion that is "
         "largest at " +
         place_of(interface, pair_that_moves_most(interface, *motion));
}

/// The end of the walk. All but `found` is rank 0's.
struct EndOfPath
{
  StickSlipOperator of{};
  std::optional<Eigen::PartialPivLU<MatrixXd>> by{}; // M of the operator, where it is divided
  StickSlipFriction friction{};
  double least_force = 0;
  std::optional<StatusSystem> system{};
  Found found{};

  VectorXd divided(const VectorXd& q) const { return by ? VectorXd(by->solve(q)) : q; }
};

/// On rank 0.
void walk_to_end(const PathOperators& operators, const Interface& interface, std::vector<PathEnd> ends,
                 const std::optional<StickSlipState>& from, EndOfPath& end)
{
  end.of = operator_of(operators, interface);
  if (std::optional<DividedOperator> stiff = divided(end.of))
  {
    end.of = std::move(stiff->of);
    end.by = std::move(stiff->by);
  }
  for (PathEnd& step : ends) step.q = end.divided(step.q);
  const PathProblem problem{end.of, end.by ? 1 : operators.held.kappa, interface.gap, friction_of(interface), ends};
  const PathWalk walk = from ? hold_at(problem, *from) : walk_path(problem);
  end.friction = walk.friction;
  if (walk.completed) end.least_force = end.of.least_force(walk.q);
  Found& found = end.found;
  found.completed = walk.completed;
  found.increments = walk.increments;
  found.iterations = walk.iterations;
  found.change = walk.change;
  found.r = as_list(walk.state.r);
  found.w = as_list(walk.state.w);
  found.offset = as_list(walk.offset);
  if (!walk.completed)
  {
    found.reason = from ? walk.reason : mechanism(problem, walk, interface);
    return;
  }
  end.system.emplace(end.of, end.friction, walk.state);
  found.statuses = end.system->statuses();
  found.index = end.system->index();
  found.reciprocal_condition = end.system->reciprocal_condition();
}

/// Corrects the state by what u's own motion of the rows says, within the statuses: the rounding of D drops out.
/// Collective.
void settle(const PathOperators& operators, const Structure& structure, const Interface& interface, EndOfPath& end,
            Vec u)
{
  Found& found = end.found;
  const MPI_Comm comm = comm_of(structure.load);
  const std::vector<double> compliance = compliance_of_rows(interface);
  for (int pass = 0;; ++pass)
  {
    // motion of the rows: w - offset, less what gives in series with them
    std::vector<double> moved = found.w, forces = found.r;
    for (std::size_t k = 0; k < moved.size(); ++k) moved[k] -= found.offset[k];
    for (std::size_t k = 0; k < compliance.size(); ++k) moved[k] -= compliance[k] * found.r[k];
    for (std::size_t k = 0; k < moved.size(); ++k) forces[k] += operators.held.kappa * moved[k];
    displace(operators.held, interface, structure.load, forces, u);
    if (pass == 2) return;
    const VectorXd error = as_vector(relative(interface, u)) - as_vector(moved);
    on_rank_zero_with_lent_cores(comm, interface.size(),
                                 [&]
                                 {
                                   const StickSlipState change = end.system->response(end.divided(error));
                                   found.r = as_list(as_vector(found.r) + change.r);
                                   found.w = as_list(as_vector(found.w) + change.w);
                                 });
    broadcast(found.r, comm);
    broadcast(found.w, comm);
  }
}

LoadHistory history_of(const Interface& interface, const Found& found)
{
  LoadHistory history{found.increments,           found.change,  0, 0, 0, 0, found.index,
                      found.reciprocal_condition, found.statuses};
  const PairView r(found.r, interface.directions);
  for (std::size_t i = 0; i < found.statuses.size(); ++i)
  {
    if (!is_undriven(interface, i)) continue;
    const ContactStatus status = found.statuses[i];
    ++(status == ContactStatus::open ? history.open : status == ContactStatus::stick ? history.stick : history.slip);
    const double limit = friction_coefficient(interface.friction.of(i), 0).value * r.normal(i);
    history.at_limit += status == ContactStatus::stick && length(r.tangential(i)) >= 0.99 * limit;
  }
  return history;
}

/// Sets reactions, gaps and closed pairs of every rank.
void set_pairs(const Interface& interface, const Found& found, Equilibrium& equilibrium)
{
  const PairView w(found.w, interface.directions);
  equilibrium.reactions = found.r;
  const PairView<double> r(equilibrium.reactions, interface.directions);
  for (std::size_t i = 0; i < found.statuses.size(); ++i)
  {
    const bool open = found.statuses[i] == ContactStatus::open;
    equilibrium.closed.push_back(!open);
    equilibrium.gaps.push_back(open ? std::max(0., w.normal(i)) : 0);
    if (open) r.set(i, {});
  }
}

/// The natural map of the pairs by u's own motion of their rows. Collective.
double residual_of(const Interface& interface, const EndOfPath& end, const Equilibrium& equilibrium)
{
  StickSlipState at{as_vector(equilibrium.reactions),
                    as_vector(slip_positions(interface, equilibrium.u, equilibrium.reactions)) +
                        as_vector(end.found.offset)};
  double residual = 0;
  on_rank_zero(comm_of(interface.B),
               [&] { residual = stick_slip_residual(end.of, end.friction, at, end.least_force); });
  MPI_Bcast(&residual, 1, MPI_DOUBLE, 0, comm_of(interface.B));
  return residual;
}

} // namespace

PathOperators path_operators(const Structure& structure, const Interface& interface, const EquilibriumOptions& options)
{
  PathOperators operators{
      shared(structure.K.get()), shared(interface.B.get()), hold_by_all_rows(structure, interface, options.factor), {}};
  const std::vector<double> D = operators.held.factor.condensed(1);
  const auto size = static_cast<Index>(rank_of(comm_of(structure.load)) == 0 ? interface.size() : 0);
  operators.D = MatrixXd::Map(D.data(), size, size); // symmetric
  return operators;
}

Equilibrium find_by_path(const PathOperators& operators, const Structure& structure, const Interface& interface,
                         const std::optional<StickSlipState>& from)
{
  const MPI_Comm comm = comm_of(structure.load);
  const std::vector<PathEnd> ends = ends_of(operators, structure, interface);
  EndOfPath end;
  on_rank_zero_with_lent_cores(comm, interface.size(),
                               [&]
                               {
                                 try
                                 {
                                   walk_to_end(operators, interface, ends, from, end);
                                 }
                                 catch (const Interrupted&)
                                 {
                                   end.found.stopped = 1;
                                 }
                               });
  Found& found = end.found;
  share(found, comm);
  if (found.stopped) join_parts(comm); // which throws
  Equilibrium equilibrium;
  equilibrium.u = zeros_like(structure.load);
  equilibrium.directions = interface.directions;
  equilibrium.auxiliary_stiffness = operators.held.kappa;
  if (!found.completed)
  {
    equilibrium.outcome = {OutcomeKind::no_equilibrium, found.reason, found.iterations, 1};
    equilibrium.closed.assign(interface.gap.size(), 0);
    equilibrium.reactions.assign(interface.size(), 0.);
    equilibrium.gaps.assign(interface.gap.size(), 0.);
    return equilibrium;
  }
  settle(operators, structure, interface, end, equilibrium.u);
  set_pairs(interface, found, equilibrium);
  equilibrium.history = history_of(interface, found);
  const double residual = residual_of(interface, end, equilibrium);
  const bool good = balances(structure, interface, equilibrium) && residual <= 1e-9;
  equilibrium.outcome = {good ? OutcomeKind::converged : OutcomeKind::not_converged,
                         good ? "" : "the statuses were found, but rounding leaves residuals above 1e-9",
                         found.iterations, residual};
  return equilibrium;
}

} // namespace squeal
