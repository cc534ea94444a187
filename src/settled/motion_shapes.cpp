#include "squeal/settled/motion_shapes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Eigenvalues>

namespace squeal
{

namespace
{

constexpr double sampling_hz = 96e3;
constexpr double missed = 2e-3; // part of the largest velocity, in the norm of M
constexpr double spared = 1e-6; // part of the kinetic energy

/// V'x
Eigen::VectorXd on_shapes(const MotionShapes& motion, Vec x)
{
  return inner_products(motion.V, columns_of(std::array{x}));
}

/// r -= V a
void subtract(const MotionShapes& motion, const Eigen::VectorXd& a, Vec r)
{
  const Owned<Vec> sum = zeros_like(r);
  copy_column(combination(motion.V, a), 0, sum);
  check(VecAXPY(r, -1, sum));
}

/// What V misses of v becomes a shape of its own. Nothing where it has no mass.
void add_shape(MotionShapes& motion, Mat M, Vec v, Vec Mv)
{
  const Owned<Vec> rest = copy_of(v), image = copy_of(Mv);
  double square = 0;
  for (int pass = 0; pass < 2; ++pass) // the second takes out what rounding left
  {
    if (motion.V.columns() > 0) subtract(motion, on_shapes(motion, image), rest);
    check(MatMult(M, rest, image));
    check(VecDot(rest, image, &square));
  }
  if (!(square > 0)) return;
  check(VecScale(rest, 1 / std::sqrt(square)));
  append(motion.V, rest);
  motion.coordinates.emplace_back(motion.squares.size(), 0.);
}

} // namespace

MotionShapes no_shapes(Mat M)
{
  return {empty_multivector(M), {}, {}, 0, 0};
}

int steps_between_samples(int steps, double step_size)
{
  int best = 1;
  for (int every = 2; every <= steps; ++every)
    if (steps % every == 0 && every * step_size * sampling_hz <= 1) best = every;
  return best;
}

void add_sample(MotionShapes& motion, Mat M, Vec v, Vec Mv, PetscInt most)
{
  double square = 0;
  check(VecDot(v, Mv, &square));
  motion.largest = std::max(motion.largest, square);
  Eigen::VectorXd q(0);
  if (motion.V.columns() > 0) q = on_shapes(motion, Mv);
  if (square - q.squaredNorm() > missed * missed * motion.largest && motion.V.columns() < most)
  {
    add_shape(motion, M, v, Mv);
    if (motion.V.columns() > 0) q = on_shapes(motion, Mv);
  }
  motion.squares.push_back(square);
  for (Eigen::Index i = 0; i < q.size(); ++i) motion.coordinates[static_cast<std::size_t>(i)].push_back(q(i));
}

void keep_strongest(MotionShapes& motion, std::size_t first)
{
  const auto count = static_cast<Eigen::Index>(motion.squares.size()), shapes = motion.V.columns();
  if (shapes == 0 || count == 0) return;
  Eigen::MatrixXd q(shapes, count);
  for (Eigen::Index i = 0; i < shapes; ++i)
    q.row(i) = Eigen::Map<const Eigen::RowVectorXd>(motion.coordinates[static_cast<std::size_t>(i)].data(), count);
  const auto seen = q.rightCols(count - static_cast<Eigen::Index>(first));
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(seen * seen.transpose()); // ascending
  double total = 0;
  for (std::size_t i = first; i < motion.squares.size(); ++i) total += motion.squares[i];
  Eigen::Index dropped = 0;
  for (double sum = 0; dropped < shapes - 1; ++dropped)
    if ((sum += axes.eigenvalues()(dropped)) > spared * total) break;
  const Eigen::MatrixXd kept = axes.eigenvectors().rightCols(shapes - dropped).rowwise().reverse();
  combine(motion.V, kept);
  q = (kept.transpose() * q).eval();
  motion.coordinates.clear();
  for (Eigen::Index i = 0; i < q.rows(); ++i) motion.coordinates.emplace_back(q.row(i).begin(), q.row(i).end());
  const double held = q.rightCols(count - static_cast<Eigen::Index>(first)).squaredNorm();
  motion.left_out = total > 0 ? std::max(0., 1 - held / total) : 0;
}

} // namespace squeal
