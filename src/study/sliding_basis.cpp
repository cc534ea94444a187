#include "sliding_basis.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;

/// The local rows that hold entries of B.
std::vector<Index> columns_with_entries(Mat B)
{
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRangeColumn(B, &first, &last));
  Owned<Mat> squares;
  Owned<Vec> ones, sums;
  check(MatDuplicate(B, MAT_COPY_VALUES, squares.put()));
  for_each_row(B,
               [&](PetscInt row, std::span<const PetscInt> columns, std::span<const PetscScalar>)
               {
                 const std::vector<PetscScalar> marks(columns.size(), 1);
                 check(MatSetValues(squares, 1, &row, static_cast<PetscInt>(columns.size()), columns.data(),
                                    marks.data(), INSERT_VALUES));
               });
  check(MatAssemblyBegin(squares, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(squares, MAT_FINAL_ASSEMBLY));
  check(MatCreateVecs(B, sums.put(), ones.put()));
  check(VecSet(ones, 1));
  check(MatMultTranspose(squares, ones, sums));
  const PetscScalar* values = nullptr;
  std::vector<Index> rows;
  check(VecGetArrayRead(sums, &values));
  for (PetscInt i = 0; i < last - first; ++i)
    if (values[i] > 0) rows.push_back(i);
  check(VecRestoreArrayRead(sums, &values));
  return rows;
}

/// The sum over all ranks, the same to the last bit everywhere.
MatrixXd shared_sum(const MatrixXd& local, MPI_Comm comm)
{
  return inner_products({comm, MatrixXd::Identity(local.rows(), local.rows())}, {comm, local});
}

void set_matrix(SlidingBasis& basis, BasisImage& image, Mat A)
{
  if (image.matrix.get() && equal(image.matrix, A)) return;
  image.matrix = copy_of(A);
  const MultiVector AT = product(A, basis.T);
  image.contact_rows = {AT.comm, AT.entries(basis.contact_dofs, Eigen::all)};
  image.products = inner_products(basis.T, AT);
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

/// The pivots of this rank.
Owned<IS> pivot_set(Mat A, const ClosedContact& contact)
{
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(A, &first, &last));
  std::vector<PetscInt> own;
  for (const PetscInt pivot : contact.pivots)
    if (pivot >= first && pivot < last) own.push_back(pivot);
  Owned<IS> set;
  check(ISCreateGeneral(comm_of(A), static_cast<PetscInt>(own.size()), own.data(), PETSC_COPY_VALUES, set.put()));
  return set;
}

Owned<IS> all_columns(Mat A)
{
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRangeColumn(A, &first, &last));
  Owned<IS> set;
  check(ISCreateStride(comm_of(A), last - first, first, 1, set.put()));
  return set;
}

Owned<Mat> part_of(Mat A, IS rows, IS columns)
{
  Owned<Mat> result;
  check(MatCreateSubMatrix(A, rows, columns, MAT_INITIAL_MATRIX, result.put()));
  return result;
}

/// What a lift of T by a basis of the closed pairs changes, on the rows of the pivots.
MultiVector change_by_lift(const SlidingBasis& basis, const ClosedContact& contact, Mat lift)
{
  MultiVector change = product(part_of(lift, pivot_set(lift, contact), all_columns(lift)), kept_rows(basis.T, contact));
  change.entries -= basis.T.entries(local_pivots(contact), Eigen::all);
  return change;
}

/// Both lifts, and where the pivots are.
struct Lifts
{
  const ClosedContact& contact;
  std::vector<Index> pivots;     // local rows
  std::vector<Index> in_contact; // their places among the contact's degrees of freedom
  MultiVector of_Y, of_Z;        // changes on the rows of the pivots
};

Lifts make_lifts(const SlidingBasis& basis, const ClosedContact& contact)
{
  Lifts lifts{contact,
              local_pivots(contact),
              {},
              change_by_lift(basis, contact, contact.Y),
              change_by_lift(basis, contact, contact.Z)};
  for (const Index pivot : lifts.pivots)
    lifts.in_contact.push_back(std::lower_bound(basis.contact_dofs.begin(), basis.contact_dofs.end(), pivot) -
                               basis.contact_dofs.begin());
  return lifts;
}

