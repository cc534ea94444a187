/// The modified theta-method on the reduced model: the scheme of analysis/transient.hpp, in few dense products.
#include "squeal/analysis/reduced.hpp"
#include "squeal/analysis/shooting.hpp"
#include "squeal/contact/local.hpp"

#include <numbers>
#include <petscblaslapack.h>

namespace squeal
{

namespace
{

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The contact law of one pair as the eliminated pairs let it move: W is slightly unsymmetric (their friction), which
/// the shared solvers do not take. Block Gauss-Seidel; the local solves see the symmetric part of W's own blocks, which
/// leaves the fixed point what it is. Residual: the natural map over the largest reaction; a pair far below the
/// tolerance is left alone in that sweep. w: b, and then W r + b.
bool solve_unsymmetric(const ReducedMap& map, VectorXd& w, VectorXd& r)
{
  const ReducedModel& model = map.model;
  const Eigen::Index block = 1 + model.directions, rows = w.size();
  const double friction = model.friction;
  const auto of_pair = [&](const VectorXd& x, Eigen::Index i)
  {
    PairVector own{};
    for (Eigen::Index k = 0; k < block; ++k) own[static_cast<std::size_t>(k)] = x(i + k);
    return own;
  };
  for (Eigen::Index i = 0; i < rows; i += block)
  {
    PairVector first = of_pair(r, i);
    first[0] = std::max(first[0], 0.);
    project_on_disc(first, friction);
    for (Eigen::Index k = 0; k < block; ++k) r(i + k) = first[static_cast<std::size_t>(k)];
  }
  w += map.W * r;
  for (int sweep = 0; sweep < map.contact.max_iterations; ++sweep)
  {
    const double tolerance = map.contact.tolerance * r.cwiseAbs().maxCoeff();
    double worst = 0;
    for (Eigen::Index i = 0; i < rows; i += block)
    {
      const PairBlock& A = map.own[static_cast<std::size_t>(i / block)];
      const PairVector last = of_pair(r, i);
      PairVector q = of_pair(w, i);
      const double defect = natural_map(last, q, friction, 1 / A[0][0], 1 / std::max(A[1][1], A[2][2]));
      worst = std::max(worst, defect);
      if (defect <= 0.01 * tolerance) continue;
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t l = 0; l < 3; ++l) q[k] -= A[k][l] * last[l];
      const PairVector next = solve_pair(A, q, model.directions, friction, last);
      for (Eigen::Index k = 0; k < block; ++k)
      {
        const double change = next[static_cast<std::size_t>(k)] - r(i + k);
        if (change == 0) continue;
        r(i + k) += change;
        w += change * map.W.col(i + k);
      }
    }
    if (worst <= map.contact.tolerance * r.cwiseAbs().maxCoeff()) return true;
  }
  return rows == 0;
}

void put(const VectorXd& values, Vec x)
{
  PetscScalar* entries = nullptr;
  check(VecGetArrayWrite(x, &entries));
  std::copy_n(values.data(), values.size(), entries);
  check(VecRestoreArrayWrite(x, &entries));
}

Owned<Mat> small_matrix(const MatrixXd& values)
{
  Owned<Mat> result;
  const auto n = static_cast<PetscInt>(values.rows());
  check(MatCreateSeqDense(PETSC_COMM_SELF, n, n, nullptr, result.put()));
  double* entries = nullptr;
  check(MatDenseGetArrayWrite(result, &entries));
  std::copy_n(values.data(), values.size(), entries);
  check(MatDenseRestoreArrayWrite(result, &entries));
  return result;
}

} // namespace

VectorXd entries_of(Vec x)
{
  const std::vector<double> values = whole(x);
  return VectorXd::Map(values.data(), static_cast<Eigen::Index>(values.size()));
}

Owned<Vec> small_vector(const VectorXd& values)
{
  Owned<Vec> x;
  check(VecCreateSeq(PETSC_COMM_SELF, static_cast<PetscInt>(values.size()), x.put()));
  put(values, x);
  return x;
}

