#include "squeal/reduction/reduced_model.hpp"

#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The rows of the active pairs.
Owned<Mat> rows_of(const Interface& interface, const std::vector<int>& active)
{
  PetscInt first = 0, last = 0, first_dof = 0, last_dof = 0;
  check(MatGetOwnershipRange(interface.B, &first, &last));
  check(MatGetOwnershipRangeColumn(interface.B, &first_dof, &last_dof));
  std::vector<PetscInt> mine;
  for (const int pair : active)
    for (int k = 0; k < interface.block(); ++k)
      if (const PetscInt row = pair * interface.block() + k; row >= first && row < last) mine.push_back(row);
  Owned<IS> rows, columns;
  check(ISCreateGeneral(comm_of(interface.B), static_cast<PetscInt>(mine.size()), mine.data(), PETSC_COPY_VALUES,
                        rows.put()));
  check(ISCreateStride(comm_of(interface.B), last_dof - first_dof, first_dof, 1, columns.put()));
  Owned<Mat> result;
  check(MatCreateSubMatrix(interface.B, rows, columns, MAT_INITIAL_MATRIX, result.put()));
  return result;
}

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

/// The followed mode is the first; the others nearest to it in frequency. Real and imaginary parts.
MultiVector mode_columns(const std::vector<ComplexMode>& modes, int count, Mat Z)
{
  const double omega = modes.front().lambda.imag();
  std::vector<const ComplexMode*> taken;
  for (const ComplexMode& mode : modes) taken.push_back(&mode);
  std::sort(taken.begin() + 1, taken.end(),
            [&](const ComplexMode* a, const ComplexMode* b)
            { return std::abs(a->lambda.imag() - omega) < std::abs(b->lambda.imag() - omega); });
  taken.resize(std::min(taken.size(), static_cast<std::size_t>(count)));
  Owned<Vec> y;
  check(MatCreateVecs(Z, y.put(), nullptr));
  const Owned<VecScatter> scatter = to_kept(Z, modes.front().real, y);
  MultiVector columns = empty_multivector(Z);
  for (const ComplexMode* mode : taken)
    for (const Vec part : {mode->real.get(), mode->imaginary.get()})
    {
      check(VecScatterBegin(scatter, part, y, INSERT_VALUES, SCATTER_FORWARD));
      check(VecScatterEnd(scatter, part, y, INSERT_VALUES, SCATTER_FORWARD));
      append(columns, y);
    }
  return columns;
}

/// The rows of a matrix of few, as columns.
MultiVector transposed(Mat B)
{
  MultiVector result = empty_multivector(B);
  Owned<Vec> row, unit;
  check(MatCreateVecs(B, row.put(), unit.put()));
  PetscInt rows = 0;
  check(MatGetSize(B, &rows, nullptr));
  for (PetscInt i = 0; i < rows; ++i)
  {
    check(VecSet(unit, 0));
    if (rank_of(result.comm) == 0) check(VecSetValue(unit, i, 1, INSERT_VALUES));
    check(VecAssemblyBegin(unit));
    check(VecAssemblyEnd(unit));
    check(MatMultTranspose(B, unit, row));
    append(result, row);
  }
  return result;
}

/// Every `step`-th column from the first on.
MultiVector every(const MultiVector& X, int step)
{
  return {X.comm, X.entries(Eigen::all, Eigen::seq(0, Eigen::last, step))};
}

/// What each active pair that slides pushes with, B_n' + mu B_t'e: its normal force and the friction that follows it.
MultiVector sliding_forces(const MultiVector& rows, const Interface& interface, const std::vector<int>& active)
{
  const std::vector<double> e = drive_directions(interface);
  const Index directions = interface.directions, block = 1 + directions;
  MultiVector result = every(rows, interface.block());
  for (Index i = 0; i < result.columns(); ++i)
  {
    const double* direction = &e[static_cast<std::size_t>(active[static_cast<std::size_t>(i)] * directions)];
    result.entries.col(i) += rows.entries.middleCols(i * block + 1, directions) *
                             (interface.friction * VectorXd::Map(direction, directions));
  }
  return result;
}

/// (K_z + w^2 M_z)^-1 forces
MultiVector attachment_columns(Mat A, const MultiVector& forces)
{
  const Factor factor(A, nullptr, Factor::Kind::automatic);
  if (factor.failed()) throw Error("reduced model: K + omega^2 M is not positive definite with the active pairs open");
  Owned<Vec> pattern;
  check(MatCreateVecs(A, pattern.put(), nullptr));
  MultiVector result = empty_multivector(A);
  constexpr Index at_once = 64;
  for (Index begin = 0; begin < forces.columns(); begin += at_once)
  {
    std::vector<Owned<Vec>> force, shape;
    for (Index i = begin; i < std::min(begin + at_once, forces.columns()); ++i)
    {
      force.push_back(zeros_like(pattern));
      shape.push_back(zeros_like(pattern));
      copy_column(forces, i, force.back());
    }
    (void)factor.forward(std::vector<Vec>(force.begin(), force.end()));
    factor.backward({}, std::vector<Vec>(shape.begin(), shape.end()));
    for (const Owned<Vec>& column : shape) append(result, column);
  }
  return result;
}

