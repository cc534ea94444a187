#include "squeal/analysis/reduced.hpp"

#include "dense.hpp"
#include "squeal/analysis/closed_contact.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

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
std::vector<Owned<Vec>> mode_columns(const std::vector<ComplexMode>& modes, int count, Mat Z)
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
  std::vector<Owned<Vec>> columns;
  for (const ComplexMode* mode : taken)
    for (const Vec part : {mode->real.get(), mode->imaginary.get()})
    {
      check(VecScatterBegin(scatter, part, y, INSERT_VALUES, SCATTER_FORWARD));
      check(VecScatterEnd(scatter, part, y, INSERT_VALUES, SCATTER_FORWARD));
      columns.push_back(copy_of(y.get()));
    }
  return columns;
}

/// (K_z + w^2 M_z)^-1 Z'B_a'
Owned<Mat> attachment_columns(Mat A, Mat forces)
{
  const Factor factor(A, nullptr, Factor::Kind::automatic);
  if (factor.failed()) throw Error("reduced model: K + omega^2 M is not positive definite with the active pairs open");
  PetscInt columns = 0;
  check(MatGetSize(forces, nullptr, &columns));
  Owned<Mat> result = tall(forces, columns);
  constexpr PetscInt at_once = 64;
  for (PetscInt begin = 0; begin < columns; begin += at_once)
  {
    std::vector<Owned<Vec>> force, shape;
    for (PetscInt i = begin; i < std::min(begin + at_once, columns); ++i)
    {
      force.push_back(column_of(forces, i));
      shape.push_back(zeros_like(force.back()));
    }
    (void)factor.forward(std::vector<Vec>(force.begin(), force.end()));
    factor.backward({}, std::vector<Vec>(shape.begin(), shape.end()));
    for (std::size_t i = 0; i < shape.size(); ++i) set_column(result, begin + static_cast<PetscInt>(i), shape[i]);
  }
  return result;
}

/// What is new in `columns` next to V, orthonormal in the product of E: directions of which less than `threshold` of
/// the columns' own size is new are dropped. V and EV grow.
int extend(Owned<Mat>& V, Owned<Mat>& EV, Owned<Mat> columns, Mat E, double threshold)
{
  PetscInt added = 0;
  check(MatGetSize(columns, nullptr, &added));
  if (added == 0) return 0;
  for (int pass = 0; pass < 2; ++pass)
  {
    Owned<Mat> image = times(E, columns);
    const Eigen::VectorXd size = gram(columns, image).diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    if (V.get()) subtract(columns, V, gram(EV, columns));
    image = times(E, columns);
    const Eigen::MatrixXd scaled = size.asDiagonal() * gram(columns, image) * size.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> spectrum((scaled + scaled.transpose()) / 2);
    const double least = pass == 0 ? threshold * threshold : 0;
    const auto kept = (spectrum.eigenvalues().array() > least).count();
    if (kept == 0) return 0;
    columns = combine(columns, size.asDiagonal() * spectrum.eigenvectors().rightCols(kept) *
                                   spectrum.eigenvalues().tail(kept).cwiseSqrt().cwiseInverse().asDiagonal());
  }
  check(MatGetSize(columns, nullptr, &added));
  V = V.get() ? beside(V, columns) : std::move(columns);
  EV = times(E, V);
  return static_cast<int>(added);
}

