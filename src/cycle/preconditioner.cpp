#include "preconditioner.hpp"

#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/algebra/multivector.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/modes/quadratic.hpp"

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

/// The sliding modes on the span of the real ones.
struct SlidingModes
{
  MultiVector shapes;          // Phi
  std::vector<Complex> lambda; // [1/s] Im >= 0
  std::size_t followed = 0;    // the one that grows most
  MatrixXd right, left;        // columns Re and Im of (y, lambda y); the inverse
  int steps = 0;
  double theta = 0.5;
};

/// mu e.B_t Phi, a column for each mode.
MatrixXd friction_of(const Interface& interface, const std::vector<Owned<Vec>>& shapes)
{
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  MatrixXd result = MatrixXd::Zero(interface.pairs, static_cast<Eigen::Index>(shapes.size()));
  for (Eigen::Index j = 0; j < result.cols(); ++j)
  {
    const std::vector<double> motion = relative(interface, shapes[static_cast<std::size_t>(j)]);
    for (std::size_t i = 0; i < mu.size(); ++i)
      result(static_cast<Eigen::Index>(i), j) =
          mu[i] * dot(e.of(i), PairView(motion, interface.directions).tangential(i));
  }
  return result;
}

/// Xc
MatrixXd on_modes(const std::vector<Owned<Vec>>& shapes, const MatrixXd& friction, const ClosedContact& contact, Mat X)
{
  const auto n = static_cast<Eigen::Index>(shapes.size());
  MatrixXd result(n, n);
  const std::vector<Vec> all(shapes.begin(), shapes.end());
  const Owned<Vec> force = zeros_like(shapes[0]);
  Owned<Vec> reactions;
  check(MatCreateVecs(contact.reaction, nullptr, reactions.put()));
  for (Eigen::Index j = 0; j < n; ++j)
  {
    check(MatMult(X, shapes[static_cast<std::size_t>(j)], force));
    check(VecMDot(force, static_cast<PetscInt>(n), all.data(), result.col(j).data()));
    check(MatMult(contact.reaction, force, reactions));
    const std::vector<double> lambda = all_entries(reactions);
    result.col(j) -= friction.transpose() * VectorXd::Map(lambda.data(), static_cast<Eigen::Index>(lambda.size()));
  }
  return result;
}

/// The columns Re and Im of (y, lambda y) of every pair; the real vector alone of a real one.
MatrixXd real_columns(const std::vector<DenseEigenpair>& pairs, Eigen::Index size)
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
SlidingModes make_sliding_modes(const std::vector<DenseEigenpair>& sliding, const std::vector<Owned<Vec>>& shapes,
                                const CycleSettings& settings)
{
  const auto size = static_cast<Eigen::Index>(shapes.size());
  const std::vector<Vec> all(shapes.begin(), shapes.end());
  SlidingModes modes{columns_of(all), {}, 0, real_columns(sliding, size), {}, settings.steps_per_period,
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

} // namespace

Preconditioner sliding_preconditioner(const CycleProblem& problem, const RealModes& modes)
{
  if (modes.shapes.empty()) return {};
  const Structure& structure = problem.sliding.structure;
  const MatrixXd friction = friction_of(problem.sliding.interface, modes.shapes);
  const auto on_shapes = [&](Mat X) { return on_modes(modes.shapes, friction, problem.linearised.contact, X); };
  const std::vector<DenseEigenpair> sliding = solve_dense_quadratic_shared(
      comm_of(structure.load), on_shapes(structure.M), on_shapes(problem.linearised.C),
      on_shapes(problem.linearised.K.get() ? problem.linearised.K.get() : structure.K.get()));
  SlidingModes inside = make_sliding_modes(sliding, modes.shapes, problem.settings);
  return [inside = std::move(inside), M = structure.M.get()](double period, Vec x, Vec y)
  { apply_inverse(inside, M, period, x, y); };
}

Preconditioner estimated_preconditioner(const CycleProblem& problem, double band_factor)
{
  if (!(band_factor > 0)) return {};
  const double band = band_factor * problem.unstable.modes.front().frequency_hz();
  return sliding_preconditioner(problem, find_real_modes_below(problem.linearised, band, problem.modes_options));
}

} // namespace squeal
