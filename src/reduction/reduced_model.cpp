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
  const double highest = 2 * std::numbers::pi * highest_frequency(modes);
  for (std::size_t i = 0; real && i < real->shapes.size(); ++i)
    if (real->omega[i] > highest) shapes.push_back({real->omega[i], real->shapes[i]});
  return shapes;
}

/// Shapes of modes, and how many of them come after the attachments.
struct ModeColumns
{
  MultiVector columns;
  Index apart = 0;
};

/// The followed mode is the first; the others nearest to it in frequency. Real and imaginary parts. Then real modes.
/// Those kept apart are the last ones.
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
  ModeColumns result{empty_multivector(Z), std::min(count, static_cast<std::ptrdiff_t>(shapes.size()) - 2)};
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

/// What each active pair that slides pushes with, B_n' + mu B_t'e: its normal force and the friction that follows it.
/// `rows`: those of B of the active pairs, as columns.
MultiVector sliding_forces(const MultiVector& rows, const Interface& interface, const std::vector<int>& active)
{
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  const PairRows<Index> columns(interface.directions);
  MultiVector result{rows.comm, MatrixXd(rows.entries.rows(), static_cast<Index>(active.size()))};
  for (Index i = 0; i < result.columns(); ++i)
  {
    const auto pair = static_cast<std::size_t>(active[static_cast<std::size_t>(i)]);
    const Eigen::Map<const VectorXd> direction(e.of(pair).data(), interface.directions);
    result.entries.col(i) =
        rows.entries.col(columns.normal(i)) +
        rows.entries.middleCols(columns.tangential(i), interface.directions) * (mu[pair] * direction);
  }
  return result;
}

/// (K_z + w^2 M_z)^-1 forces
MultiVector attachment_columns(Mat A, const MultiVector& forces, const FactorOptions& options)
{
  const Factor factor(A, nullptr, options);
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
    *symmetric = symmetric_inner_products(X, image);
    *unsymmetric = *symmetric + inner_products(more, rows_of(image, follow));
  }
}

/// The symmetric X'AX.
MatrixXd gram_matrix(Mat A, const MultiVector& X)
{
  return symmetric_inner_products(X, product(A, X));
}

/// Orthonormal combinations of shapes that are orthonormal in the energy, by falling period: u'M u against the energy.
/// `mass`: of the shapes.
MatrixXd by_falling_period(const MatrixXd& mass, double omega, Index& slow)
{
  const Eigen::SelfAdjointEigenSolver<MatrixXd> spectrum((mass + mass.transpose()) / 2);
  constexpr double fastest = 4; // times omega
  slow = (spectrum.eigenvalues().array() * (1 + fastest * fastest) * omega * omega > 1).count();
  return spectrum.eigenvectors().rowwise().reverse();
}

/// Replaces the columns by the basis: the modes, the attachments next to them, all by falling period. `E`: K_z +
/// omega^2 M_z; of the modes' columns the last ones are kept apart.
void choose_basis(ReducedModel& model, Mat E, Mat M_z, MultiVector& columns, std::pair<Index, Index> of_modes_and_apart,
                  double threshold)
{
  const auto [of_modes, apart] = of_modes_and_apart;
  const MatrixXd energy = gram_matrix(E, columns);
  Orthonormal basis{energy, MatrixXd(columns.columns(), 0)};
  model.modes = extend(basis, 2, 1e-7); // the followed mode is kept whatever else is
  model.modes += extend(basis, of_modes - apart - 2, 1e-6);
  const int before = model.modes;
  const int last = extend(basis, apart, 1e-6);
  model.modes += last;
  model.attachments = extend(basis, columns.columns() - of_modes, threshold);
  const MatrixXd mass = basis.T.transpose() * (gram_matrix(M_z, columns) * basis.T);
  const MatrixXd turn = by_falling_period(mass, model.omega, model.slow);
  model.apart = turn.middleRows(before, last).transpose();
  columns = combination(columns, basis.T * turn);
}

} // namespace