Owned<Mat> tall_of(const std::vector<Owned<Vec>>& columns, std::size_t first, std::size_t last, Mat pattern)
{
  Owned<Mat> result = tall(pattern, static_cast<PetscInt>(last - first));
  for (std::size_t i = first; i < last; ++i) set_column(result, static_cast<PetscInt>(i - first), columns[i]);
  return result;
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

ReducedModel reduce(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                    const std::vector<ComplexMode>& modes, std::vector<int> active, const Reduction& reduction)
{
  const double start = MPI_Wtime();
  ReducedModel model;
  Equilibrium sliding; // the pairs that stay closed
  sliding.closed = equilibrium.closed;
  sliding.reactions = equilibrium.reactions;
  for (const int pair : active) sliding.closed[static_cast<std::size_t>(pair)] = 0;
  const ClosedContact contact = eliminate_closed_pairs(structure, interface, sliding);
  const double omega = modes.front().lambda.imag();

  // the basis
  Owned<Mat> E = project_symmetric(structure.K, contact.Z), V, EV;
  const Owned<Mat> M_z = project_symmetric(structure.M, contact.Z);
  check(MatAXPY(E, omega * omega, M_z, UNKNOWN_NONZERO_PATTERN));
  check(MatSetOption(E, MAT_SYMMETRIC, PETSC_TRUE));
  const std::vector<Owned<Vec>> shapes = mode_columns(modes, reduction.modes, contact.Z);
  model.modes = extend(V, EV, tall_of(shapes, 0, 2, E), E, 1e-7); // the followed mode is kept whatever else is
  if (shapes.size() > 2) model.modes += extend(V, EV, tall_of(shapes, 2, shapes.size(), E), E, 1e-6);
  const Owned<Mat> B = rows_of(interface, active), B_t = tall_transpose(B);
  {
    Owned<Mat> forces;
    Owned<Mat> BZ;
    check(MatMatMult(B, contact.Z, MAT_INITIAL_MATRIX, PETSC_DEFAULT, BZ.put()));
    forces = tall_transpose(BZ);
    model.attachments = extend(V, EV, attachment_columns(E, forces), E, reduction.threshold);
  }

  // the projection
  const Owned<Mat> left = times(contact.Y, V);
  model.shapes = times(contact.Z, V);
  Owned<Mat> C;
  check(MatDuplicate(structure.C, MAT_COPY_VALUES, C.put()));
  const Owned<Mat> turning = direction_damping(interface, sliding);
  if (turning.get()) check(MatAXPY(C, 1, turning, UNKNOWN_NONZERO_PATTERN));
  for (const auto& [matrix, unsymmetric, symmetric] :
       {std::tuple{structure.M.get(), &model.M, &model.M_z}, std::tuple{structure.C.get(), &model.C, &model.C_z},
        std::tuple{structure.K.get(), &model.K, &model.K_z}})
  {
    const Owned<Mat> image = times(matrix, model.shapes);
    *unsymmetric = gram(left, image);
    *symmetric = gram(model.shapes, image);
    *symmetric = (*symmetric + symmetric->transpose()).eval() / 2;
  }
  if (turning.get()) model.C = gram(left, times(C, model.shapes));
  model.H = gram(left, B_t);
  model.G = gram(B_t, model.shapes);

  // the active pairs
  const auto block = static_cast<std::size_t>(interface.block()), directions = block - 1;
  const std::vector<double> still = relative(interface, equilibrium.u);
  for (const int pair : active)
  {
    const auto i = static_cast<std::size_t>(pair);
    model.gap.push_back(equilibrium.closed[i] ? 0 : interface.gap[i] + still[i * block]);
    for (std::size_t k = 0; k < block; ++k) model.reactions.push_back(equilibrium.reactions[i * block + k]);
    for (std::size_t k = 0; k < directions; ++k) model.drive.push_back(interface.drive[i * directions + k]);
  }
  model.omega = omega;
  model.active = std::move(active);
  model.directions = interface.directions;
  model.friction = interface.friction;
  model.seconds = MPI_Wtime() - start;
  return model;
}

ReducedState coordinates(const ReducedModel& model, const Structure& structure, Vec du, Vec v)
{
  const auto project = [&](Vec force)
  {
    Owned<Vec> small;
    check(MatCreateVecs(model.shapes, small.put(), nullptr));
    check(MatMultTranspose(model.shapes, force, small));
    return entries_of(small);
  };
  const Owned<Vec> Kdu = zeros_like(du), Mdu = zeros_like(du), Mv = zeros_like(v);
  check(MatMult(structure.K, du, Kdu));
  check(MatMult(structure.M, du, Mdu));
  check(VecAXPY(Kdu, model.omega * model.omega, Mdu));
  check(MatMult(structure.M, v, Mv));
  const Eigen::MatrixXd E = model.K_z + model.omega * model.omega * model.M_z;
  return {E.llt().solve(project(Kdu)), model.M_z.llt().solve(project(Mv))};
}

void add_motion(const ReducedModel& model, double factor, const Eigen::VectorXd& q, Vec target)
{
  Owned<Vec> small;
  check(MatCreateVecs(model.shapes, small.put(), nullptr));
  const Eigen::VectorXd entries = factor * q;
  set_whole(small, {entries.data(), static_cast<std::size_t>(entries.size())});
  check(MatMultAdd(model.shapes, small, target, target));
}

} // namespace squeal
