#include "squeal/equilibrium/equilibrium.hpp"
#include "squeal/base/run_control.hpp"

#include "balance.hpp"
#include "load_path.hpp"
#include "squeal/algebra/lent_cores.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/contact/complementarity.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace squeal
{

namespace
{

constexpr int most_splits = 100; // of the status iteration

/// Of every pair: normal r_n + kappa (g - g0), tangential mu r_n e.
std::vector<double> pair_forces(const Interface& interface, const std::vector<double>& reaction,
                                const std::vector<double>& gap, double kappa)
{
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  std::vector<double> forces(interface.size());
  const PairView view(forces, interface.directions);
  for (std::size_t i = 0; i < reaction.size(); ++i)
  {
    view.normal(i) = reaction[i] + kappa * (gap[i] - interface.gap[i]);
    for (std::size_t k = 0; k < e.of(i).size(); ++k) view.tangential(i)[k] = mu[i] * reaction[i] * e.of(i)[k];
  }
  return forces;
}

/// u + K'^-1 (F + B' forces - K' u): the solution of K' u = F + B' forces, and a step of iterative refinement from near
/// it.
void displace(const Held& held, const Structure& structure, const Interface& interface,
              const std::vector<double>& forces, Vec u)
{
  const auto rhs = copy_of(structure.load);
  if (interface.pairs > 0) add_reactions(interface, forces, rhs);
  const auto residual = zeros_like(rhs), correction = zeros_like(rhs);
  check(MatMult(held.augmented ? held.augmented.get() : structure.K.get(), u, residual));
  check(VecAYPX(residual, -1, rhs));
  solve(held.factor, residual, correction);
  check(VecAXPY(u, 1, correction));
}

std::vector<double> gaps_of(const Interface& interface, Vec u)
{
  std::vector<double> gap = interface.gap;
  if (gap.empty()) return gap;
  const std::vector<double> motion = relative(interface, u);
  for (std::size_t i = 0; i < gap.size(); ++i) gap[i] += PairView(motion, interface.directions).normal(i);
  return gap;
}

/// Whether each pair's drive is along its axis, which D was made for: 1, -1 against it, 0 without a drive.
std::vector<double> senses(const Interface& interface, const std::vector<double>& axes)
{
  const TangentView drive(interface.drive, interface.directions);
  const TangentView axis(axes, interface.directions);
  std::vector<double> result;
  for (std::size_t i = 0; i < static_cast<std::size_t>(interface.pairs); ++i)
    result.push_back(drive_speed(interface, i) == 0 ? 0 : std::copysign(1, dot(drive.of(i), axis.of(i))));
  return result;
}

/// `c`: compliances of the pairs. The unknown gap is then g + c r.
ComplementarityProblem problem_of(const Eigen::MatrixXd& D_nn, Eigen::MatrixXd with_friction, double kappa,
                                  const std::vector<double>& q, const Eigen::VectorXd& c)
{
  ComplementarityProblem problem;
  problem.q = q;
  problem.M = std::move(with_friction);
  problem.compliance = std::max(0., D_nn.diagonal().maxCoeff());
  if (kappa > 0)
  {
    problem.N = -kappa * D_nn;
    problem.N.diagonal().array() += 1;
    // rounding of 1 - 1: the pair alone holds its body
    problem.N = (problem.N.array().abs() < 1e-12).select(0, problem.N);
    problem.M += problem.N * c.asDiagonal();
  }
  else
    problem.M += c.asDiagonal();
  if (c.size() > 0) problem.compliance = std::max(problem.compliance, c.maxCoeff());
  return problem;
}

/// Pairs that touch or would without reactions; all of them where contact must hold a body.
std::vector<char> first_split(const ComplementarityProblem& problem, const Interface& interface)
{
  std::vector<char> closed(problem.q.size());
  for (std::size_t i = 0; i < closed.size(); ++i)
    closed[i] = problem.N.size() > 0 || interface.gap[i] <= 0 || problem.q[i] < 0;
  return closed;
}

/// sign c r added to the gaps: of a pair with a compliance c the law holds for g + c r.
std::vector<double> add_compliance(const Interface& interface, double sign, const std::vector<double>& reaction,
                                   std::vector<double> gap)
{
  for (std::size_t i = 0; i < gap.size(); ++i) gap[i] += sign * compliance_of(interface, i) * reaction[i];
  return gap;
}

/// What the search shares between ranks; D and the problem live on rank 0.
struct Search
{
  Eigen::VectorXd own; // diagonal of D_nn with the compliance of the pairs
  ComplementarityProblem problem;
  StatusSolution solution;
};

/// u, and gaps and reactions corrected by what u's own gaps say: the rounding of D drops out. Each pass refines u, too.
void settle(const Held& held, const Structure& structure, const Interface& interface, Search& search,
            Equilibrium& equilibrium, MPI_Comm comm)
{
  auto& [outcome, iterations, closed, gap, reaction, solver] = search.solution; // the solver on rank 0
  for (int pass = 0;; ++pass)
  {
    const std::vector<double> geometric = add_compliance(interface, -1, reaction, gap);
    displace(held, structure, interface, pair_forces(interface, reaction, geometric, held.kappa), equilibrium.u);
    if (pass == 2 || interface.pairs == 0) break;
    std::vector<double> error = add_compliance(interface, 1, reaction, gaps_of(interface, equilibrium.u));
    for (std::size_t i = 0; i < error.size(); ++i) error[i] -= gap[i];
    on_rank_zero_with_lent_cores(comm, static_cast<std::size_t>(interface.pairs),
                                 [&]
                                 {
                                   const auto change = solver->solve(error);
                                   for (std::size_t i = 0; i < error.size(); ++i)
                                   {
                                     gap[i] = std::max(0., gap[i] + change.gap[i]);
                                     reaction[i] = std::max(0., reaction[i] + change.reaction[i]);
                                   }
                                 });
    broadcast(gap, comm);
    broadcast(reaction, comm);
  }
}

/// What rank 0 computes from D and the problem.
struct Checks
{
  double residual = 0;
  Uniqueness uniqueness = Uniqueness::not_checked;
};

Checks check_reactions(const Search& search, const std::vector<double>& gap)
{
  const std::vector<double>& reaction = search.solution.reaction;
  const std::size_t pairs = gap.size();
  Checks checks;
  std::vector<double> rho(pairs, 1 / search.problem.compliance);
  for (std::size_t i = 0; i < pairs; ++i)
    if (const double own = search.own(static_cast<Eigen::Index>(i)); own > 0) rho[i] = 1 / own;
  checks.residual = unilateral_residual(reaction, gap, rho, gap);
  if (search.problem.N.size() > 0) return checks;
  checks.uniqueness = has_one_solution(search.problem) ? Uniqueness::assured : Uniqueness::not_assured;
  return checks;
}

/// Sets the residuals, the outcome and what else is checked of a solution.
void check_solution(const Structure& structure, const Interface& interface, const Search& search,
                    Equilibrium& equilibrium)
{
  const MPI_Comm comm = comm_of(structure.load);
  const bool balanced = balances(structure, interface, equilibrium);
  const auto gap = add_compliance(interface, 1, search.solution.reaction, gaps_of(interface, equilibrium.u));
  Checks checks;
  on_rank_zero_with_lent_cores(comm, static_cast<std::size_t>(interface.pairs),
                               [&] { checks = check_reactions(search, gap); });
  MPI_Bcast(&checks, sizeof checks, MPI_BYTE, 0, comm);
  equilibrium.outcome.residual = checks.residual;
  equilibrium.uniqueness = checks.uniqueness;
  const bool good = checks.residual <= 1e-9 && balanced;
  equilibrium.outcome.kind = good ? OutcomeKind::converged : OutcomeKind::not_converged;
  if (!good) equilibrium.outcome.reason = "the closed set was found, but rounding leaves residuals above 1e-9";
}

/// The outcome of a search that found nothing.
Outcome failure(const StatusSolution& solution, const Interface& interface)
{
  const std::vector<double> mu = drive_friction(interface);
  const double friction = mu.empty() ? 0 : *std::max_element(mu.begin(), mu.end());
  if (solution.outcome == StatusOutcome::impossible)
    return {OutcomeKind::no_equilibrium,
            format("no set of closed pairs balances the load at mu = %g: friction is too large, or the structure tips, "
                   "slides away or lifts off",
                   friction),
            solution.iterations, 1};
  return {
      OutcomeKind::not_converged,
      format("no fitting set of closed pairs was found at mu = %g, and nothing proves that there is none", friction),
      solution.iterations, 1};
}

void share(StatusSolution& solution, std::size_t pairs, MPI_Comm comm)
{
  MPI_Bcast(&solution.outcome, sizeof solution.outcome, MPI_BYTE, 0, comm);
  MPI_Bcast(&solution.iterations, 1, MPI_INT, 0, comm);
  solution.gap.resize(pairs); // empty where none was found
  solution.reaction.resize(pairs);
  broadcast(solution.closed, comm);
  broadcast(solution.gap, comm);
  broadcast(solution.reaction, comm);
}

/// What nothing touches and nothing loads stays where it is, held or free: the modes of a free body need no support.
bool stays_at_rest(const Structure& structure, const Interface& interface)
{
  double load = 0;
  check(VecNorm(structure.load, NORM_INFINITY, &load));
  return interface.pairs == 0 && load == 0;
}

} // namespace

struct Equilibria::Kept
{
  Owned<Mat> K, B;
  std::vector<double> axes; // of each pair, as TangentView reads them
  Held held;
  GapCompliance D;
  struct Unloaded // the displacement without reactions
  {
    Owned<Vec> load{}, u{}; // null until they are known
    std::vector<double> gap{};
  } unloaded{}; // of the last load: points of a sweep mostly have one

  Kept(const Structure& structure, const Interface& interface, const EquilibriumOptions& options)
      : K(shared(structure.K.get())), B(shared(interface.B.get())), axes(sliding_axes(interface)),
        held(hold(structure, along(interface, axes), options.factor)),
        D(gap_compliance(held.factor, interface.pairs, comm_of(structure.load)))
  {
  }

  /// Whether it is that of this model. The same on all ranks.
  bool serves(const Structure& structure, const Interface& interface) const
  {
    constexpr double rounding = 1e-12; // of unit vectors
    if (K.get() != structure.K || B.get() != interface.B) return false;
    const std::vector<double> directions = drive_directions(interface), sense = senses(interface, axes);
    const TangentView<const double> e(directions, interface.directions), axis(axes, interface.directions);
    for (std::size_t i = 0; i < sense.size(); ++i)
      for (std::size_t k = 0; k < e.of(i).size(); ++k)
        if (std::abs(e.of(i)[k] - sense[i] * axis.of(i)[k]) > rounding) return false;
    return true;
  }
};

namespace
{

void displace_without_reactions(Equilibria::Kept& kept, const Structure& structure, const Interface& interface, Vec u)
{
  auto& [load, known, gap] = kept.unloaded;
  PetscBool same = PETSC_FALSE;
  if (load.get()) check(VecEqual(load, structure.load, &same));
  if (!same || gap != interface.gap)
  {
    const std::vector<double> nothing(interface.gap.size(), 0.);
    const Held& held = kept.held;
    check(VecSet(u, 0));
    displace(held, structure, interface, pair_forces(interface, nothing, nothing, held.kappa), u);
    load = copy_of(structure.load);
    known = copy_of(u);
    gap = interface.gap;
    return;
  }
  check(VecCopy(known, u));
}

Equilibrium find_with(Equilibria::Kept& kept, const Structure& structure, const Interface& interface,
                      const std::vector<char>& expected)
{
  const MPI_Comm comm = comm_of(structure.load);
  const auto pairs = static_cast<std::size_t>(interface.pairs);
  const Held& held = kept.held;

  Equilibrium equilibrium;
  equilibrium.u = zeros_like(structure.load);
  equilibrium.directions = interface.directions;
  equilibrium.auxiliary_stiffness = held.kappa;
  displace_without_reactions(kept, structure, interface, equilibrium.u);
  const std::vector<double> q = gaps_of(interface, equilibrium.u);

  Search search;
  search.solution.outcome = StatusOutcome::converged;
  if (pairs > 0)
  {
    const auto& [D_nn, D_nt] = kept.D;
    on_rank_zero_with_lent_cores(
        comm, pairs,
        [&]
        {
          const std::vector<double> mu = drive_friction(interface), sense = senses(interface, kept.axes);
          Eigen::VectorXd friction(D_nn.rows()), c(D_nn.rows());
          for (Eigen::Index i = 0; i < c.size(); ++i)
          {
            const auto pair = static_cast<std::size_t>(i);
            friction(i) = mu[pair] * sense[pair];
            c(i) = compliance_of(interface, pair);
          }
          search.problem = problem_of(D_nn, D_nn + D_nt * friction.asDiagonal(), held.kappa, q, c);
          search.own = D_nn.diagonal() + c;
          const bool near = expected.size() == pairs;
          search.solution =
              solve_by_status(search.problem, near ? expected : first_split(search.problem, interface), most_splits);
        });
    share(search.solution, pairs, comm);
  }

  equilibrium.closed = search.solution.closed;
  if (search.solution.outcome != StatusOutcome::converged)
  {
    equilibrium.outcome = failure(search.solution, interface);
    equilibrium.reactions.assign(interface.size(), 0.);
    equilibrium.gaps.assign(pairs, 0.);
    check(VecSet(equilibrium.u, 0));
    return equilibrium;
  }
  settle(held, structure, interface, search, equilibrium, comm);
  equilibrium.reactions = pair_forces(interface, search.solution.reaction, interface.gap, 0);
  equilibrium.gaps = search.solution.gap;
  check_solution(structure, interface, search, equilibrium);
  equilibrium.outcome.iterations = search.solution.iterations;
  return equilibrium;
}

} // namespace

Equilibria::Equilibria(const EquilibriumOptions& options) : options_(options) {}

Equilibria::~Equilibria() = default;

Equilibrium Equilibria::at(const Structure& structure, const Interface& interface)
{
  Equilibrium equilibrium;
  if (stays_at_rest(structure, interface))
  {
    equilibrium.u = zeros_like(structure.load);
    equilibrium.directions = interface.directions;
    equilibrium.outcome = {OutcomeKind::converged, "", 0, 0};
    return equilibrium;
  }
  if (has_undriven_pairs(interface)) return at_end_of_path(structure, interface);
  if (!kept_ || !kept_->serves(structure, interface))
  {
    kept_.reset(); // before the next is made: both may be large
    kept_ = std::make_unique<Kept>(structure, interface, options_);
    ++factors_;
  }
  equilibrium = find_with(*kept_, structure, interface, expected_);
  if (equilibrium.outcome.kind == OutcomeKind::converged) expected_ = equilibrium.closed;
  return equilibrium;
}

Equilibrium Equilibria::at_end_of_path(const Structure& structure, const Interface& interface)
{
  if (!path_kept_ || path_kept_->K.get() != structure.K || path_kept_->B.get() != interface.B)
  {
    path_kept_.reset(); // before the next is made: both may be large
    path_kept_ = std::make_unique<PathOperators>(path_operators(structure, interface, options_));
    ++factors_;
  }
  return find_by_path(*path_kept_, structure, interface);
}

Equilibrium find_equilibrium(const Structure& structure, const Interface& interface, const EquilibriumOptions& options)
{
  return Equilibria(options).at(structure, interface);
}

} // namespace squeal
