#include "preconditioner.hpp"

#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/algebra/multivector.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/modes/quadratic.hpp"
#include "squeal/reduction/reduced_model.hpp"

#include <array>
#include <cmath>
#include <Eigen/Dense>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The sliding modes on the span of Phi.
struct SlidingModes
{
  MultiVector shapes;          // Phi
  std::vector<Complex> lambda; // [1/s] Im >= 0
  std::size_t followed = 0;    // the one that grows most
  MatrixXd right, left;        // columns Re and Im of (y, lambda y); the inverse
  int steps = 0;
  double theta = 0.5;
};

/// mu e.B_t Phi
MatrixXd friction_of(const Interface& interface, const MultiVector& shapes)
{
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  const MatrixXd motions = whole_product(interface.B, shapes);
  MatrixXd result = MatrixXd::Zero(interface.pairs, shapes.columns());
  for (Eigen::Index j = 0; j < result.cols(); ++j)
  {
    const std::span<const double> column(motions.col(j).data(), static_cast<std::size_t>(motions.rows()));
    const PairView<const double> motion(column, interface.directions);
    for (std::size_t i = 0; i < mu.size(); ++i)
      result(static_cast<Eigen::Index>(i), j) = mu[i] * dot(e.of(i), motion.tangential(i));
  }
  return result;
}

/// Xc
MatrixXd on_shapes(const MultiVector& shapes, const MatrixXd& friction, const ClosedContact& contact, Mat X)
{
  const MultiVector forces = product(X, shapes);
  return inner_products(shapes, forces) - friction.transpose() * whole_product(contact.reaction, forces);
}

/// The columns Re and Im of (y, lambda y) of every pair; the real vector alone of a real one.
MatrixXd state_columns(const std::vector<DenseEigenpair>& pairs, Eigen::Index size)
{
  MatrixXd result(2 * size, 2 * size);
  Eigen::Index column = 0;
  for (const DenseEigenpair& pair : pairs)
  {
    const bool complex = pair.lambda.imag() > 0;
    if (column + (complex ? 2 : 1) > result.cols()) throw Error("cycle: the preconditioner has too many sliding modes");
    Eigen::VectorXcd both(2 * size);
    both << pair.y, pair.lambda * pair.y;
    result.col(column++) = both.real();
    if (complex) result.col(column++) = both.imag();
  }
  if (column != result.cols()) throw Error("cycle: sliding modes are missing from the preconditioner");
  return result;
}

/// 1/(m - 1) + 1 of an eigenvalue; zero where m is 1 (a motion of a free body, or a resonance without damping).
Complex correction(const SlidingModes& modes, std::size_t index, double period)
{
  Complex lambda = modes.lambda[index];
  if (lambda.real() > 0) lambda = {-3 * lambda.real(), index == modes.followed ? two_pi / period : lambda.imag()};
  const double h = period / modes.steps, theta = modes.theta;
  const Complex m = std::pow((1. + (1 - theta) * h * lambda) / (1. - theta * h * lambda), modes.steps);
  return std::abs(m - 1.) < 1e-4 ? 0 : 1. / (m - 1.) + 1.;
}

/// D z of coordinates z = E^+ x.
VectorXd corrected(const SlidingModes& modes, double period, const VectorXd& z)
{
  VectorXd along = modes.left * z;
  Eigen::Index at = 0;
  for (std::size_t k = 0; k < modes.lambda.size(); ++k)
  {
    const Complex D = correction(modes, k, period);
    if (modes.lambda[k].imag() > 0)
    {
      const Complex turned = D * Complex(along[at], -along[at + 1]);
      along[at++] = turned.real();
      along[at++] = -turned.imag();
    }
    else
      along[at++] *= D.real();
  }
  return modes.right * along;
}

