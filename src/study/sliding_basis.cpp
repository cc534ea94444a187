#include "sliding_basis.hpp"

#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/modes/quadratic.hpp"

#include <algorithm>
#include <array>
#include <Eigen/Cholesky>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;

/// The local rows of the degrees of freedom at which some row of B has an entry, ascending.
std::vector<Index> dofs_with_entries(Mat B)
{
  const Owned<Vec> marks = vector_of_columns(B);
  check(VecSet(marks, 0));
  for_each_row(
      B,
      [&](PetscInt, std::span<const PetscInt> columns, std::span<const PetscScalar>)
      {
        const std::vector<PetscScalar> ones(columns.size(), 1);
        check(VecSetValues(marks, static_cast<PetscInt>(columns.size()), columns.data(), ones.data(), INSERT_VALUES));
      });
  check(VecAssemblyBegin(marks));
  check(VecAssemblyEnd(marks));
  PetscInt size = 0;
  const PetscScalar* values = nullptr;
  std::vector<Index> rows;
  check(VecGetLocalSize(marks, &size));
  check(VecGetArrayRead(marks, &values));
  for (PetscInt i = 0; i < size; ++i)
    if (values[i] > 0) rows.push_back(i);
  check(VecRestoreArrayRead(marks, &values));
  return rows;
}

/// The sum over all ranks, the same to the last bit everywhere.
MatrixXd shared_sum(const MatrixXd& local, MPI_Comm comm)
{
  return inner_products({comm, MatrixXd::Identity(local.rows(), local.rows())}, {comm, local});
}

/// Those of matrices that no others give.
std::vector<BasisImage*> images_of(SlidingBasis& basis)
{
  std::vector<BasisImage*> images;
  for (BasisImage* image : {&basis.M, &basis.C, &basis.K, &basis.K_loss, &basis.G, &basis.H})
    if (image->matrix.get() && !(basis.rayleigh && image == &basis.C)) images.push_back(image);
  return images;
}

/// `A` may be null. Returns whether it is another one.
bool set_matrix(SlidingBasis& basis, BasisImage& image, Mat A)
{
  if (image.matrix.get() == A) return false;
  basis.by_Z.Z = {};
  if (!A)
  {
    image = {image.sign};
    return true;
  }
  image.matrix = shared(A);
  const MultiVector AT = product(A, basis.T);
  image.contact_rows = {AT.comm, AT.entries(basis.contact_dofs, Eigen::all)};
  image.products = inner_products(basis.T, AT);
  return true;
}

/// Other degrees of freedom of the contact need other rows of every image.
void set_contact(SlidingBasis& basis, Mat B)
{
  if (basis.B.get() == B) return;
  std::vector<Index> dofs = dofs_with_entries(B);
  int changed = dofs != basis.contact_dofs;
  MPI_Allreduce(MPI_IN_PLACE, &changed, 1, MPI_INT, MPI_MAX, comm_of(B));
  basis.B = shared(B);
  basis.by_Z.Z = {};
  if (changed == 0) return;
  basis.contact_dofs = std::move(dofs);
  basis.whole_C = {};
  for (BasisImage* image : {&basis.M, &basis.C, &basis.K, &basis.K_loss, &basis.G, &basis.H}) image->matrix = {};
}

void set_damping(SlidingBasis& basis, Mat M, Mat C, Mat K)
{
  basis.rayleigh = rayleigh_part(M, C, K);
  basis.C = {};
  basis.by_Z.Z = {};
  if (basis.rayleigh)
    basis.C.matrix = shared(C);
  else
    set_matrix(basis, basis.C, C);
}

/// The pivots of this rank, as local rows.
std::vector<Index> local_pivots(const ClosedContact& contact)
{
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(contact.Z, &first, &last));
  std::vector<Index> rows;
  for (const PetscInt pivot : contact.pivots)
    if (pivot >= first && pivot < last) rows.push_back(pivot - first);
  return rows;
}