MatrixXd solve_dense(MatrixXd A, MatrixXd B)
{
  const auto n = static_cast<PetscBLASInt>(A.rows()), columns = static_cast<PetscBLASInt>(B.cols());
  std::vector<PetscBLASInt> pivots(static_cast<std::size_t>(n));
  PetscBLASInt info = 0;
  LAPACKgesv_(&n, &columns, A.data(), &n, pivots.data(), B.data(), &n, &info);
  if (info != 0) throw Error("reduced model: a motion has neither mass nor stiffness");
  return B;
}

void prepare(ReducedMap& map, double period)
{
  const double h = period / map.steps;
  if (h == map.h) return;
  const ReducedModel& model = map.model;
  const double theta = map.theta;
  const Eigen::Index n = model.size(), rows = model.G.rows();
  MatrixXd right(n, 2 * n + rows);
  right << model.M - h * (1 - theta) * model.C - h * h * theta * (1 - theta) * model.K, -h * model.K, h * model.H;
  right = solve_dense(model.M + h * theta * model.C + h * h * theta * theta * model.K, std::move(right));
  map.from_state = right.leftCols(2 * n);
  map.from_reactions = right.rightCols(rows);
  map.from_equilibrium = -map.from_reactions * VectorXd::Map(model.reactions.data(), rows);
  map.W = model.G * map.from_reactions;
  map.own.assign(model.active.size(), {});
  const Eigen::Index block = 1 + model.directions;
  for (Eigen::Index row = 0; row < rows; ++row)
    for (Eigen::Index k = 0, first = row - row % block; k < block; ++k)
      map.own[static_cast<std::size_t>(row / block)][static_cast<std::size_t>(row % block)]
             [static_cast<std::size_t>(k)] = (map.W(row, first + k) + map.W(first + k, row)) / 2;
  map.h = h;
}

bool advance(ReducedMap& map, ReducedState& state, VectorXd& before)
{
  const ReducedModel& model = map.model;
  const double h = map.h, theta = map.theta;
  const Eigen::Index n = model.size(), rows = model.G.rows();
  VectorXd next = map.from_equilibrium;
  next.noalias() += map.from_state.leftCols(n) * state.v;
  next.noalias() += map.from_state.rightCols(n) * state.q;

  // b of w = W r + b: normal rows are gap rates (g + G_n q~)/h + G_n v, q~ = q + h (1-theta) v, tangential ones s
  const VectorXd motion = model.G * next, position = model.G * (state.q + h * (1 - theta) * state.v);
  const auto block = static_cast<std::size_t>(1 + model.directions), directions = block - 1;
  VectorXd b = motion;
  for (std::size_t i = 0; i < model.gap.size(); ++i)
  {
    const auto row = static_cast<Eigen::Index>(i * block);
    b(row) += (model.gap[i] + position(row)) / h;
    for (std::size_t k = 0; k < directions; ++k)
      b(row + 1 + static_cast<Eigen::Index>(k)) -= model.drive[i * directions + k];
  }
  VectorXd r = before.size() == rows ? VectorXd(2 * map.reactions - before) : map.reactions;
  before = map.reactions;
  const bool converged = solve_unsymmetric(map, b, r);
  map.rates = std::move(b);
  next.noalias() += map.from_reactions * r;
  map.reactions = std::move(r);
  state.q += h * (theta * next + (1 - theta) * state.v);
  state.v = std::move(next);
  return converged;
}

ReducedState integrate(ReducedMap& map, double period, ReducedState state,
                       const std::function<void(const ReducedState&)>& watch)
{
  prepare(map, period);
  VectorXd before;
  for (int i = 0; i < map.steps; ++i)
  {
    if (!advance(map, state, before)) ++map.unconverged;
    if (watch) watch(state);
  }
  return state;
}

Passage pass(ReducedMap& map, double period, ReducedState state)
{
  ReducedState last_but_one;
  const VectorXd reactions = map.reactions; // every period from one warm start: a map, not a history
  int done = 0;
  const auto watch = [&](const ReducedState& now)
  {
    if (++done == map.steps - 1) last_but_one = now;
  };
  Passage result{integrate(map, period, std::move(state), watch), {}};
  ReducedState next = result.end;
  VectorXd before;
  (void)advance(map, next, before);
  result.rate = {(next.q - last_but_one.q) / (2 * map.h), (next.v - last_but_one.v) / (2 * map.h)};
  map.reactions = reactions;
  return result;
}