double highest_frequency(const std::vector<ComplexMode>& modes)
{
  double highest = 0;
  for (const ComplexMode& mode : modes) highest = std::max(highest, mode.frequency_hz());
  return highest;
}

std::vector<int> pairs_that_may_change(const Interface& interface, const Equilibrium& equilibrium,
                                       const ComplexMode& mode, double amplitude)
{
  const std::vector<double> real = relative(interface, mode.real), imaginary = relative(interface, mode.imaginary);
  const std::vector<double> still = relative(interface, equilibrium.u);
  const auto normal = [&](const std::vector<double>& x, std::size_t pair)
  { return PairView(x, interface.directions).normal(pair); };
  std::vector<int> pairs;
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
  {
    const double gap = interface.gap[i] + normal(still, i);
    const bool changes = equilibrium.closed[i]
                             ? normal(equilibrium.reactions, i) < amplitude * std::abs(mode.reactions[i])
                             : gap < amplitude * std::hypot(normal(real, i), normal(imaginary, i));
    if (changes) pairs.push_back(static_cast<int>(i));
  }
  return pairs;
}

bool slide_throughout(const Interface& interface, const ComplexMode& mode, double amplitude)
{
  const std::vector<double> real = relative(interface, mode.real), imaginary = relative(interface, mode.imaginary);
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
  {
    const double moves = std::hypot(length(PairView(real, interface.directions).tangential(i)),
                                    length(PairView(imaginary, interface.directions).tangential(i)));
    if (amplitude * std::abs(mode.lambda) * moves >= drive_speed(interface, i)) return false;
  }
  return true;
}

namespace
{

/// Law, gaps, reactions and drive of the active pairs; normal ones alone if they slide along the drive throughout.
void set_active_pairs(ReducedModel& model, const Interface& interface, const Equilibrium& equilibrium,
                      const Reduction& reduction)
{
  const std::vector<double> motion = relative(interface, equilibrium.u);
  const PairView still(motion, interface.directions), reactions(equilibrium.reactions, interface.directions);
  const TangentView drive(interface.drive, interface.directions);
  model.directions = reduction.sliding ? 0 : interface.directions;
  if (!reduction.sliding) model.friction = interface.friction;
  for (const int pair : model.active)
  {
    const auto i = static_cast<std::size_t>(pair);
    model.gap.push_back(equilibrium.closed[i] ? 0 : interface.gap[i] + still.normal(i));
    model.reactions.push_back(reactions.normal(i));
    if (reduction.sliding) continue;
    for (const double friction : reactions.tangential(i)) model.reactions.push_back(friction);
    for (const double velocity : drive.of(i)) model.drive.push_back(velocity);
  }
}

} // namespace

ReducedModel reduce(const SlidingEquilibrium& sliding, const std::vector<ComplexMode>& modes, std::vector<int> active,
                    const Reduction& reduction)
{
  PairRoles roles{std::move(active), sliding.equilibrium.closed, sliding.equilibrium.reactions};
  for (const int pair : roles.active) roles.sliding[static_cast<std::size_t>(pair)] = 0;
  return reduce(sliding, modes, roles, reduction);
}