Owned<IS> set_of(MPI_Comm comm, const std::vector<PetscInt>& places)
{
  Owned<IS> set;
  check(ISCreateGeneral(comm, static_cast<PetscInt>(places.size()), places.data(), PETSC_COPY_VALUES, set.put()));
  return set;
}

/// The pivots of this rank.
Owned<IS> pivot_set(const ClosedContact& contact)
{
  PetscInt first = 0;
  check(MatGetOwnershipRange(contact.Z, &first, nullptr));
  std::vector<PetscInt> own;
  for (const Index pivot : local_pivots(contact)) own.push_back(first + static_cast<PetscInt>(pivot));
  return set_of(comm_of(contact.Z), own);
}

Owned<Mat> part_of(Mat A, IS rows, IS columns)
{
  Owned<Mat> result;
  check(MatCreateSubMatrix(A, rows, columns, MAT_INITIAL_MATRIX, result.put()));
  return result;
}

/// What a lift of T by a basis of the closed pairs changes, on the rows of the pivots. These rows of the lift have
/// entries at other degrees of freedom of the contact alone.
MultiVector change_by_lift(const SlidingBasis& basis, const ClosedContact& contact, const std::vector<Index>& pivots,
                           Mat lift)
{
  std::vector<Index> rows;
  std::vector<PetscInt> columns;
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRangeColumn(lift, &first, &last));
  for (std::size_t below = 0; const Index dof : basis.contact_dofs)
  {
    while (below < pivots.size() && pivots[below] < dof) ++below;
    if (below < pivots.size() && pivots[below] == dof) continue;
    rows.push_back(dof);
    columns.push_back(first + static_cast<PetscInt>(dof) - static_cast<PetscInt>(below));
  }
  MultiVector change = product(part_of(lift, pivot_set(contact), set_of(comm_of(lift), columns)),
                               {basis.T.comm, basis.T.entries(rows, Eigen::all)});
  change.entries -= basis.T.entries(pivots, Eigen::all);
  return change;
}

/// Orthonormal combinations of the shapes that hold more than a trace of other degrees of freedom than the pivots, by
/// the inner products without these; empty: every combination does. What a lift makes of the others is rounding: its
/// projection is singular, with any number for an eigenvalue.
MatrixXd independent_part(const MatrixXd& kept)
{
  constexpr double trace = 1e-12; // square of a part of 1e-6: rounding leaves it a relative error of 1e-10
  const MatrixXd shifted = kept - trace * MatrixXd::Identity(kept.rows(), kept.cols());
  if (shifted.llt().info() == Eigen::Success) return {}; // as mostly, at a tenth of the work
  const SymmetricEigenpairs parts = solve_dense_symmetric(kept);
  return parts.y.rightCols((parts.lambda.array() >= trace).count());
}

/// Whether two matrices have one layout and equal entries. Collective.
bool equal(Mat A, Mat B)
{
  std::array<PetscInt, 2> size{}, other{};
  check(MatGetLocalSize(A, &size[0], &size[1]));
  check(MatGetLocalSize(B, &other[0], &other[1]));
  int alike = size == other; // else MatEqual is an error
  MPI_Allreduce(MPI_IN_PLACE, &alike, 1, MPI_INT, MPI_MIN, comm_of(A));
  PetscBool same = PETSC_FALSE;
  if (alike == 0) return false;
  check(MatEqual(A, B, &same));
  return same == PETSC_TRUE;
}

