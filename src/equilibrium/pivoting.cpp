#include "load_path.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/error.hpp"
#include "squeal/equilibrium/path_walk.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>
#include <Eigen/QR>
#include <numeric>
#include <ranges>

namespace squeal
{

namespace
{

/// The solution of a set of closed pairs, the shortest one where they share a rigid face. It is nothing where a sign is
/// wrong or the pairs do not balance.
std::optional<StickSlipState> solution_of(const StickSlipOperator& of, const VectorXd& q,
                                          const std::vector<char>& closed)
{
  constexpr double rounding = 1e-10; // of the largest unknown: what a grazing pair may lack
  MatrixXd system = of.N;
  for (Index i = 0; i < q.size(); ++i)
    if (closed[static_cast<std::size_t>(i)]) system.col(i) = -of.M.col(i) / of.compliance;
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> orthogonal;
  orthogonal.setThreshold(1e-11);
  const VectorXd x = orthogonal.compute(system).solve(q);
  if (!(x.minCoeff() >= -rounding * x.lpNorm<Eigen::Infinity>()) || !((system * x - q).norm() <= 1e-9 * q.norm()))
    return std::nullopt;
  StickSlipState state{VectorXd::Zero(q.size()), VectorXd::Zero(q.size())};
  for (Index i = 0; i < q.size(); ++i)
    closed[static_cast<std::size_t>(i)] ? state.r[i] = x[i] / of.compliance : state.w[i] = x[i];
  return state;
}

/// Gaps w and reactions, numbered from 0 on; z, the last number, is added to every gap:
///     x = table (y, z, 1),   x, y >= 0,   of each pair one variable on either side.
/// An exchange makes a variable of the right side one of the left.
struct Dictionary
{
  MatrixXd table;
  std::vector<Index> left, right;
};

/// The row whose variable is the first to fall to zero as a column's rises, z before others; -1: none falls.
Index leaving_row(const Dictionary& of, Index column)
{
  constexpr double rounding = 1e-11; // of entries, which are ratios of compliances
  Index best = -1;
  double least = 0;
  for (Index i = 0; i < of.table.rows(); ++i)
  {
    const double slope = of.table(i, column);
    if (slope >= -rounding) continue;
    const double until = of.table(i, of.table.cols() - 1) / -slope;
    const bool is_z = of.left[static_cast<std::size_t>(i)] == 2 * of.table.rows();
    if (best >= 0 && (is_z ? until > least + rounding * least : until >= least)) continue;
    best = i;
    least = until;
  }
  return best;
}

/// Solves the row for the column's variable and returns the one that went right.
Index exchange(Dictionary& of, Index row, Index column)
{
  const double pivot = of.table(row, column);
  of.table.row(row) /= -pivot;
  of.table(row, column) = 1 / pivot;
  const VectorXd entering = of.table.col(column);
  const Eigen::RowVectorXd solved = of.table.row(row);
  of.table += entering * solved;
  of.table.col(column) = entering / pivot;
  of.table.row(row) = solved;
  std::swap(of.left[static_cast<std::size_t>(row)], of.right[static_cast<std::size_t>(column)]);
  return of.right[static_cast<std::size_t>(column)];
}

} // namespace

std::optional<StickSlipState> rest_by_path(const StickSlipOperator& of, const VectorXd& q)
{
  constexpr double softness = 1e-10; // of the compliance: pairs may share a rigid face
  const Index pairs = q.size(), z = 2 * pairs;
  MatrixXd sides(pairs, pairs + 1);
  sides << of.M / of.compliance, q;
  sides.diagonal().array() += softness;
  Dictionary dictionary{MatrixXd::Ones(pairs, pairs + 2), std::vector<Index>(static_cast<std::size_t>(pairs)), {}};
  sides = of.N.partialPivLu().solve(sides);
  dictionary.table.leftCols(pairs) = sides.leftCols(pairs);
  dictionary.table.rightCols(1) = sides.rightCols(1);
  if (!dictionary.table.allFinite()) return std::nullopt;
  std::iota(dictionary.left.begin(), dictionary.left.end(), 0);
  for (const Index gap : dictionary.left) dictionary.right.push_back(pairs + gap);
  dictionary.right.push_back(z);
  Index row = 0;
  if (dictionary.table.rightCols(1).col(0).minCoeff(&row) < 0)
  {
    Index out = exchange(dictionary, row, pairs);
    for (Index exchanges = 20 * pairs + 100; out != z; --exchanges)
    {
      const auto column = std::ranges::find(dictionary.right, (out + pairs) % z) - dictionary.right.begin();
      row = leaving_row(dictionary, column);
      if (row < 0 || exchanges == 0) return std::nullopt;
      out = exchange(dictionary, row, column);
    }
  }
  StickSlipState state{VectorXd::Zero(pairs), VectorXd::Zero(pairs)};
  for (Index i = 0; i < pairs; ++i)
  {
    const Index variable = dictionary.left[static_cast<std::size_t>(i)];
    const double value = dictionary.table(i, pairs + 1);
    variable < pairs ? state.w[variable] = value : state.r[variable - pairs] = value / of.compliance;
  }
  return state;
}

std::optional<StickSlipState> rest_of_few(const StickSlipOperator& of, const VectorXd& q)
{
  const auto pairs = static_cast<std::size_t>(q.size());
  if (!all_sets_are_cheap(static_cast<double>(pairs))) return std::nullopt;
  for (std::size_t set = 0; set < (std::size_t{1} << pairs); ++set)
  {
    std::vector<char> closed(pairs);
    for (std::size_t i = 0; i < pairs; ++i) closed[i] = (set >> i) & 1;
    if (auto found = solution_of(of, q, closed)) return found;
  }
  return std::nullopt;
}

namespace
{

/// Forces that span each pair's cone, columns over its rows. A disc becomes the polygon drawn round it, so that what no
/// sum of them balances, no friction does.
MatrixXd generators(const PathProblem& problem, const StickSlipFriction& friction)
{
  constexpr int sides = 16;
  const int directions = problem.of.directions;
  const PairRows<Index> rows(directions);
  std::vector<VectorXd> columns;
  const auto add = [&](std::size_t pair, double first, double second)
  {
    VectorXd& column = columns.emplace_back(VectorXd::Zero(problem.of.N.rows()));
    const Index normal = rows.normal(static_cast<Index>(pair));
    column[normal] = 1;
    column[normal + 1] = friction.mu[pair] * first;
    if (directions > 1) column[normal + 2] = friction.mu[pair] * second;
  };
  const TangentView<const double> e(friction.e, directions);
  for (std::size_t pair = 0; pair < friction.mu.size(); ++pair)
    if (length(e.of(pair)) > 0)
      add(pair, e.of(pair)[0], directions > 1 ? e.of(pair)[1] : 0);
    else if (directions == 1)
      add(pair, 1, 0), add(pair, -1, 0);
    else
      for (int side = 0; side < sides; ++side)
      {
        const double angle = two_pi * side / sides, corner = 1 / std::cos(two_pi / 2 / sides); // over the radius
        add(pair, corner * std::cos(angle), corner * std::sin(angle));
      }
  MatrixXd result(problem.of.N.rows(), static_cast<Index>(columns.size()));
  for (Index i = 0; i < result.cols(); ++i) result.col(i) = columns[static_cast<std::size_t>(i)];
  return result;
}

/// A x - b at the x >= 0 that makes it smallest (Lawson and Hanson 1974, algorithm NNLS); of no size where `most`
/// exchanges do not find it.
VectorXd least_rest(const MatrixXd& A, const VectorXd& b, Index most)
{
  std::vector<Index> passive;
  VectorXd x = VectorXd::Zero(A.cols()), rest = -b;
  const double enough = 1e-12 * b.norm() * A.colwise().norm().maxCoeff();
  for (Index iteration = 0;; ++iteration)
  {
    VectorXd gain = -A.transpose() * rest;
    for (const Index i : passive) gain[i] = 0;
    Index entering = 0;
    if (!(gain.maxCoeff(&entering) > enough)) return rest;
    if (iteration == most) return {};
    passive.push_back(entering);
    for (bool feasible = false; !feasible && !passive.empty();)
    {
      const VectorXd free = A(Eigen::all, passive).colPivHouseholderQr().solve(b);
      double part = 1;
      for (std::size_t k = 0; k < passive.size(); ++k)
        if (const double to = free[static_cast<Index>(k)], from = x[passive[k]]; to <= 0)
          part = std::min(part, from / (from - to));
      for (std::size_t k = 0; k < passive.size(); ++k)
        x[passive[k]] += part * (free[static_cast<Index>(k)] - x[passive[k]]);
      feasible = part == 1;
      std::erase_if(passive, [&](Index i) { return !(x[i] > 1e-15 * x.maxCoeff()); });
    }
    rest = A * x - b;
  }
}

} // namespace

std::optional<VectorXd> unresisted_motion(const PathProblem& problem, const StickSlipFriction& friction,
                                          const VectorXd& q)
{
  // rows that move without strain, N b = 0: what drives them by the load, kappa b'q, has to be balanced by b'r
  const Eigen::SelfAdjointEigenSolver<MatrixXd> spectrum(problem.of.N);
  const VectorXd stiffness = spectrum.eigenvalues().cwiseAbs();
  const Index free = (stiffness.array() <= 1e-9 * stiffness.maxCoeff()).count();
  if (free == 0) return std::nullopt;
  const MatrixXd rigid = spectrum.eigenvectors().leftCols(free);
  const VectorXd drive = -problem.kappa * (rigid.transpose() * q);
  if (drive.norm() <= 1e-12 * problem.kappa * q.norm()) return std::nullopt;
  const MatrixXd forces = rigid.transpose() * generators(problem, friction);
  const VectorXd rest = least_rest(forces, drive, 3 * forces.cols());
  if (rest.norm() <= 1e-9 * drive.norm()) return std::nullopt;
  return rigid * rest;
}

bool has_no_solution(const StickSlipOperator& of, const VectorXd& q)
{
  constexpr Index most = 300;     // exchanges, beyond which the proof would take longer than the search
  constexpr double surely = 1e-7; // of the right side
  MatrixXd both(q.size(), 2 * q.size());
  both << of.N, -of.M / of.compliance;
  return least_rest(both, q, most).norm() > surely * q.norm();
}

bool has_one_solution(const StickSlipOperator& of)
{
  return of.N.isIdentity(0) && Eigen::LLT<MatrixXd>((of.M + of.M.transpose()) / 2).info() == Eigen::Success;
}

namespace
{

/// Any kappa is exact; one of the size of the structure's own stiffness keeps the digits.
double typical_stiffness(Mat K)
{
  const Owned<Vec> diagonal = vector_of_columns(K);
  check(MatGetDiagonal(K, diagonal));
  const double largest = norm_of(diagonal, NORM_INFINITY);
  return largest > 0 ? largest : 1;
}

/// K with springs kappa across these rows, and its factor.
Factored add_springs(const Structure& structure, const Interface& interface, Mat rows, const FactorOptions& options,
                     Held& held)
{
  check(MatTransposeMatMult(rows, rows, MAT_INITIAL_MATRIX, PETSC_DEFAULT, held.augmented.put()));
  check(MatScale(held.augmented, held.kappa)); // K added to these saves a copy of K
  check(MatAXPY(held.augmented, 1, structure.K, DIFFERENT_NONZERO_PATTERN));
  check(MatSetOption(held.augmented, MAT_SYMMETRIC, PETSC_TRUE));
  return factor_positive(held.augmented, interface, options);
}

[[noreturn]] void throw_loose(const Structure& structure, PetscInt loose)
{
  throw Error("equilibrium: the stiffness is singular: neither supports, springs nor contact hold " +
              describe(structure.names, loose) + "; give it a support or a spring");
}

} // namespace

Held hold(const Structure& structure, const Interface& interface, const FactorOptions& options)
{
  // Springs this soft beside the rest lose the digits of the reactions, which contact would hold.
  constexpr double soft = 1e-10;
  Factored own = factor_positive(structure.K, interface, options);
  Held held;
  if (interface.pairs > 0 && (own.loose || own.resistance < soft))
  {
    own.factor = Factor(); // two of them side by side would be the most that a run ever holds
    held.kappa = typical_stiffness(structure.K);
    std::vector<int> all(static_cast<std::size_t>(interface.pairs));
    std::iota(all.begin(), all.end(), 0);
    Factored with_contact =
        add_springs(structure, interface, rows_of(interface, all, RowsTaken::normal), options, held);
    if (!with_contact.loose && (own.loose || with_contact.resistance > 10 * own.resistance))
    {
      held.factor = std::move(with_contact.factor);
      return held;
    }
    held = {};
    with_contact.factor = Factor();
    if (!own.loose) own = factor_positive(structure.K, interface, options);
    if (own.loose && with_contact.loose)
    {
      own.loose = with_contact.loose;
      own.indefinite = with_contact.indefinite;
    }
  }
  if (own.loose && own.indefinite)
    throw Error("equilibrium: the stiffness is not positive definite: a motion that is largest at " +
                describe(structure.names, *own.loose) +
                " is driven on, not back, and the structure diverges (buckles) from any rest; look for a stiffness of "
                "the wrong sign, or a load beyond the critical one");
  if (own.loose) throw_loose(structure, *own.loose);
  held.factor = std::move(own.factor);
  return held;
}

Held hold_by_all_rows(const Structure& structure, const Interface& interface, const FactorOptions& options)
{
  constexpr double part = 1e-2; // of the structure's stiffness: long chains of bodies lose digits by more
  Held held;
  held.kappa = part * typical_stiffness(structure.K);
  Factored factored = add_springs(structure, interface, interface.B, options, held);
  if (factored.loose) throw_loose(structure, *factored.loose);
  held.factor = std::move(factored.factor);
  return held;
}

bool balances(const Structure& structure, const Interface& interface, Equilibrium& equilibrium)
{
  const Owned<Vec> residual = product(structure.K, equilibrium.u);
  const double stress = norm_of(residual, NORM_2), load = norm_of(structure.load, NORM_2);
  check(VecScale(residual, -1));
  check(VecAXPY(residual, 1, structure.load));
  if (interface.pairs > 0) add_reactions(interface, equilibrium.reactions, residual);
  const double defect = norm_of(residual, NORM_2),
               largest = norm_of(structure.K, NORM_INFINITY) * norm_of(equilibrium.u, NORM_2);
  equilibrium.force_residual = defect == 0 ? 0 : defect / (load > 0 ? load : stress);
  return equilibrium.force_residual <= 1e-9 || defect <= 4 * PETSC_MACHINE_EPSILON * largest;
}

PathOperators path_operators(const Structure& structure, const Interface& interface, const EquilibriumOptions& options)
{
  const bool driven = !has_undriven_pairs(interface);
  PathOperators operators{shared(structure.K.get()),
                          shared(interface.B.get()),
                          driven,
                          driven ? hold(structure, interface, options.factor)
                                 : hold_by_all_rows(structure, interface, options.factor),
                          {}};
  if (interface.pairs == 0) return operators;
  const PairRows<Eigen::Index> rows(interface.directions);
  const Eigen::Index size = rank_of(comm_of(interface.B)) == 0 ? rows.rows_of(interface.pairs) : 0;
  operators.D.resize(driven ? size / rows.per_pair() : size, size);
  const auto set = [&](Eigen::Index row, Eigen::Index column, double value)
  {
    if (!driven)
      operators.D(row, column) = value;
    else if (rows.is_normal(row))
      operators.D(rows.pair_of(row), column) = value;
  };
  operators.held.factor.read_condensed(
      [&](const CondensedStrip& strip)
      {
        for (std::size_t j = strip.first; j < strip.last; ++j)
          for (std::size_t i = j; i < strip.first + strip.height; ++i)
          {
            set(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j), strip.entry(i, j));
            set(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(i), strip.entry(i, j));
          }
      });
  return operators;
}

} // namespace squeal