/// Own rows of A that are not empty, in order.
std::vector<PetscInt> own_rows(Mat A)
{
  PetscInt first = 0;
  std::vector<PetscInt> rows;
  check(MatGetOwnershipRange(A, &first, nullptr));
  for_each_row(A,
               [&](PetscInt row, std::span<const PetscInt>, std::span<const PetscScalar> values)
               {
                 if (std::any_of(values.begin(), values.end(), [](double value) { return value != 0; }))
                   rows.push_back(row - first);
               });
  return rows;
}

MultiVector rows_of(const MultiVector& X, const std::vector<PetscInt>& rows)
{
  return {X.comm, X.entries(rows, Eigen::all)};
}

/// T of X T orthonormal in the product in which E is the Gram matrix of X, as far as it goes.
struct Orthonormal
{
  const MatrixXd& E;
  MatrixXd T;
  Index seen = 0; // columns of X
};

/// Takes in what the next `count` columns of X hold that is new: directions of which less than `threshold` of the
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
  const Eigen::SelfAdjointEigenSolver<MatrixXd> spectrum((fresh + fresh.transpose()) / 2);
  const auto kept = (spectrum.eigenvalues().array() > threshold * threshold).count();
  basis.T.conservativeResize(Eigen::NoChange, basis.T.cols() + kept);
  basis.T.rightCols(kept) = columns * spectrum.eigenvectors().rightCols(kept) *
                            spectrum.eigenvalues().tail(kept).cwiseSqrt().cwiseInverse().asDiagonal();
  basis.seen += count;
  return static_cast<int>(kept);
}

/// M, C and K on X = Z columns, tested by Z and by Y, which is Z but for a few rows.
void project(ReducedModel& model, const Structure& structure, const ClosedContact& contact, const MultiVector& columns,
             const MultiVector& X)
{
  Owned<Mat> difference;
  check(MatDuplicate(contact.Y, MAT_COPY_VALUES, difference.put()));
  check(MatAXPY(difference, -1, contact.Z, DIFFERENT_NONZERO_PATTERN));
  const std::vector<PetscInt> follow = own_rows(difference);
  const MultiVector more = rows_of(product(difference, columns), follow);
  for (const auto& [matrix, unsymmetric, symmetric] :
       {std::tuple{structure.M.get(), &model.M, &model.M_z}, std::tuple{structure.C.get(), &model.C, &model.C_z},
        std::tuple{structure.K.get(), &model.K, &model.K_z}})
  {
    const MultiVector image = product(matrix, X);
    *symmetric = inner_products(X, image);
    *symmetric = (*symmetric + symmetric->transpose()).eval() / 2;
    *unsymmetric = *symmetric + inner_products(more, rows_of(image, follow));
  }
}

/// From the columns X to the basis: the modes, the attachments next to them, all by falling period.
void choose_basis(ReducedModel& model, const MultiVector& X, Index of_modes, double threshold)
{
  const double omega = model.omega;
  const MatrixXd energy = model.K_z + omega * omega * model.M_z;
  Orthonormal basis{energy, MatrixXd(X.columns(), 0)};
  model.modes = extend(basis, 2, 1e-7); // the followed mode is kept whatever else is
  model.modes += extend(basis, of_modes - 2, 1e-6);
  model.attachments = extend(basis, X.columns() - of_modes, threshold);
  // of falling period: u'M u against the energy
  const MatrixXd mass = basis.T.transpose() * (model.M_z * basis.T);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> spectrum((mass + mass.transpose()) / 2);
  const MatrixXd T = basis.T * spectrum.eigenvectors().rowwise().reverse();
  constexpr double fastest = 4; // times omega
  model.slow = (spectrum.eigenvalues().array() * (1 + fastest * fastest) * omega * omega > 1).count();
  for (MatrixXd* A : {&model.M, &model.M_z, &model.C, &model.C_z, &model.K, &model.K_z}) *A = T.transpose() * (*A * T);
  model.H = T.transpose() * model.H;
  model.G = model.G * T;
  model.shapes = combination(X, T);
  model.E_factor.compute(model.K_z + omega * omega * model.M_z);
  model.M_factor.compute(model.M_z);
}

} // namespace

std::vector<int> pairs_that_may_change(const Interface& interface, const Equilibrium& equilibrium,
                                       const ComplexMode& mode, double amplitude)
{
  const auto block = static_cast<std::size_t>(interface.block());
  const std::vector<double> real = relative(interface, mode.real), imaginary = relative(interface, mode.imaginary);
  const std::vector<double> still = relative(interface, equilibrium.u);
  std::vector<int> pairs;
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
  {
    const double gap = interface.gap[i] + still[i * block];
    const bool changes = equilibrium.closed[i]
                             ? equilibrium.reactions[i * block] < amplitude * std::abs(mode.reactions[i])
                             : gap < amplitude * std::hypot(real[i * block], imaginary[i * block]);
    if (changes) pairs.push_back(static_cast<int>(i));
  }
  return pairs;
}