/// Sets the lift by Z where it has changed.
void lift_by_Z(SlidingBasis& basis, const ClosedContact& contact)
{
  LiftByZ& lift = basis.by_Z;
  if (lift.Z.get() && equal(lift.Z, contact.Z)) return;
  lift.Z = copy_of(contact.Z);
  PetscInt rows_of_B = 0;
  check(MatGetSize(basis.B, &rows_of_B, nullptr));
  if (rows_of_B > 0) lift.of_B = product(basis.B, basis.T);
  lift.pivots = local_pivots(contact);
  lift.in_contact.clear();
  lift.change = change_by_lift(basis, contact, lift.pivots, contact.Z);
  for (const Index pivot : lift.pivots)
    lift.in_contact.push_back(std::lower_bound(basis.contact_dofs.begin(), basis.contact_dofs.end(), pivot) -
                              basis.contact_dofs.begin());
  const MatrixXd at_pivots = basis.T.entries(lift.pivots, Eigen::all).rightCols(basis.shapes());
  lift.kept = MatrixXd::Identity(basis.shapes(), basis.shapes()) -
              shared_sum(at_pivots.transpose() * at_pivots, basis.T.comm); // shapes are orthonormal
  lift.independent = independent_part(lift.kept);
  const Owned<IS> pivots = pivot_set(contact);
  for (BasisImage* image : images_of(basis))
  {
    const MatrixXd rows = image->contact_rows.entries(lift.in_contact, Eigen::all);
    image->lifted_rows = product(part_of(image->matrix, pivots, pivots), lift.change);
    image->lifted_rows.entries += rows;
    image->lifted_products =
        image->products + image->sign * shared_sum(rows.transpose() * lift.change.entries, basis.T.comm);
  }
}

/// On the rows of B, symmetric or not.
struct PairMatrix
{
  Mat matrix = nullptr;
  bool symmetric = false;
};

/// T_Y'B'D B T_Z. Most rows of D are zero: of friction's damping those of normals and, mostly, along the drive. The
/// others may hold no pivot: then B T_Y and B T_Z are B T there.
MatrixXd projected_on_pairs(const SlidingBasis& basis, const ClosedContact& contact, const MultiVector& by_Y,
                            const PairMatrix& D)
{
  const Mat B = basis.B;
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(B, &first, &last));
  std::vector<PetscInt> rows;
  std::vector<Index> places;
  for_each_row(D.matrix,
               [&](PetscInt row, std::span<const PetscInt>, std::span<const PetscScalar> values)
               {
                 if (std::ranges::all_of(values, [](PetscScalar value) { return value == 0; })) return;
                 rows.push_back(row);
                 places.push_back(row - first);
               });
  const Owned<IS> taken = set_of(comm_of(B), rows);
  const Owned<Mat> D_taken = part_of(D.matrix, taken, taken), at_pivots = part_of(B, taken, pivot_set(contact));
  double entries = 0;
  check(MatNorm(at_pivots, NORM_FROBENIUS, &entries));
  const MultiVector sliding{basis.T.comm, basis.by_Z.of_B.entries(places, Eigen::all)};
  if (entries == 0)
  {
    const MultiVector force = product(D_taken, sliding);
    return D.symmetric ? symmetric_inner_products(sliding, force) : inner_products(sliding, force);
  }
  const auto lifted = [&](const MultiVector& change) {
    return MultiVector{change.comm, sliding.entries + product(at_pivots, change).entries};
  };
  return inner_products(lifted(by_Y), product(D_taken, lifted(basis.by_Z.change)));
}

} // namespace

SlidingBasis make_basis(const Structure& structure, const Interface& interface, Index sketched)
{
  SlidingBasis basis{random_multivector(structure.K, static_cast<PetscInt>(sketched)), sketched};
  set_model(basis, structure, interface);
  return basis;
}

void set_model(SlidingBasis& basis, const Structure& structure, const Interface& interface)
{
  set_contact(basis, interface.B);
  const Owned<Mat> C_0 = structure.K_loss.get() ? without_loss(structure.C, structure) : Owned<Mat>{};
  const Mat C = C_0.get() ? C_0 : structure.C;
  const bool other_M = set_matrix(basis, basis.M, structure.M), other_K = set_matrix(basis, basis.K, structure.K);
  if (other_M || other_K || basis.whole_C.get() != structure.C) set_damping(basis, structure.M, C, structure.K);
  basis.whole_C = shared(structure.C.get());
  set_matrix(basis, basis.K_loss, structure.K_loss);
  set_matrix(basis, basis.G, structure.G);
  set_matrix(basis, basis.H, structure.H);
}

