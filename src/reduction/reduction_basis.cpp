#include "reduction_basis.hpp"

#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/base/constants.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;

/// y of du = Z y: Z is the identity on the kept degrees of freedom, found by a row of a single one. (A pivot's row may
/// look the same; du is the same there.)
Owned<VecScatter> to_kept(Mat Z, Vec u, Vec y)
{
  PetscInt own = 0;
  const Owned<Vec> row_of = zeros_like(y);
  for_each_row(Z,
               [&](PetscInt row, std::span<const PetscInt> columns, std::span<const PetscScalar> values)
               {
                 if (columns.size() == 1 && values[0] == 1) check(VecSetValue(row_of, columns[0], row, INSERT_VALUES));
               });
  check(VecAssemblyBegin(row_of));
  check(VecAssemblyEnd(row_of));
  check(VecGetLocalSize(y, &own));
  const PetscScalar* rows = nullptr;
  check(VecGetArrayRead(row_of, &rows));
  std::vector<PetscInt> from(static_cast<std::size_t>(own));
  std::transform(rows, rows + own, from.begin(), [](double row) { return static_cast<PetscInt>(row); });
  check(VecRestoreArrayRead(row_of, &rows));
  Owned<IS> source;
  check(ISCreateGeneral(comm_of(Z), own, from.data(), PETSC_COPY_VALUES, source.put()));
  Owned<VecScatter> scatter;
  check(VecScatterCreate(u, source, y, nullptr, scatter.put()));
  return scatter;
}

/// A column of the modes.
struct ModeShape
{
  double frequency = 0; // [rad/s]
  Vec shape = nullptr;
};

/// The shapes of the real modes above all complex ones.
std::vector<ModeShape> shapes_above(const RealModes* real, const std::vector<ComplexMode>& modes)
{
  std::vector<ModeShape> shapes;
  const double highest = two_pi * highest_frequency(modes);
  for (std::size_t i = 0; real && i < real->shapes.size(); ++i)
    if (real->omega[i] > highest) shapes.push_back({real->omega[i], real->shapes[i]});
  return shapes;
}

/// T of X T orthonormal in the product in which E is the Gram matrix of X, as far as it goes.
struct Orthonormal
{
  const MatrixXd& E;
  MatrixXd T;
  Index seen = 0;      // columns of X
  double smallest = 1; // part of a direction that was new when it came, squared: rounding is larger by its inverse
};

/// Takes in what the next `count` columns of X hold that is new. Directions of which less than `threshold` of the
/// columns' own size is new are dropped. Returns how many came.
int extend(Orthonormal& basis, Index count, double threshold)
{
  if (count == 0) return 0;
  const MatrixXd& E = basis.E;
  MatrixXd columns = MatrixXd::Zero(E.rows(), count), image;
  for (Index j = 0; j < count; ++j)
    columns(basis.seen + j, j) = 1 / std::sqrt(std::max(E(basis.seen + j, basis.seen + j), 1e-300));
  for (int pass = 0; pass < 2; ++pass)
  {
    image.noalias() = E * columns;
    columns -= basis.T * (basis.T.transpose() * image);
  }
  image.noalias() = E * columns;
  const MatrixXd fresh = columns.transpose() * image;
  const auto [sizes, directions] = solve_dense_symmetric((fresh + fresh.transpose()) / 2);
  // a part that is negative, or below what the directions before were rounded by, is nothing new; that bound is far
  // too wide where such a direction came with hardly anything
  constexpr double widest = 1e-9;
  const double of_sums = static_cast<double>(E.rows()) * std::numeric_limits<double>::epsilon();
  const double rounding = std::max(-sizes.minCoeff(), std::min(of_sums / basis.smallest, widest));
  const auto kept = (sizes.array() > std::max(threshold * threshold, rounding)).count();
  if (kept > 0) basis.smallest = std::min(basis.smallest, sizes(sizes.size() - kept));
  basis.T.conservativeResize(Eigen::NoChange, basis.T.cols() + kept);
  basis.T.rightCols(kept) =
      columns * (directions.rightCols(kept) * sizes.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal());
  basis.seen += count;
  return static_cast<int>(kept);
}

} // namespace

double highest_frequency(const std::vector<ComplexMode>& modes)
{
  double highest = 0;
  for (const ComplexMode& mode : modes) highest = std::max(highest, mode.frequency_hz());
  return highest;
}

MultiVector kept_entries(const MultiVector& X, Mat Z, Vec pattern)
{
  Owned<Vec> y;
  check(MatCreateVecs(Z, y.put(), nullptr));
  const Owned<VecScatter> scatter = to_kept(Z, pattern, y);
  const Owned<Vec> x = zeros_like(pattern);
  PetscInt own = 0;
  check(VecGetLocalSize(y, &own));
  MultiVector result{X.comm, MatrixXd(own, X.columns())};
  for (Index j = 0; j < X.columns(); ++j)
  {
    copy_column(X, j, x);
    check(VecScatterBegin(scatter, x, y, INSERT_VALUES, SCATTER_FORWARD));
    check(VecScatterEnd(scatter, x, y, INSERT_VALUES, SCATTER_FORWARD));
    const PetscScalar* entries = nullptr;
    check(VecGetArrayRead(y, &entries));
    result.entries.col(j) = Eigen::VectorXd::Map(entries, own);
    check(VecRestoreArrayRead(y, &entries));
  }
  return result;
}

