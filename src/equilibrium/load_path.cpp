#include "load_path.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/packed.hpp"
#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

VectorXd as_vector(const std::vector<double>& values)
{
  return VectorXd::Map(values.data(), static_cast<Index>(values.size()));
}

/// u + K'^-1 (load + B' forces - K' u): a step of iterative refinement.
void displace(const PathOperators& operators, const Interface& interface, Vec load, const std::vector<double>& forces,
              Vec u)
{
  const auto rhs = copy_of(load), residual = zeros_like(load), correction = zeros_like(load);
  const Held& held = operators.held;
  if (interface.pairs > 0) add_reactions(interface, forces, rhs);
  check(MatMult(held.augmented ? held.augmented.get() : operators.K.get(), u, residual));
  check(VecAYPX(residual, -1, rhs));
  solve(held.factor, residual, correction);
  check(VecAXPY(u, 1, correction));
}

/// Tangential rows of a pair among those of the problem.
int directions_of(const PathOperators& operators, const Interface& interface)
{
  return operators.driven ? 0 : interface.directions;
}

/// The entries of a contact vector in the rows of the problem.
std::vector<double> rows_of_problem(const PathOperators& operators, const Interface& interface,
                                    std::vector<double> contact_vector)
{
  if (!operators.driven || contact_vector.empty()) return contact_vector;
  std::vector<double> normal;
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
    normal.push_back(PairView(contact_vector, interface.directions).normal(i));
  return normal;
}

/// Reactions on all rows of the pairs: friction of driven ones follows the normal reactions r.
std::vector<double> with_friction(const PathOperators& operators, const Interface& interface,
                                  const std::vector<double>& r)
{
  if (!operators.driven) return r;
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  std::vector<double> forces(interface.size());
  const PairView view(forces, interface.directions);
  for (std::size_t i = 0; i < r.size(); ++i)
  {
    view.normal(i) = r[i];
    for (std::size_t k = 0; k < e.of(i).size(); ++k) view.tangential(i)[k] = mu[i] * r[i] * e.of(i)[k];
  }
  return forces;
}

/// The steps of the path with the motion of the rows by their loads alone. Collective.
std::vector<PathEnd> ends_of(const PathOperators& operators, const Structure& structure, const Interface& interface)
{
  std::vector<PathEnd> ends;
  const std::vector<double> nothing(interface.size(), 0.);
  const auto add = [&](const std::string& name, Vec load, double friction)
  {
    const auto u = zeros_like(load);
    for (int pass = 0; pass < 2; ++pass) displace(operators, interface, load, nothing, u);
    ends.push_back({name, as_vector(rows_of_problem(operators, interface, relative(interface, u))), friction});
  };
  for (const PathStep& step : structure.path)
    if (!operators.driven) add(step.name, step.load, step.driven_friction);
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

StickSlipFriction friction_of(const PathOperators& operators, const Interface& interface)
{
  if (operators.driven) return {std::vector<double>(interface.gap.size(), 0.), {}};
  StickSlipFriction friction{drive_friction(interface), drive_directions(interface)};
  for (std::size_t i = 0; i < friction.mu.size(); ++i)
    if (drive_speed(interface, i) == 0) friction.mu[i] = friction_coefficient(interface.friction.of(i), 0).value;
  return friction;
}

/// N = 1 - kappa D and M with the friction of driven pairs, to which compliances c in series with the rows add: the
/// unknown motions are w + c r.
StickSlipOperator operator_of(const PathOperators& operators, const Interface& interface)
{
  const MatrixXd& D = operators.D;
  const Index per_unknown = operators.driven ? PairRows<Index>(interface.directions).per_pair() : 1;
  MatrixXd N = D(Eigen::all, Eigen::seqN(0, D.rows(), per_unknown)), M = N;
  VectorXd own = N.diagonal();
  if (operators.driven)
  {
    const VectorXd forces = as_vector(with_friction(operators, interface, std::vector(interface.gap.size(), 1.)));
    for (Index pair = 0; pair < M.cols(); ++pair)
      M.col(pair) = D.middleCols(pair * per_unknown, per_unknown) * forces.segment(pair * per_unknown, per_unknown);
  }
  N *= -operators.held.kappa;
  N.diagonal().array() += 1;
  N = (N.array().abs() < 1e-13).select(0, N); // rounding of 1 - 1: the pair alone holds its body
  if (const auto c = rows_of_problem(operators, interface, compliance_of_rows(interface)); !c.empty())
  {
    M += N * as_vector(c).asDiagonal();
    own += N.diagonal().cwiseProduct(as_vector(c));
  }
  return make_stick_slip_operator(std::move(N), std::move(M), own, directions_of(operators, interface),
                                  contacts_of(interface));
}

/// The result that rank 0 finds on the rows of the pairs, and every rank has then.
struct Found
{
  int stopped = 0, completed = 0, impossible = 0, unique = 0, increments = 0, iterations = 0, index = 0;
  double change = 0, reciprocal_condition = 0;
  std::string reason{};
  std::vector<double> r, w, offset;
  std::vector<ContactStatus> statuses;
};

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Found, stopped, completed, impossible, unique, increments, iterations, index, change,
                                   reciprocal_condition, reason, r, w, offset, statuses)