MatrixXd projected(const BasisImage& image, const Lifts& lifts)
{
  const MatrixXd rows = image.contact_rows.entries(lifts.in_contact, Eigen::all);
  const Owned<IS> pivots = pivot_set(image.matrix, lifts.contact);
  const MultiVector coupled = product(part_of(image.matrix, pivots, pivots), lifts.of_Z);
  MatrixXd local = lifts.of_Y.entries.transpose() * (rows + coupled.entries);
  local.noalias() += rows.transpose() * lifts.of_Z.entries;
  return image.products + shared_sum(local, lifts.of_Y.comm);
}

/// T'Cf T of the lifted T. Only degrees of freedom of the contact have entries in Cf.
MatrixXd projected_damping(const SlidingBasis& basis, const Lifts& lifts, Mat Cf)
{
  MultiVector right = basis.T, left = basis.T;
  right.entries(lifts.pivots, Eigen::all) += lifts.of_Z.entries;
  left.entries(lifts.pivots, Eigen::all) += lifts.of_Y.entries;
  const MultiVector force = product(Cf, right);
  const MatrixXd at_contact = left.entries(basis.contact_dofs, Eigen::all);
  return shared_sum(at_contact.transpose() * force.entries(basis.contact_dofs, Eigen::all), left.comm);
}

} // namespace

bool equal(Mat A, Mat B)
{
  PetscBool same = PETSC_FALSE;
  check(MatEqual(A, B, &same));
  return same == PETSC_TRUE;
}

Owned<Mat> copy_of(Mat A)
{
  Owned<Mat> result;
  check(MatDuplicate(A, MAT_COPY_VALUES, result.put()));
  return result;
}

Owned<Mat> transpose_of(Mat A)
{
  Owned<Mat> result;
  check(MatTranspose(A, MAT_INITIAL_MATRIX, result.put()));
  return result;
}

SlidingBasis make_basis(const Structure& structure, const Interface& interface, Index sketched)
{
  SlidingBasis basis{random_multivector(structure.K, static_cast<PetscInt>(sketched)), sketched,
                     columns_with_entries(interface.B)};
  set_structure(basis, structure);
  return basis;
}

void set_structure(SlidingBasis& basis, const Structure& structure)
{
  set_matrix(basis, basis.M, structure.M);
  set_matrix(basis, basis.C, structure.C);
  set_matrix(basis, basis.K, structure.K);
}

Index extend(SlidingBasis& basis, MultiVector X)
{
  MultiVector shapes = columns_from(basis.T, basis.sketched);
  const Index gained = extend_orthonormal(shapes, std::move(X)), before = basis.T.columns(), size = before + gained;
  if (gained == 0) return 0;
  const MultiVector news = columns_from(shapes, shapes.columns() - gained);
  append(basis.T, news);
  for (BasisImage* image : {&basis.M, &basis.C, &basis.K})
  {
    const MultiVector AX = product(image->matrix, news);
    append(image->contact_rows, {AX.comm, AX.entries(basis.contact_dofs, Eigen::all)});
    const MatrixXd inner = inner_products(basis.T, AX);
    image->products.conservativeResize(size, size);
    image->products.rightCols(gained) = inner;
    image->products.bottomRows(gained) = inner.transpose();
  }
  return gained;
}

ProjectedSliding project(const SlidingBasis& basis, const ClosedContact& contact, Mat Cf)
{
  const Lifts lifts = make_lifts(basis, contact);
  ProjectedSliding result{projected(basis.M, lifts), projected(basis.C, lifts), projected(basis.K, lifts)};
  if (Cf) result.C += projected_damping(basis, lifts, Cf);
  const MatrixXd at_pivots = basis.T.entries(lifts.pivots, Eigen::all).rightCols(basis.shapes());
  result.kept = MatrixXd::Identity(basis.shapes(), basis.shapes()) -
                shared_sum(at_pivots.transpose() * at_pivots, basis.T.comm); // shapes are orthonormal
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
