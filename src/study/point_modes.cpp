#include "point_modes.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/modes/real_modes.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Cholesky>
#include <random>

namespace squeal
{

namespace
{

using Eigen::MatrixXcd;

constexpr Index sketched_sides = 32; // random vectors: their mean square is off by 25 % (one standard deviation)
constexpr double basis_band = 1.1;   // of the real modes, over the band
constexpr double widest_band = 64;   // the same, as long as there are fewer than
constexpr std::size_t fewest = 20;   // real modes
constexpr double waiting_share =
    0.02;                       // directions of corrections below this part of the largest wait for the next pass
constexpr Index mixtures = 24;  // of the residuals of a side: more directions than that wait for the next pass
constexpr int most_passes = 20; // corrections of the basis; the first one may need more than 8
constexpr double spurious_mode = 1e-8; // backward error of what is no mode

/// The problem at a point on the basis. `kept`: inner products of the shapes without the pivots. `empty`: orthonormal
/// combinations of shapes that hold nothing but pivots.
struct PointMatrices : ProjectedSliding
{
  MatrixXd kept{}, empty{};
};

/// Those of which less than a trace is of other degrees of freedom, by the inner products without the pivots. What a
/// lift makes of that is rounding: its projection is singular, with any number for an eigenvalue.
MatrixXd empty_part(const MatrixXd& kept)
{
  constexpr double trace = 1e-12; // square of a part of 1e-6: rounding leaves it a relative error of 1e-10
  const MatrixXd shifted = kept - trace * MatrixXd::Identity(kept.rows(), kept.cols());
  if (shifted.llt().info() == Eigen::Success) return MatrixXd(kept.rows(), 0); // as mostly, at a tenth of the work
  const SymmetricEigenpairs parts = solve_dense_symmetric(kept);
  return parts.y.leftCols((parts.lambda.array() < trace).count());
}

PointMatrices matrices_at(const SlidingBasis& basis, const LinearisedPoint& point)
{
  PointMatrices at{project(basis, point)};
  const MultiVector at_pivots{basis.T.comm, basis.T.entries(local_pivots(point.contact), Eigen::all)},
      of_shapes = columns_from(at_pivots, basis.sketched);
  at.kept = MatrixXd::Identity(basis.shapes(), basis.shapes()) - inner_products(of_shapes, of_shapes);
  at.empty = empty_part(at.kept);
  return at;
}

/// Static shapes of forces on eliminated pairs that the basis takes for open.
void attach(ModesBasis& modes, const Interface& interface, const std::vector<int>& eliminated)
{
  std::vector<int> pairs;
  for (const int pair : eliminated)
    if (const auto i = static_cast<std::size_t>(pair); !modes.closed[i] && !modes.attached[i])
    {
      pairs.push_back(pair);
      modes.attached[i] = 1;
    }
  if (pairs.empty()) return;
  const MultiVector forces = dense_columns(transpose_of(rows_of(interface, pairs, RowsTaken::normal)));
  const MultiVector responses = modes.pencil.factor->solve(product(modes.Z_transposed, forces));
  extend(modes.basis, product(modes.contact.Z, responses));
}

/// The two-norms of the parts of vectors that are no pivots.
VectorXd kept_norms(const MatrixXcd& a, const MatrixXd& kept)
{
  return (a.conjugate().cwiseProduct(real_times(kept, a))).colwise().sum().real().cwiseMax(0).cwiseSqrt();
}

MatrixXcd vectors_of(const std::vector<DenseEigenpair>& pairs, Side side)
{
  return vectors_of(pairs, side == Side::right ? &DenseEigenpair::right : &DenseEigenpair::left);
}

/// Pairs of the projected problem, and how exact they are in the full one.
struct SolvedPairs
{
  std::vector<DenseEigenpair> pairs;           // falling growth rate
  std::array<std::vector<double>, 2> errors{}; // backward ones of the vectors, by sides

