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

MatrixXd product(const MatrixXd& A, const MatrixXd& B)
{
  MatrixXd result(A.rows(), B.cols());
  const auto rows = static_cast<PetscBLASInt>(A.rows()), columns = static_cast<PetscBLASInt>(B.cols()),
             inside = static_cast<PetscBLASInt>(A.cols());
  const PetscBLASInt once = 1;
  const double one = 1, zero = 0;
  if (result.size() == 0 || inside == 0) return MatrixXd::Zero(A.rows(), B.cols());
  if (columns == 1)
    BLASgemv_("N", &rows, &inside, &one, A.data(), &rows, B.data(), &once, &zero, result.data(), &once);
  else
    BLASgemm_("N", "N", &rows, &columns, &inside, &one, A.data(), &rows, B.data(), &inside, &zero, result.data(),
              &rows);
  return result;
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
  map.W = product(model.G, map.from_reactions);
  map.G_n = model.G(Eigen::seq(0, Eigen::last, 1 + model.directions), Eigen::all);
  map.W_single = map.W.cast<float>();
  map.W_n = map.W_single(Eigen::seq(0, Eigen::last, 1 + model.directions), Eigen::all);
  map.own.assign(model.active.size(), {});
  const Eigen::Index block = 1 + model.directions;
  for (Eigen::Index row = 0; row < rows; ++row)
    for (Eigen::Index k = 0, first = row - row % block; k < block; ++k)
      map.own[static_cast<std::size_t>(row / block)][static_cast<std::size_t>(row % block)]
             [static_cast<std::size_t>(k)] = (map.W(row, first + k) + map.W(first + k, row)) / 2;
  map.h = h;
}

bool advance(const ReducedMap& map, ReducedState& state, ReducedContact& contact)
{
  const ReducedModel& model = map.model;
  const double h = map.h, theta = map.theta;
  const Eigen::Index n = model.size();
  VectorXd both(2 * n);
  both << state.v, state.q;
  VectorXd next = product(map.from_state, both) + map.from_equilibrium;

  // b of w = W r + b: normal rows are gap rates (g + G_n q~)/h + G_n v, q~ = q + h (1-theta) v, tangential ones s
  VectorXd b = product(model.G, next);
  const VectorXd position = product(map.G_n, state.q + h * (1 - theta) * state.v);
  const auto block = static_cast<std::size_t>(1 + model.directions), directions = block - 1;
  for (std::size_t i = 0; i < model.gap.size(); ++i)
  {
    const auto row = static_cast<Eigen::Index>(i * block);
    b(row) += (model.gap[i] + position(static_cast<Eigen::Index>(i))) / h;
    for (std::size_t k = 0; k < directions; ++k)
      b(row + 1 + static_cast<Eigen::Index>(k)) -= model.drive[i * directions + k];
  }
  const bool converged = solve_contact(map, b, contact);
  next += product(map.from_reactions, contact.r);
  state.q += h * (theta * next + (1 - theta) * state.v);
  state.v = std::move(next);
  return converged;
}

namespace
{

/// N steps from `state` on.
void march(ReducedMap& map, ReducedState& state, ReducedContact& contact,
           const std::function<void(const ReducedState&)>& watch)
{
  for (int i = 0; i < map.steps; ++i)
  {
    if (!advance(map, state, contact)) ++map.unconverged;
    if (watch) watch(state);
  }
}

} // namespace

ReducedState integrate(ReducedMap& map, double period, ReducedState state,
                       const std::function<void(const ReducedState&)>& watch)
{
  prepare(map, period);
  ReducedContact contact{map.reactions};
  march(map, state, contact, watch);
  return state;
}

Passage pass(ReducedMap& map, double period, ReducedState state)
{
  prepare(map, period);
  ReducedContact contact{map.reactions};
  ReducedState last_but_one;
  int done = 0;
  march(map, state, contact,
        [&](const ReducedState& now)
        {
          if (++done == map.steps - 1) last_but_one = now;
        });
  Passage result{state, {}};
  (void)advance(map, state, contact);
  result.rate = {(state.q - last_but_one.q) / (2 * map.h), (state.v - last_but_one.v) / (2 * map.h)};
  return result;
}

Flow flow_of(ReducedMap& map, const Structure& norm)
{
  const auto period_map = [&map](double period, Vec start, Vec end, Vec rate)
  {
    const Passage passage = pass(map, period, {entries_of(displacement(start)), entries_of(velocity(start))});
    put(passage.end.q, displacement(end));
    put(passage.end.v, velocity(end));
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