/// From sliding modes y in the coordinates of M-orthonormal shapes, all of them.
SlidingModes make_sliding_modes(const std::vector<DenseEigenpair>& sliding, MultiVector shapes,
                                const CycleSettings& settings)
{
  const Eigen::Index size = shapes.columns();
  SlidingModes modes{std::move(shapes), {}, 0, state_columns(sliding, size), {}, settings.steps_per_period,
                     settings.theta};
  for (const DenseEigenpair& pair : sliding)
  {
    modes.lambda.push_back(pair.lambda);
    if (pair.lambda.real() > modes.lambda[modes.followed].real()) modes.followed = modes.lambda.size() - 1;
  }
  modes.left = solve_dense(modes.right, MatrixXd::Identity(2 * size, 2 * size),
                           "cycle: the sliding modes of the preconditioner depend on each other");
  return modes;
}

/// y = -x + E D E^+ x with E^+ = Phi'M.
void apply_inverse(const SlidingModes& modes, Mat M, double period, Vec x, Vec y)
{
  MultiVector sum = columns_of(std::array{displacement(x), velocity(x)});
  const MatrixXd seen = inner_products(modes.shapes, product(M, sum));
  const VectorXd turned = corrected(modes, period, seen.reshaped());
  sum.entries = modes.shapes.entries * turned.reshaped(seen.rows(), 2) - sum.entries;
  copy_column(sum, 0, displacement(y));
  copy_column(sum, 1, velocity(y));
}

/// Phi: M-orthonormal, of the modes' shapes below the band [Hz], and of real modes' where those end far below it.
MultiVector shapes_below(const CycleProblem& problem, double band)
{
  // Friction and damping turn most modes by less than this part of them: what is left of those is nearly real. Two that
  // have locked in share a complex shape, and both its parts stay.
  constexpr double least = 1e-2;
  const Mat M = problem.sliding.structure.M;
  MultiVector shapes = empty_multivector(M);
  for (const ComplexMode& mode : problem.modes)
    if (mode.frequency_hz() < band && mode.growth_rate() > -std::abs(mode.lambda.imag())) // others last no period
    {
      MultiVector parts = columns_of(std::array{mode.real.get(), mode.imaginary.get()});
      parts.entries /= std::sqrt(inner_products(parts, product(M, parts)).trace());
      append(shapes, parts);
    }
  const RealModes beyond = real_modes_beyond(problem, band);
  if (!beyond.shapes.empty())
    append(shapes, columns_of(std::vector<Vec>(beyond.shapes.begin(), beyond.shapes.end()))); // |x|_M = 1
  if (shapes.columns() == 0) return shapes;
  const auto [sizes, directions] = solve_dense_symmetric(inner_products(shapes, product(M, shapes)));
  const Eigen::Index kept = (sizes.array() > least * least * sizes.maxCoeff()).count();
  return combination(shapes, directions.rightCols(kept) * sizes.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal());
}

} // namespace

RealModes real_modes_beyond(const CycleProblem& problem, double highest)
{
  constexpr double far = 0.9;
  const double end = highest_frequency(problem.modes);
  if (end >= far * highest) return {};
  return find_real_modes_between(problem.linearised, end, highest, problem.modes_options);
}

Preconditioner estimated_preconditioner(const CycleProblem& problem, double band_factor)
{
  if (!(band_factor > 0)) return {};
  MultiVector shapes = shapes_below(problem, band_factor * problem.unstable.modes.front().frequency_hz());
  if (shapes.columns() == 0) return {};
  const auto& [structure, interface, equilibrium] = problem.sliding;
  const LinearisedSliding& linearised = problem.linearised;
  const MatrixXd friction = friction_of(interface, shapes);
  const auto seen = [&](Mat X) { return on_shapes(shapes, friction, linearised.contact, X); };
  const Mat K = linearised.K.get() ? linearised.K.get() : structure.K.get();
  const std::vector<DenseEigenpair> sliding =
      solve_dense_quadratic_shared(shapes.comm, seen(structure.M), seen(linearised.C), seen(K));
  SlidingModes inside = make_sliding_modes(sliding, std::move(shapes), problem.settings);
  return [inside = std::move(inside), M = structure.M.get()](double period, Vec x, Vec y)
  { apply_inverse(inside, M, period, x, y); };
}

} // namespace squeal