  double backward_error(std::size_t k) const // NaN of either
  {
    const double right = errors[0][k], left = errors[1][k];
    return left <= right ? right : left;
  }
};

/// Backward errors in the full problem, estimated by the random vectors. Left vectors solve the transposed problem.
std::vector<double> backward_errors(const ModesBasis& modes, const PointMatrices& on_basis,
                                    const std::vector<DenseEigenpair>& pairs, Side side)
{
  if (pairs.empty()) return {};
  const Index tests = modes.basis.sketched, shapes = modes.basis.shapes();
  const auto block = [&](const MatrixXd& A) -> MatrixXd
  {
    if (side == Side::right) return A.topRightCorner(tests, shapes);
    return A.bottomLeftCorner(shapes, tests).transpose();
  };
  const MatrixXcd a = vectors_of(pairs, side);
  const bool lossy = on_basis.K_loss.size() > 0;
  const MatrixXcd M = real_times(block(on_basis.M), a), C = real_times(block(on_basis.C), a),
                  K = real_times(block(on_basis.K), a),
                  L = lossy ? real_times(block(on_basis.K_loss), a) : MatrixXcd::Zero(K.rows(), K.cols());
  const VectorXd sizes = kept_norms(a, on_basis.kept);
  std::vector<double> errors;
  for (Index k = 0; k < a.cols(); ++k)
  {
    const auto& pair = pairs[static_cast<std::size_t>(k)];
    const Complex lambda = pair.lambda, f = loss_factor_of(lambda);
    // the random entries are spread evenly over (-1, 1): their mean square is 1/3
    const double residual = (lambda * (lambda * M.col(k) + C.col(k)) + K.col(k) + f * L.col(k)).norm() *
                            std::sqrt(3. / static_cast<double>(tests));
    errors.push_back(residual / (scale_of(modes, lambda) * sizes(k)));
  }
  return errors;
}

/// Complex weights, alike on every rank: columns mix the rows' vectors at random. As many columns as rows or more would
/// mix nothing: then they are the real and the imaginary part of each.
MatrixXcd random_weights(Index rows, Index columns)
{
  constexpr Complex i{0, 1};
  MatrixXcd weights = MatrixXcd::Zero(rows, std::min(2 * rows, columns));
  if (2 * rows <= columns)
    weights << MatrixXcd::Identity(rows, rows), -i * MatrixXcd::Identity(rows, rows);
  else
  {
    std::mt19937_64 generator(1);
    std::normal_distribution<double> normal;
    for (Index k = 0; k < weights.size(); ++k) weights.data()[k] = {normal(generator), normal(generator)};
  }
  return weights;
}

/// Appends to `residuals` those of some vectors, over their backward error's scale, with zeros at the pivots. Of many,
/// random mixtures of real and imaginary parts span the same leading directions.
void append_residuals(const ModesBasis& modes, const LinearisedPoint& point, const std::vector<DenseEigenpair>& pairs,
                      Side side, MultiVector& residuals)
{
  if (pairs.empty()) return;
  Eigen::VectorXcd lambda(static_cast<Index>(pairs.size()));
  MatrixXcd weights = random_weights(lambda.size(), mixtures);
  for (Index k = 0; k < lambda.size(); ++k)
  {
    lambda(k) = pairs[static_cast<std::size_t>(k)].lambda;
    weights.row(k) /= scale_of(modes, lambda(k));
  }
  const MatrixXcd a = vectors_of(pairs, side);
  const auto y = [&](const MatrixXcd& by)
  { return kept_rows(combination_of_shapes(modes.basis, (a * by).real()), point.contact); };
  append(residuals, with_zero_pivots(dynamic_forces(modes.basis, point, side, {lambda, weights, y}), point.contact));
}

/// The backward error that a pair may have. Near the limit of stability it is a hundredth: of the error of lambda, the
/// product of both sides, that is 1e-4.
double tolerance_of(const DenseEigenpair& pair, const PointProblem& problem)
{
  constexpr double near_limit = 1e-4; // of |lambda|
  const bool near = std::abs(pair.lambda.real()) < near_limit * std::abs(pair.lambda);
  return near ? std::min(problem.tolerance, std::max(exact_tolerance, 0.01 * problem.tolerance)) : problem.tolerance;
}

/// Those pairs whose error of a side exceeds the tolerance.
std::vector<DenseEigenpair> inexact(const SolvedPairs& solved, const PointProblem& problem, Side side)
{
  const std::vector<double>& errors = solved.errors[static_cast<std::size_t>(side)];
  std::vector<DenseEigenpair> chosen;
  for (std::size_t k = 0; k < solved.pairs.size(); ++k)
    if (errors[k] > tolerance_of(solved.pairs[k], problem)) chosen.push_back(solved.pairs[k]);
  return chosen;
}

/// The projected problem on the shapes, which come after the sketched columns; K_loss is empty without loss factors.
/// Shapes that nothing holds get springs as stiff as the structure, so that they vibrate far above any window.
LossyMatrices without_sketch(const PointMatrices& on_basis, Index shapes)
{
  const auto on_shapes = [&](const MatrixXd& A) -> MatrixXd
  { return A.bottomRightCorner(std::min(A.rows(), shapes), std::min(A.cols(), shapes)); };
  LossyMatrices result{on_shapes(on_basis.M), on_shapes(on_basis.C), on_shapes(on_basis.K), on_shapes(on_basis.K_loss)};
  result[2] += result[2].norm() * on_basis.empty * on_basis.empty.transpose();
  return result;
}

/// The pairs of the projected problem in the window, falling growth rate.
SolvedPairs solve_projected(const ModesBasis& modes, const PointMatrices& on_basis, const Window& window)
{
  std::vector<DenseEigenpair> pairs = solve_lossy_shared(
      modes.basis.T.comm, without_sketch(on_basis, modes.basis.shapes()), Vectors::both, std::sqrt(window.limit));
  std::erase_if(pairs, [&](const DenseEigenpair& pair) { return !window.holds(pair.lambda); });
  std::ranges::stable_sort(pairs, std::greater{}, [](const DenseEigenpair& pair) { return pair.lambda.real(); });
  SolvedPairs solved{std::move(pairs)};
  for (const Side side : {Side::right, Side::left})
    solved.errors[static_cast<std::size_t>(side)] = backward_errors(modes, on_basis, solved.pairs, side);
  return solved;
}

/// The result of a point, without what is no mode.
PointModes modes_of(SolvedPairs& solved, const PointProblem& problem, const PointMatrices& on_basis, Index shapes)
{
  PointModes result;
  result.outcome.kind = OutcomeKind::converged;
  int above = 0;
  double largest = 0; // error over its tolerance
  const std::size_t count = solved.pairs.size();
  for (std::size_t k = 0; k < count; ++k)
  {
    const double error = solved.backward_error(k), excess = error / tolerance_of(solved.pairs[k], problem);
    above += !(excess <= 1);
    largest = std::max(largest, excess);
    if (error > std::max(spurious_mode, problem.tolerance)) continue;
    result.outcome.residual = std::max(result.outcome.residual, error);
    result.pairs.push_back(std::move(solved.pairs[k]));
    result.errors.push_back(error);
  }
  if (above > 0)
  {
    result.outcome.kind = OutcomeKind::not_converged;
    result.outcome.reason = format("%d of %zu eigenvalues have backward errors above %.0e, the largest %.0f times its "
                                   "tolerance, after %d corrections",
                                   above, count, problem.tolerance, largest, most_passes);
  }
  result.M = on_basis.M.bottomRightCorner(shapes, shapes);
  result.C = on_basis.C.bottomRightCorner(shapes, shapes);
  return result;
}

} // namespace

double scale_of(const ModesBasis& modes, Complex lambda)
{
  const double w = std::abs(lambda);
  return w * w * modes.norms.M + w * modes.norms.C + modes.norms.K;
}

bool correct(ModesBasis& modes, MultiVector residuals)
{
  if (residuals.columns() == 0 || modes.basis.shapes() >= row_count(modes.K_z)) return false;
  orthonormalise(residuals, waiting_share * waiting_share);
  const MultiVector responses = modes.pencil.factor->solve(product(modes.Z_transposed, residuals));
  ++modes.passes;
  return extend(modes.basis, product(modes.contact.Z, responses)) > 0;
}

bool in_band(const DenseEigenpair& pair, double band)
{
  return std::abs(pair.lambda) < two_pi * band;
}

ModesBasis make_modes_basis(const BasisProblem& problem, const std::vector<char>& closed)
{
  ModesBasis modes{make_basis(problem.structure, problem.interface, sketched_sides)};
  rebase(modes, problem, closed);
  return modes;
}

void rebase(ModesBasis& modes, const BasisProblem& problem, const std::vector<char>& closed)
{
  const Structure& structure = problem.structure;
  set_model(modes.basis, structure, problem.interface);
  modes.closed = closed;
  modes.attached.assign(closed.size(), 0);
  modes.contact = eliminate_closed_pairs(structure, problem.interface, closed);
  modes.M_z = project_symmetric(structure.M, modes.contact.Z);
  const Owned<Mat> springs = contact_stiffness(problem.interface, problem.closed, PairForces::normal);
  const Owned<Mat> K = springs.get() ? sum_of(structure.K, springs) : Owned<Mat>{};
  modes.K_z = project_symmetric(K.get() ? K.get() : structure.K.get(), modes.contact.Z);
  modes.Z_transposed = transpose_of(modes.contact.Z);
  const Owned<Mat> C_z = project_symmetric(modes.basis.C.matrix, modes.contact.Z);
  modes.norms = {norm_of(modes.M_z, NORM_1), norm_of(C_z, NORM_1), norm_of(modes.K_z, NORM_1)};
  RealModes real;
  for (double part = basis_band; real.omega.size() < fewest && part < widest_band; part *= 2)
    real = solve_real_modes_below(modes.M_z, modes.K_z, part * problem.band, problem.options);
  MultiVector shapes = empty_multivector(modes.K_z);
  for (const Owned<Vec>& shape : real.shapes) append(shapes, shape);
  extend(modes.basis, product(modes.contact.Z, shapes));
  modes.pencil = make_shift_invert(modes.K_z, modes.M_z, Keep::factor, problem.options.pencil);
  move_to(modes.pencil, shift_below_zero(modes.M_z, modes.K_z));
}

PointModes find_point_modes(ModesBasis& modes, const PointProblem& problem)
{
  set_model(modes.basis, problem.sliding.structure, problem.sliding.interface);
  const LinearisedPoint point = linearise_point(problem.sliding);
  attach(modes, problem.sliding.interface, point.contact.pairs);
  const double end = two_pi * followed_band * problem.band;
  const Window window{vibration_floor(modes.norms), end * end};
  for (PetscInt pass = 0;; ++pass)
  {
    problem.end_if_asked();
    const PointMatrices on_basis = matrices_at(modes.basis, point);
    SolvedPairs solved = solve_projected(modes, on_basis, window);
    MultiVector residuals{modes.basis.T.comm, MatrixXd(modes.basis.T.entries.rows(), 0)};
    if (pass < most_passes)
      for (const Side side : {Side::right, Side::left})
        append_residuals(modes, point, inexact(solved, problem, side), side, residuals);
    if (correct(modes, std::move(residuals))) continue;
    PointModes result = modes_of(solved, problem, on_basis, modes.basis.shapes());
    result.outcome.iterations = static_cast<int>(pass);
    return result;
  }
}

} // namespace squeal