MultiVector combination_of_shapes(const SlidingBasis& basis, const MatrixXd& a)
{
  return {basis.T.comm, basis.T.entries.middleCols(basis.sketched, a.rows()) * a};
}

Index extend(SlidingBasis& basis, MultiVector X)
{
  MultiVector shapes = columns_from(basis.T, basis.sketched);
  const Index gained = extend_orthonormal(shapes, std::move(X)), size = basis.T.columns() + gained;
  if (gained == 0) return 0;
  basis.by_Z.Z = {};
  const MultiVector news = columns_from(shapes, shapes.columns() - gained);
  append(basis.T, news);
  for (BasisImage* image : images_of(basis))
  {
    const MultiVector AX = product(image->matrix, news);
    append(image->contact_rows, {AX.comm, AX.entries(basis.contact_dofs, Eigen::all)});
    const MatrixXd inner = inner_products(basis.T, AX);
    image->products.conservativeResize(size, size);
    image->products.rightCols(gained) = inner;
    image->products.bottomRows(gained) = image->sign * inner.transpose();
  }
  return gained;
}

ProjectedSliding project(SlidingBasis& basis, const ClosedContact& contact, Mat damping, Mat stiffness)
{
  lift_by_Z(basis, contact);
  const MultiVector by_Y = change_by_lift(basis, contact, basis.by_Z.pivots, contact.Y);
  const auto lifted = [&](const BasisImage& image) -> MatrixXd
  {
    if (!image.matrix.get()) return {};
    return image.lifted_products + inner_products(by_Y, image.lifted_rows);
  };
  ProjectedSliding result{lifted(basis.M), {}, lifted(basis.K), lifted(basis.K_loss)};
  if (basis.rayleigh)
    result.C = basis.rayleigh->of_mass * result.M + basis.rayleigh->of_stiffness * result.K;
  else
    result.C = lifted(basis.C);
  if (basis.G.matrix.get()) result.C += lifted(basis.G);
  if (basis.H.matrix.get()) result.K += lifted(basis.H);
  if (damping) result.C += projected_on_pairs(basis, contact, by_Y, {damping, true});
  if (stiffness) result.K += projected_on_pairs(basis, contact, by_Y, {stiffness, false});
  result.kept = basis.by_Z.kept;
  result.independent = basis.by_Z.independent;
  return result;
}

MultiVector kept_rows(const MultiVector& x, const ClosedContact& contact)
{
  const std::vector<Index> pivots = local_pivots(contact);
  MultiVector kept{x.comm, MatrixXd(x.entries.rows() - static_cast<Index>(pivots.size()), x.columns())};
  Index next = 0, to = 0;
  for (std::size_t k = 0; k <= pivots.size(); ++k)
  {
    const Index end = k < pivots.size() ? pivots[k] : x.entries.rows();
    kept.entries.middleRows(to, end - next) = x.entries.middleRows(next, end - next);
    to += end - next;
    next = end + 1;
  }
  return kept;
}

MultiVector with_zero_pivots(const MultiVector& kept, const ClosedContact& contact)
{
  const std::vector<Index> pivots = local_pivots(contact);
  MultiVector x{kept.comm, MatrixXd::Zero(kept.entries.rows() + static_cast<Index>(pivots.size()), kept.columns())};
  Index next = 0, from = 0;
  for (std::size_t k = 0; k <= pivots.size(); ++k)
  {
    const Index end = k < pivots.size() ? pivots[k] : x.entries.rows();
    x.entries.middleRows(next, end - next) = kept.entries.middleRows(from, end - next);
    from += end - next;
    next = end + 1;
  }
  return x;
}

} // namespace squeal