Flow flow_of(ReducedMap& map, const Structure& norm)
{
  const auto period_map = [&map](double period, Vec start, Vec end, Vec rate)
  {
    const Passage passage = pass(map, period, {entries_of(displacement(start)), entries_of(velocity(start))});
    const bool shifted = map.shift.q.size() > 0;
    put(shifted ? VectorXd(passage.end.q + map.shift.q) : passage.end.q, displacement(end));
    put(shifted ? VectorXd(passage.end.v + map.shift.v) : passage.end.v, velocity(end));
    if (!rate) return;
    put(passage.rate.q, displacement(rate));
    put(passage.rate.v, velocity(rate));
  };
  return {period_map, norm.M, norm.K, {}};
}

Structure small_structure(const ReducedModel& model)
{
  Structure structure;
  structure.M = small_matrix(model.M_z);
  structure.C = small_matrix(model.C_z);
  structure.K = small_matrix(model.K_z);
  check(MatCreateVecs(structure.M, structure.load.put(), nullptr));
  check(VecSet(structure.load, 0));
  return structure;
}

std::vector<DenseEigenpair> sliding_modes(const ReducedModel& model, const RealModes& modes)
{
  const auto m = static_cast<Eigen::Index>(modes.shapes.size());
  const auto block = static_cast<std::size_t>(1 + model.directions);
  MatrixXd right(model.size(), m), pushes(model.size(), static_cast<Eigen::Index>(model.active.size()));
  for (Eigen::Index i = 0; i < m; ++i) right.col(i) = entries_of(modes.shapes[static_cast<std::size_t>(i)]);
  Eigen::Index closed = 0;
  for (std::size_t i = 0; i < model.active.size(); ++i)
  {
    if (model.reactions[i * block] <= 0) continue;
    // friction follows the normal reaction as it does at equilibrium
    const VectorXd r = VectorXd::Map(&model.reactions[i * block], static_cast<Eigen::Index>(block));
    pushes.col(closed++) = model.H.middleCols(static_cast<Eigen::Index>(i * block), r.size()) * r / r(0);
  }
  // tested by what those forces do no work on
  MatrixXd left = right;
  if (closed > 0)
  {
    const Eigen::HouseholderQR<MatrixXd> factors(pushes.leftCols(closed));
    const MatrixXd Q = factors.householderQ() * MatrixXd::Identity(model.size(), closed);
    left -= Q * (Q.transpose() * right);
  }
  const auto on_modes = [&](const MatrixXd& X)
  {
    const MatrixXd small = left.transpose() * X * right;
    return std::vector<double>(small.data(), small.data() + small.size());
  };
  return solve_dense_quadratic(static_cast<int>(m), on_modes(model.M), on_modes(model.C), on_modes(model.K));
}

RealModes closed_modes(const ReducedModel& model, double band)
{
  // The null space of the closed pairs' normal rows: the last columns of Q of their transpose.
  const auto block = static_cast<std::size_t>(1 + model.directions);
  std::vector<Eigen::Index> closed;
  for (std::size_t i = 0; i < model.gap.size(); ++i)
    if (model.reactions[i * block] > 0) closed.push_back(static_cast<Eigen::Index>(i * block));
  const Eigen::Index n = model.size();
  MatrixXd N = MatrixXd::Identity(n, n);
  if (!closed.empty())
  {
    const Eigen::ColPivHouseholderQR<MatrixXd> factors(MatrixXd(model.G(closed, Eigen::all).transpose()));
    N = (factors.householderQ() * N).rightCols(n - factors.rank()).eval();
  }
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> spectrum(N.transpose() * model.K_z * N,
                                                                    N.transpose() * model.M_z * N);
  const double limit = 2 * std::numbers::pi * band;
  RealModes modes;
  modes.outcome = {"converged", "", 1, 0};
  for (Eigen::Index i = 0; i < N.cols(); ++i)
  {
    const double square = spectrum.eigenvalues()(i);
    if (square > limit * limit) break;
    modes.omega.push_back(std::sqrt(std::max(0., square)));
    modes.shapes.push_back(small_vector(N * spectrum.eigenvectors().col(i)));
  }
  return modes;
}

} // namespace squeal
