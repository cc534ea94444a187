#include "squeal/base/constants.hpp"
#include "squeal/equilibrium/path_walk.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

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

} // namespace squeal