std::vector<double> as_list(const VectorXd& x)
{
  return {x.data(), x.data() + x.size()};
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
                   place_of_pair(interface, pair_that_moves_most(interface, walk.state.w)).c_str());
  }
  const auto motion = unresisted_motion(problem, problem.friction, problem.ends.back().q);
  if (!motion) return text;
  return text +
         "; it is proved that no forces within friction balance the load: nothing resists a rigid motion that is "
         "largest at " +
         place_of_pair(interface, pair_that_moves_most(interface, *motion));
}

/// The end of the walk. All but `found` is rank 0's.
struct EndOfPath
{
  StickSlipOperator of{};
  StickSlipFriction friction{};
  double least_force = 0;
  std::optional<StatusSystem> system{};
  Found found{};
};

/// On rank 0.
void walk_to_end(const PathOperators& operators, const Interface& interface, const std::vector<PathEnd>& ends,
                 const PathStart& start, EndOfPath& end)
{
  end.of = operator_of(operators, interface);
  const PathProblem problem{end.of, operators.held.kappa, interface.gap, friction_of(operators, interface), ends};
  const PathWalk walk = operators.driven ? rest_of(problem, start.closed)
                        : start.state    ? hold_at(problem, *start.state)
                                         : walk_path(problem);
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
    found.impossible = walk.impossible;
    if (!operators.driven) found.reason = start.state ? walk.reason : mechanism(problem, walk, interface);
    return;
  }
  if (operators.driven) found.unique = has_one_solution(end.of);
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
  const std::vector<double> compliance = rows_of_problem(operators, interface, compliance_of_rows(interface));
  for (int pass = 0;; ++pass)
  {
    // motion of the rows: w - offset, less what gives in series with them
    std::vector<double> moved = found.w;
    for (std::size_t k = 0; k < moved.size(); ++k) moved[k] -= found.offset[k];
    for (std::size_t k = 0; k < compliance.size(); ++k) moved[k] -= compliance[k] * found.r[k];
    std::vector<double> forces = with_friction(operators, interface, found.r);
    const PairView<double> all(forces, interface.directions);
    const PairView<const double> motion(moved, directions_of(operators, interface));
    for (std::size_t i = 0; i < all.pairs(); ++i)
      for (std::size_t k = 0; k < motion.of(i).size(); ++k) all.of(i)[k] += operators.held.kappa * motion.of(i)[k];
    displace(operators, interface, structure.load, forces, u);
    if (pass == 2) return;
    if (interface.pairs == 0) continue;
    const VectorXd error = as_vector(rows_of_problem(operators, interface, relative(interface, u))) - as_vector(moved);
    on_rank_zero(comm,
                 [&]
                 {
                   const StickSlipState change = end.system->response(error);
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
void set_pairs(const PathOperators& operators, const Interface& interface, const Found& found, Equilibrium& equilibrium)
{
  const PairView w(found.w, directions_of(operators, interface));
  std::vector<double> reactions = found.r;
  for (double& r : reactions) r = operators.driven ? std::max(0., r) : r;
  equilibrium.reactions = with_friction(operators, interface, reactions);
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
double residual_of(const PathOperators& operators, const Interface& interface, const EndOfPath& end,
                   const Equilibrium& equilibrium)
{
  const auto rows = [&](std::vector<double> x)
  { return as_vector(rows_of_problem(operators, interface, std::move(x))); };
  StickSlipState at{rows(equilibrium.reactions), rows(slip_positions(interface, equilibrium.u, equilibrium.reactions)) +
                                                     as_vector(end.found.offset)};
  double residual = 0;
  on_rank_zero(comm_of(interface.B),
               [&] { residual = stick_slip_residual(end.of, end.friction, at, end.least_force); });
  MPI_Bcast(&residual, 1, MPI_DOUBLE, 0, comm_of(interface.B));
  return residual;
}

/// The outcome of a search that found nothing.
Outcome failure(const PathOperators& operators, const Interface& interface, const Found& found)
{
  if (!operators.driven) return {OutcomeKind::no_equilibrium, found.reason, found.iterations, 1};
  const std::vector<double> mu = drive_friction(interface);
  const double friction = *std::ranges::max_element(mu);
  if (found.impossible)
    return {OutcomeKind::no_equilibrium,
            format("no set of closed pairs balances the load at mu = %g: friction jams the structure, or it tips, "
                   "slides away or lifts off",
                   friction),
            found.iterations, 1};
  return {
      OutcomeKind::not_converged,
      format("no fitting set of closed pairs was found at mu = %g, and nothing proves that there is none", friction),
      found.iterations, 1};
}

/// The equilibrium with the pairs that were found, by u's own motions.
void settle_and_check(const PathOperators& operators, const Structure& structure, const Interface& interface,
                      EndOfPath& end, Equilibrium& equilibrium)
{
  const Found& found = end.found;
  double residual = 0;
  settle(operators, structure, interface, end, equilibrium.u);
  if (interface.pairs > 0)
  {
    set_pairs(operators, interface, found, equilibrium);
    residual = residual_of(operators, interface, end, equilibrium);
  }
  if (!operators.driven) equilibrium.history = history_of(interface, found);
  if (operators.driven && operators.held.kappa == 0)
    equilibrium.uniqueness = found.unique || interface.pairs == 0 ? Uniqueness::assured : Uniqueness::not_assured;
  const bool good = balances(structure, interface, equilibrium) && residual <= 1e-9;
  equilibrium.outcome = {good ? OutcomeKind::converged : OutcomeKind::not_converged,
                         good ? "" : "the statuses were found, but rounding leaves residuals above 1e-9",
                         found.iterations, residual};
}

} // namespace

Equilibrium find_by_path(const PathOperators& operators, const Structure& structure, const Interface& interface,
                         const PathStart& start)
{
  const MPI_Comm comm = comm_of(structure.load);
  EndOfPath end;
  Found& found = end.found;
  found.completed = 1;
  if (interface.pairs > 0)
  {
    const std::vector<PathEnd> ends = ends_of(operators, structure, interface);
    on_rank_zero(comm,
                 [&]
                 {
                   try
                   {
                     walk_to_end(operators, interface, ends, start, end);
                   }
                   catch (const Interrupted&)
                   {
                     found.stopped = 1;
                   }
                 });
    broadcast_packed(found, comm);
    if (found.stopped) join_parts(comm); // which throws
  }
  Equilibrium equilibrium;
  equilibrium.u = zeros_like(structure.load);
  equilibrium.directions = interface.directions;
  equilibrium.auxiliary_stiffness = operators.held.kappa;
  if (found.completed)
  {
    settle_and_check(operators, structure, interface, end, equilibrium);
    return equilibrium;
  }
  equilibrium.outcome = failure(operators, interface, found);
  equilibrium.closed.assign(interface.gap.size(), 0);
  equilibrium.reactions.assign(interface.size(), 0.);
  equilibrium.gaps.assign(interface.gap.size(), 0.);
  return equilibrium;
}

} // namespace squeal
