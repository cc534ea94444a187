#include "monodromy.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/constants.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/SVD>

namespace squeal
{

void multiply(const Monodromy& monodromy, std::span<const Owned<Vec>> states)
{
  monodromy.flow.apply_tangent(std::vector<Vec>(states.begin(), states.end()));
  if (monodromy.after_product) monodromy.after_product(states.size());
}

FastestMotion fastest_motion(const Flow& flow, const DenseEigenpair& pair,
                             const std::function<Owned<Vec>(const Eigen::VectorXd&)>& state)
{
  Eigen::Index largest = 0;
  pair.right.cwiseAbs().maxCoeff(&largest);
  const Eigen::VectorXcd y = pair.right * (std::conj(pair.right(largest)) / std::abs(pair.right(largest)));
  FastestMotion motion{state(y.real()), {}};
  if (pair.lambda.imag() != 0)
  {
    motion.imaginary = state(y.imag());
    const double a = energy_product(flow, motion.real, motion.real),
                 b = energy_product(flow, motion.imaginary, motion.imaginary),
                 c = energy_product(flow, motion.real, motion.imaginary);
    // |Re(e^{i p} y)|^2 = (a + b)/2 + (a - b)/2 cos 2p - c sin 2p
    const double phase = std::atan2(-c, (a - b) / 2) / 2;
    const Owned<Vec> real = copy_of(motion.real.get());
    check(VecAXPBY(motion.real, -std::sin(phase), std::cos(phase), motion.imaginary));
    check(VecAXPBY(motion.imaginary, std::sin(phase), std::cos(phase), real));
    check(VecScale(motion.imaginary, 1 / energy_norm(flow, motion.real)));
  }
  normalise(flow, motion.real);
  return motion;
}

std::size_t find_shift(const std::vector<DenseEigenpair>& pairs, const Eigen::VectorXd& flow)
{
  std::size_t place = 0;
  double best = -1;
  for (std::size_t i = 0; i < pairs.size(); ++i)
  {
    const double likeness = std::abs(pairs[i].right.dot(flow.normalized())) - 10 * std::abs(pairs[i].lambda - 1.);
    if (i > 0 && likeness <= best) continue;
    best = likeness;
    place = i;
  }
  return place;
}

Crossing crossing_of(std::complex<double> multiplier)
{
  if (multiplier.imag() != 0) return Crossing::neimark_sacker;
  return multiplier.real() < 0 ? Crossing::period_doubling : Crossing::fold;
}

double moved_by_grid(const Multipliers& multipliers, std::complex<double> value)
{
  return value.imag() == 0 && value.real() > 0 ? multipliers.trivial_error : 0;
}

void decide(Multipliers& multipliers, const std::string& missing)
{
  multipliers.complete = missing.empty();
  multipliers.stability = missing.empty() ? Stability::stable : Stability::undecided;
  multipliers.would_decide = missing;
  for (std::size_t i = 0; i < multipliers.values.size(); ++i)
  {
    const std::complex<double> value = multipliers.values[i];
    const double size = std::abs(value), error = multipliers.errors[i];
    if (size - error > 1)
    {
      multipliers.stability = Stability::unstable;
      multipliers.crossing = crossing_of(value);
      multipliers.would_decide.clear();
      return;
    }
    if (multipliers.upper_bound(i) < 1 || multipliers.stability == Stability::undecided) continue;
    multipliers.stability = Stability::undecided;
    multipliers.would_decide =
        format("a multiplier of %.6f with an error of %.1e reaches across 1: a smaller tolerance "
               "or more steps a period would decide",
               size, error);
  }
}

StateBlock block_of(std::span<const Owned<Vec>> states)
{
  std::vector<Vec> u, v;
  for (const Owned<Vec>& state : states)
  {
    u.push_back(displacement(state));
    v.push_back(velocity(state));
  }
  return {columns_of(u), columns_of(v)};
}

std::vector<Owned<Vec>> states_of(const StateBlock& X, Vec pattern)
{
  std::vector<Owned<Vec>> states;
  for (Eigen::Index k = 0; k < X.columns(); ++k)
  {
    states.push_back(zeros_like(pattern));
    copy_column(X.u, k, displacement(states.back()));
    copy_column(X.v, k, velocity(states.back()));
  }
  return states;
}

StateBlock combination(const StateBlock& X, const MatrixXd& a)
{
  return {combination(X.u, a), combination(X.v, a)};
}

void subtract(StateBlock& X, const StateBlock& Y, const MatrixXd& a)
{
  X.u.entries.noalias() -= Y.u.entries * a;
  X.v.entries.noalias() -= Y.v.entries * a;
}

void append(StateBlock& X, const StateBlock& Y)
{
  append(X.u, Y.u);
  append(X.v, Y.v);
}

StateBlock energy_images(const Flow& flow, const StateBlock& X)
{
  return {product(flow.K, X.u), product(flow.M, X.v)};
}

MatrixXd inner_products(const StateBlock& X, const StateBlock& Y)
{
  return inner_products(X.u, Y.u) + inner_products(X.v, Y.v);
}

StateBlock orthonormal(const Flow& flow, StateBlock X, double least)
{
  for (int pass = 0; pass < 2 && X.columns() > 0; ++pass) // the second removes what rounding left
  {
    const MatrixXd gram = inner_products(X, energy_images(flow, X));
    const Eigen::VectorXd scale = gram.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd scaled = scale.asDiagonal() * gram * scale.asDiagonal();
    const auto [values, vectors] = solve_dense_symmetric((scaled + scaled.transpose()) / 2);
    const auto kept = (values.array() > least * least * values.maxCoeff()).count();
    X = combination(X, scale.asDiagonal() * vectors.rightCols(kept) *
                           values.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal());
  }
  return X;
}

namespace
{

/// Displacements with one entry 1 each.
MultiVector unit_displacements(const Flow& flow)
{
  const IndexRange own = own_columns(flow.M);
  MultiVector X{comm_of(flow.M), Eigen::MatrixXd::Zero(own.size(), row_count(flow.M))};
  X.entries.middleCols(own.first, own.size()).diagonal().setOnes();
  return X;
}

/// Orthonormal columns that span the displacements without the offsets held in the period recorded last.
MultiVector displacements_without_held(const Flow& flow)
{
  const MultiVector units = unit_displacements(flow);
  if (!flow.offsets.without_held) return units;
  MultiVector without = units;
  const Owned<Vec> x = vector_of_columns(flow.M);
  for (Eigen::Index k = 0; k < units.columns(); ++k)
  {
    copy_column(units, k, x);
    flow.offsets.without_held(x);
    const Vec part = x;
    without.entries.col(k) = columns_of(std::span(&part, 1)).entries;
  }
  const auto [parts, directions] = solve_dense_symmetric(inner_products(units, without)); // a projector
  return combination(units, directions.rightCols((parts.array() > 0.5).count()));
}

} // namespace

WholeSpace whole_space(const Flow& flow, double period)
{
  constexpr double rounding = 1e-14; // of the largest mass
  const MultiVector U = displacements_without_held(flow);
  const auto [masses, directions] = solve_dense_symmetric(inner_products(U, product(flow.M, U)));
  const Eigen::Index n = masses.size(), with_mass = (masses.array() > rounding * masses.maxCoeff()).count();
  const MultiVector V = with_mass == n ? U : combination(U, directions.rightCols(with_mass));
  const Eigen::Index rows = U.entries.rows();
  StateBlock unit{{U.comm, Eigen::MatrixXd::Zero(rows, n + with_mass)},
                  {U.comm, Eigen::MatrixXd::Zero(rows, n + with_mass)}};
  unit.u.entries.leftCols(n) = U.entries;
  unit.v.entries.rightCols(with_mass) = V.entries;
  WholeSpace space{unit, std::move(unit)};
  space.right.v.entries *= two_pi / period;
  space.left.v.entries *= period / two_pi;
  return space;
}

double fit(Projector& projector)
{
  const Eigen::MatrixXd gram = inner_products(projector.W, projector.V);
  const Eigen::VectorXd sizes = Eigen::JacobiSVD<Eigen::MatrixXd>(gram).singularValues();
  projector.gram.compute(gram);
  return sizes.size() == 0 ? 1 : sizes(0) / std::max(sizes(sizes.size() - 1), 1e-300);
}

Eigen::MatrixXd coefficients(const Projector& projector, const StateBlock& X)
{
  return projector.gram.solve(inner_products(projector.W, X));
}

void deflate(const Projector& projector, StateBlock& X)
{
  if (projector.V.columns() > 0) subtract(X, projector.V, coefficients(projector, X));
}

StateBlock image_of(const Monodromy& monodromy, const StateBlock& X)
{
  const std::vector<Owned<Vec>> states = states_of(X, monodromy.orbit.state);
  multiply(monodromy, states);
  return block_of(states);
}

namespace
{

constexpr Index of_block = 6; // columns
// Few powers of few motions may be bounded where another one grows. The residual of a Ritz value says nothing of what
// the space has not. Four blocks have seen what every motion of a random start becomes in four periods.
constexpr long least_blocks = 4;

/// Whether the images of the space lie in it, so that its pairs are exact.
bool is_invariant(const MatrixXd& remainder, const MatrixXd& along)
{
  constexpr double rounding = 1e-12;
  return remainder.rows() == 0 || remainder.norm() <= rounding * along.norm();
}

/// Sets the largest pair of H. `remainder`: of the last block's image, whose columns are the last ones of H.
void set_pair(const MatrixXd& H, const MatrixXd& remainder, DeflatedSearch& search)
{
  search.pair = solve_dense_unsymmetric(H).front();
  search.residual = (remainder * search.pair.right.tail(remainder.cols())).norm();
  search.bounded = std::abs(search.pair.lambda) + search.residual < 1;
}

} // namespace

DeflatedSearch search_beside(const Monodromy& monodromy, const Deflation& deflation, Index columns)
{
  const Flow& flow = monodromy.flow;
  DeflatedSearch search;
  constexpr double known = 1e-3; // residual that a projection goes on from
  MultiVector velocities = random_multivector(flow.M, of_block), none = velocities;
  none.entries.setZero();
  StateBlock block{std::move(none), std::move(velocities)}; // in which every mode has its part
  deflation(block);
  block = orthonormal(flow, std::move(block), 1e-6);
  search.bounded = block.columns() == 0;
  if (search.bounded) return search;
  search.Q = block;
  MatrixXd H(0, 0);
  for (long blocks = 1;; ++blocks)
  {
    StateBlock image = image_of(monodromy, block);
    search.columns += static_cast<long>(image.columns());
    deflation(image);
    const StateBlock images = energy_images(flow, search.Q);
    MatrixXd along = MatrixXd::Zero(search.Q.columns(), block.columns());
    for (int pass = 0; pass < 2; ++pass)
    {
      const MatrixXd more = inner_products(images, image);
      subtract(image, search.Q, more);
      along += more;
    }
    MatrixXd grown = MatrixXd::Zero(search.Q.columns(), search.Q.columns());
    grown.topLeftCorner(H.rows(), H.cols()) = H;
    grown.rightCols(block.columns()) = along;
    H = std::move(grown);
    block = orthonormal(flow, image, 1e-8);
    const MatrixXd remainder = inner_products(block, energy_images(flow, image));
    set_pair(H, remainder, search);
    const bool ends = search.bounded || search.residual < known;
    if (is_invariant(remainder, along) || (blocks >= least_blocks && ends)) return search;
    if (search.columns + block.columns() > columns) return search;
    // the next block's columns see what this one adds to them
    H.conservativeResizeLike(MatrixXd::Zero(H.rows() + remainder.rows(), H.cols()));
    H.bottomRightCorner(remainder.rows(), remainder.cols()) = remainder;
    append(search.Q, block);
  }
}

} // namespace squeal