bool slide_throughout(const Interface& interface, const ComplexMode& mode, double amplitude)
{
  const auto block = static_cast<std::size_t>(interface.block()), directions = block - 1;
  const std::vector<double> real = relative(interface, mode.real), imaginary = relative(interface, mode.imaginary);
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
  {
    double drive = 0, moves = 0;
    for (std::size_t k = 0; k < directions; ++k)
    {
      drive = std::hypot(drive, interface.drive[i * directions + k]);
      moves = std::hypot(moves, real[i * block + 1 + k], imaginary[i * block + 1 + k]);
    }
    if (amplitude * std::abs(mode.lambda) * moves >= drive) return false;
  }
  return true;
}

ReducedModel reduce(const SlidingEquilibrium& sliding, const std::vector<ComplexMode>& modes, std::vector<int> active,
                    const Reduction& reduction)
{
  const auto& [structure, interface, equilibrium] = sliding;
  ReducedModel model;
  std::vector<char> stays_closed = equilibrium.closed;
  for (const int pair : active) stays_closed[static_cast<std::size_t>(pair)] = 0;
  const ClosedContact contact = eliminate_closed_pairs(structure, interface, stays_closed);
  const double omega = modes.front().lambda.imag();

  // the modes and the shapes of the pairs' forces, as they come
  Owned<Mat> E = project_symmetric(structure.K, contact.Z), BZ;
  const Owned<Mat> M_z = project_symmetric(structure.M, contact.Z);
  check(MatAXPY(E, omega * omega, M_z, UNKNOWN_NONZERO_PATTERN));
  check(MatSetOption(E, MAT_SYMMETRIC, PETSC_TRUE));
  const Owned<Mat> B = rows_of(interface, active);
  check(MatMatMult(B, contact.Z, MAT_INITIAL_MATRIX, PETSC_DEFAULT, BZ.put()));
  const auto forces = [&](Mat rows)
  { return reduction.sliding ? sliding_forces(transposed(rows), interface, active) : transposed(rows); };
  MultiVector columns = mode_columns(modes, reduction.modes, contact.Z);
  const Index of_modes = columns.columns();
  append(columns, attachment_columns(E, forces(BZ)));
  const MultiVector X = product(contact.Z, columns);

  project(model, structure, contact, columns, X);
  const MultiVector left = product(contact.Y, columns), rows = transposed(B);
  if (const Owned<Mat> turning =
          direction_damping(interface, reduction.sliding ? equilibrium.closed : stays_closed, equilibrium.reactions);
      turning.get())
  {
    const std::vector<PetscInt> turns = own_rows(turning);
    model.C += inner_products(rows_of(left, turns), rows_of(product(turning, X), turns));
  }
  model.H = inner_products(left, forces(B));
  model.G = inner_products(reduction.sliding ? every(rows, interface.block()) : rows, X);

  model.omega = omega;
  choose_basis(model, X, of_modes, reduction.threshold);

  // the active pairs
  const auto block = static_cast<std::size_t>(interface.block()), kept = reduction.sliding ? 1 : block;
  const std::vector<double> still = relative(interface, equilibrium.u);
  for (const int pair : active)
  {
    const auto i = static_cast<std::size_t>(pair);
    model.gap.push_back(equilibrium.closed[i] ? 0 : interface.gap[i] + still[i * block]);
    for (std::size_t k = 0; k < kept; ++k) model.reactions.push_back(equilibrium.reactions[i * block + k]);
    for (std::size_t k = 0; k + 1 < kept; ++k) model.drive.push_back(interface.drive[i * (block - 1) + k]);
  }
  model.active = std::move(active);
  model.directions = reduction.sliding ? 0 : interface.directions;
  model.friction = reduction.sliding ? 0 : interface.friction;
  return model;
}

ReducedState coordinates(const ReducedModel& model, const Structure& structure, Vec du, Vec v)
{
  const Owned<Vec> force = zeros_like(du), momentum = zeros_like(v);
  check(MatMult(structure.M, du, force));
  check(VecScale(force, model.omega * model.omega));
  check(MatMultAdd(structure.K, du, force, force));
  check(MatMult(structure.M, v, momentum));
  const MatrixXd seen = inner_products(model.shapes, columns_of(std::array{force.get(), momentum.get()}));
  return {model.E_factor.solve(seen.col(0)), model.M_factor.solve(seen.col(1))};
}

void add_motion(const ReducedModel& model, double factor, const VectorXd& q, Vec target)
{
  PetscScalar* entries = nullptr;
  check(VecGetArray(target, &entries));
  VectorXd::Map(entries, model.shapes.entries.rows()).noalias() += factor * model.shapes.entries * q;
  check(VecRestoreArray(target, &entries));
}

} // namespace squeal