ModeColumns mode_columns(const std::vector<ComplexMode>& modes, const Reduction& reduction, Mat Z)
{
  const double omega = modes.front().lambda.imag();
  std::vector<const ComplexMode*> taken;
  for (const ComplexMode& mode : modes) taken.push_back(&mode);
  std::sort(taken.begin() + 1, taken.end(),
            [&](const ComplexMode* a, const ComplexMode* b)
            { return std::abs(a->lambda.imag() - omega) < std::abs(b->lambda.imag() - omega); });
  taken.resize(std::min(taken.size(), static_cast<std::size_t>(reduction.modes)));
  std::vector<ModeShape> shapes;
  for (const ComplexMode* mode : taken)
    for (const Vec part : {mode->real.get(), mode->imaginary.get()})
      shapes.push_back({std::abs(mode->lambda.imag()), part});
  for (const ModeShape& shape : shapes_above(reduction.real, modes)) shapes.push_back(shape);
  const auto count = static_cast<std::ptrdiff_t>(std::ceil(reduction.apart * static_cast<double>(shapes.size())));
  if (count > 0)
  {
    std::vector<double> frequencies;
    for (const ModeShape& shape : shapes) frequencies.push_back(shape.frequency);
    std::sort(frequencies.begin(), frequencies.end(), std::greater<>());
    const double limit = frequencies[static_cast<std::size_t>(count) - 1];
    std::stable_partition(shapes.begin() + 2, shapes.end(),
                          [limit](const ModeShape& shape) { return shape.frequency < limit; });
  }
  ModeColumns result{empty_multivector(Z), static_cast<Index>(reduction.more.size()),
                     std::min(count, static_cast<std::ptrdiff_t>(shapes.size()) - 2)};
  for (const Vec shape : reduction.more) shapes.push_back({0, shape});
  Owned<Vec> y;
  check(MatCreateVecs(Z, y.put(), nullptr));
  const Owned<VecScatter> scatter = to_kept(Z, modes.front().real, y);
  for (const ModeShape& mode : shapes)
  {
    check(VecScatterBegin(scatter, mode.shape, y, INSERT_VALUES, SCATTER_FORWARD));
    check(VecScatterEnd(scatter, mode.shape, y, INSERT_VALUES, SCATTER_FORWARD));
    append(result.columns, y);
  }
  return result;
}

Eigen::SparseMatrix<double> sliding_forces(const Interface& interface, const std::vector<int>& active)
{
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  const PairRows<Index> rows(interface.directions);
  const auto count = static_cast<Index>(active.size());
  Eigen::SparseMatrix<double> forces(count * rows.per_pair(), count);
  forces.reserve(Eigen::VectorXi::Constant(count, rows.per_pair()));
  for (Index i = 0; i < count; ++i)
  {
    const auto pair = static_cast<std::size_t>(active[static_cast<std::size_t>(i)]);
    forces.insert(rows.normal(i), i) = 1;
    for (int k = 0; k < interface.directions; ++k)
      forces.insert(rows.tangential(i) + k, i) = mu[pair] * e.of(pair)[static_cast<std::size_t>(k)];
  }
  return forces;
}

MultiVector attachment_columns(Mat A, Mat rows, const Eigen::SparseMatrix<double>& forces, const FactorOptions& options)
{
  const Factor factor(A, nullptr, options);
  if (factor.failed()) throw Error("reduced model: K + omega^2 M is not positive definite with the active pairs open");
  Owned<Vec> pattern, on_rows;
  check(MatCreateVecs(rows, pattern.put(), on_rows.put()));
  MultiVector result = empty_multivector(A);
  constexpr Index at_once = 64;
  for (Index begin = 0; begin < forces.cols(); begin += at_once)
  {
    std::vector<Owned<Vec>> force, shape;
    for (Index i = begin; i < std::min(begin + at_once, forces.cols()); ++i)
    {
      check(VecSet(on_rows, 0));
      for (Eigen::SparseMatrix<double>::InnerIterator entry(forces, i); entry && rank_of(result.comm) == 0; ++entry)
        check(VecSetValue(on_rows, static_cast<PetscInt>(entry.row()), entry.value(), INSERT_VALUES));
      check(VecAssemblyBegin(on_rows));
      check(VecAssemblyEnd(on_rows));
      force.push_back(zeros_like(pattern));
      shape.push_back(zeros_like(pattern));
      check(MatMultTranspose(rows, on_rows, force.back()));
    }
    (void)factor.forward(std::vector<Vec>(force.begin(), force.end()));
    factor.backward({}, std::vector<Vec>(shape.begin(), shape.end()));
    for (const Owned<Vec>& column : shape) append(result, column);
  }
  return result;
}

MatrixXd by_falling_period(const MatrixXd& mass, double omega, Index& slow)
{
  const SymmetricEigenpairs spectrum = solve_dense_symmetric((mass + mass.transpose()) / 2);
  constexpr double fastest = 4; // times omega
  slow = (spectrum.lambda.array() * (1 + fastest * fastest) * omega * omega > 1).count();
  return spectrum.y.rowwise().reverse();
}

void choose_basis(ReducedModel& model, const MatrixXd& energy, Mat M_z, MultiVector& columns, const ModeCounts& counts,
                  double threshold)
{
  const auto [of_modes, more, apart] = counts;
  constexpr double new_shape = 1e-3; // part of further shapes that must be new
  Orthonormal basis{energy, MatrixXd(columns.columns(), 0)};
  model.modes = extend(basis, 2, 1e-7); // the followed mode is kept whatever else is
  model.modes += extend(basis, of_modes - more - apart - 2, 1e-6);
  model.modes += extend(basis, more, new_shape);
  const int before = model.modes;
  const int last = extend(basis, apart, 1e-6);
  model.modes += last;
  model.attachments = extend(basis, columns.columns() - of_modes, threshold);
  combine(columns, basis.T);
  const MatrixXd turn = by_falling_period(symmetric_inner_products(columns, M_z), model.omega, model.slow);
  model.apart = turn.middleRows(before, last).transpose();
  combine(columns, turn);
}

} // namespace squeal