ReducedModel reduce(const SlidingEquilibrium& sliding, const std::vector<ComplexMode>& modes, const PairRoles& roles,
                    const Reduction& reduction)
{
  const auto& [structure, interface, equilibrium] = sliding;
  const std::vector<int>& active = roles.active;
  ReducedModel model;
  const ClosedContact contact = eliminate_closed_pairs(structure, interface, roles.sliding);
  const double omega = modes.front().lambda.imag();

  // the modes and the shapes of the pairs' forces, as they come
  Owned<Mat> E = project_symmetric(structure.K, contact.Z), BZ;
  const Owned<Mat> M_z = project_symmetric(structure.M, contact.Z);
  check(MatAXPY(E, omega * omega, M_z, UNKNOWN_NONZERO_PATTERN));
  check(MatSetOption(E, MAT_SYMMETRIC, PETSC_TRUE));
  const Owned<Mat> B = rows_of(interface, active, RowsTaken::all);
  check(MatMatMult(B, contact.Z, MAT_INITIAL_MATRIX, PETSC_DEFAULT, BZ.put()));
  const auto forces = [&](Mat rows)
  { return reduction.sliding ? sliding_forces(transposed(rows), interface, active) : transposed(rows); };
  ModeColumns of_modes = mode_columns(modes, reduction, contact.Z);
  MultiVector& columns = of_modes.columns;
  const Index modal = columns.columns();
  append(columns, attachment_columns(E, forces(BZ), reduction.factor));
  model.omega = omega;
  choose_basis(model, E, M_z, columns, {modal, of_modes.apart}, reduction.threshold);
  // Projected on the basis itself: a combination of what nearly parallel columns give would hold rounding alone.
  MultiVector X = product(contact.Z, columns);
  project(model, structure, contact, columns, X);
  const MultiVector left = product(contact.Y, columns);
  std::vector<char> follows = roles.sliding; // pairs whose friction follows their normal force
  if (reduction.sliding)
    for (const int pair : active) follows[static_cast<std::size_t>(pair)] = 1; // no reaction while open
  if (const Owned<Mat> turning = friction_damping(interface, follows, roles.reactions, FrictionDamping::whole);
      turning.get())
  {
    const std::vector<PetscInt> turns = own_rows(turning);
    model.C += inner_products(rows_of(left, turns), rows_of(product(turning, X), turns));
  }
  model.H = inner_products(left, forces(B));
  const Owned<Mat> read = rows_of(interface, active, reduction.sliding ? RowsTaken::normal : RowsTaken::all);
  model.G = inner_products(transposed(read), X);

  model.E_factor.compute(model.K_z + omega * omega * model.M_z);
  model.M_factor.compute(model.M_z);
  if (model.M_factor.info() != Eigen::Success || model.E_factor.info() != Eigen::Success)
    throw Error("reduced model: a shape has no mass or no stiffness: give massless points a mass, or set "
                "fidelity = \"full\"");
  model.shapes = std::move(X);
  model.active = active;
  set_active_pairs(model, interface, equilibrium, reduction);
  return model;
}

namespace
{

/// The model on fewer shapes, the columns of `basis`, without the shapes themselves.
ReducedModel on_shapes(const ReducedModel& model, const MatrixXd& basis, Index slow)
{
  ReducedModel result;
  for (MatrixXd ReducedModel::*const part : {&ReducedModel::M, &ReducedModel::C, &ReducedModel::K, &ReducedModel::M_z,
                                             &ReducedModel::C_z, &ReducedModel::K_z})
    result.*part = basis.transpose() * (model.*part * basis);
  result.H = basis.transpose() * model.H;
  result.G = model.G * basis;
  result.active = model.active;
  result.directions = model.directions;
  result.friction = model.friction;
  result.gap = model.gap;
  result.drive = model.drive;
  result.reactions = model.reactions;
  result.omega = model.omega;
  result.slow = slow;
  return result;
}

} // namespace

ReducedModel truncated(const ReducedModel& model, Index size)
{
  return on_shapes(model, MatrixXd::Identity(model.size(), size), std::min(model.slow, size));
}

ReducedModel without_modes_apart(const ReducedModel& model)
{
  const Index size = model.size(), apart = model.apart.cols();
  MatrixXd basis = MatrixXd::Identity(size, size);
  if (apart > 0) Eigen::HouseholderQR<MatrixXd>(model.apart).householderQ().applyThisOnTheLeft(basis);
  basis = basis.rightCols(size - apart).eval();
  Index slow = 0;
  basis *= by_falling_period(basis.transpose() * model.M_z * basis, model.omega, slow);
  return on_shapes(model, basis, slow);
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
