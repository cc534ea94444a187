#include "mumps.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/free_memory.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;

// Controls, and INFOG(1).
constexpr PetscInt transposition = 9, room = 14;
constexpr PetscInt singular = -10, out_of_memory = -13;
constexpr PetscInt largest_room = 2000; // [%]

/// Whether INFOG(1) says that delayed pivots or messages between ranks need more memory than was estimated.
bool exceeds_estimate(PetscInt outcome)
{
  return outcome == -8 || outcome == -9 || outcome == -17 || outcome == -20;
}

/// This rank's rows as a matrix of PETSc's, which borrows them.
Owned<Mat> borrowed(const MatrixXd& rows, MPI_Comm comm)
{
  Owned<Mat> result;
  check(MatCreateDense(comm, static_cast<PetscInt>(rows.rows()), PETSC_DECIDE, PETSC_DETERMINE,
                       static_cast<PetscInt>(rows.cols()), const_cast<double*>(rows.data()), result.put()));
  return result;
}

} // namespace

MumpsFactor::MumpsFactor(Mat A, const MumpsSettings& settings) : A_(A), settings_(settings)
{
  analyse();
}

MumpsFactor::~MumpsFactor()
{
  factor_ = {};
  return_freed_memory();
}

PetscInt MumpsFactor::information(PetscInt number) const
{
  PetscInt value = 0;
  check(MatMumpsGetInfog(factor_, number, &value));
  return value;
}

void MumpsFactor::analyse()
{
  const bool symmetric = settings_.symmetry == Symmetry::symmetric;
  check(MatGetFactor(A_, MATSOLVERMUMPS, symmetric ? MAT_FACTOR_CHOLESKY : MAT_FACTOR_LU, factor_.put()));
  check(MatSetOptionsPrefix(factor_, settings_.prefix));
  // rows stay where they are
  check(MatMumpsSetIcntl(factor_, 6, 0));
  // METIS; on one rank PETSc leaves the order to MUMPS
  check(MatMumpsSetIcntl(factor_, 7, 5));
  // no ScaLAPACK, since negative pivots of a root that it factors are not counted
  check(MatMumpsSetIcntl(factor_, 13, 1));
  check(MatMumpsSetIcntl(factor_, room, settings_.room));
  check(MatMumpsSetCntl(factor_, 1, settings_.pivoting));
  MatFactorInfo info;
  check(MatFactorInfoInitialize(&info));
  check(symmetric ? MatCholeskyFactorSymbolic(factor_, A_, nullptr, &info)
                  : MatLUFactorSymbolic(factor_, A_, nullptr, nullptr, &info));
}

bool MumpsFactor::factorise()
{
  MatFactorInfo info;
  check(MatFactorInfoInitialize(&info));
  while (true)
  {
    check(settings_.symmetry == Symmetry::symmetric ? MatCholeskyFactorNumeric(factor_, A_, &info)
                                                    : MatLUFactorNumeric(factor_, A_, &info));
    const PetscInt outcome = information(1), detail = information(2);
    if (outcome >= 0) return true;
    PetscInt given = 0;
    check(MatMumpsGetIcntl(factor_, room, &given));
    if (outcome == out_of_memory) throw LibraryError(out_of_memory_text);
    if (outcome != singular && !(exceeds_estimate(outcome) && given < largest_room))
      throw LibraryError("MUMPS: INFOG(1) = " + std::to_string(outcome) + ", INFOG(2) = " + std::to_string(detail) +
                         "; its manual lists them");
    analyse(); // PETSc leaves a factor as it is after one that failed
    if (outcome == singular) return false;
    check(MatMumpsSetIcntl(factor_, room, 4 * std::max<PetscInt>(given, 0) + 10));
  }
}

MatrixXd MumpsFactor::solve(const MatrixXd& B) const
{
  MatrixXd X(B.rows(), B.cols());
  const Owned<Mat> right = borrowed(B, comm_of(A_)), solution = borrowed(X, comm_of(A_));
  check(MatMatSolve(factor_, right, solution));
  return X;
}

MatrixXd MumpsFactor::solve_transposed(const MatrixXd& B) const
{
  check(MatMumpsSetIcntl(factor_, transposition, 0));
  MatrixXd X = solve(B);
  check(MatMumpsSetIcntl(factor_, transposition, 1));
  return X;
}

double MumpsFactor::count(PetscInt number) const
{
  const auto value = static_cast<double>(information(number)); // a negative one counts millions
  return value < 0 ? -1e6 * value : value;
}

double MumpsFactor::estimated_memory() const
{
  constexpr double megabyte = 1e6; // MUMPS gives whole ones
  return std::max(megabyte * static_cast<double>(information(17)), sizeof(double) * count(20));
}

MumpsSettings definite_settings()
{
  // without pivoting the estimate of the memory is close
  return {.symmetry = Symmetry::symmetric, .prefix = "factor_", .room = 1, .pivoting = 0};
}

BorderedMumps::BorderedMumps(Mat A, Mat B)
    : B_(shared(B)), transposed_(B ? transpose_of(B) : Owned<Mat>()), factor_(A, definite_settings()),
      failed_(!factor_.factorise() || factor_.negative_pivots() > 0)
{
}

void BorderedMumps::read_condensed(const std::function<void(const CondensedStrip&)>& take) const
{
  if (!B_) return;
  constexpr PetscInt width = 96; // columns at once, as many vectors of the matrix's size
  PetscInt size = 0, first = 0, last = 0;
  check(MatGetSize(B_, &size, nullptr));
  check(MatGetOwnershipRange(B_, &first, &last));
  const MPI_Comm comm = comm_of(B_);
  for (PetscInt begin = 0; begin < size; begin += width)
  {
    const PetscInt columns = std::min(width, size - begin);
    const MatrixXd units = MatrixXd::NullaryExpr(last - first, columns,
                                                 [&](Index i, Index j) { return first + i == begin + j ? 1. : 0.; });
    const MultiVector rows = product(transposed_, {comm, units});
    const MatrixXd strip = whole_product(B_, {comm, factor_.solve(rows.entries)}).bottomRows(size - begin);
    const auto from = static_cast<std::size_t>(begin);
    if (rank_of(comm) == 0)
      take({from, from + static_cast<std::size_t>(columns), static_cast<std::size_t>(size - begin), strip.data()});
  }
}

std::vector<double> BorderedMumps::forward(std::span<const Vec> b)
{
  solution_ = columns_of(b);
  solution_.entries = factor_.solve(solution_.entries);
  if (!B_) return {};
  const MatrixXd seen = whole_product(B_, solution_);
  return rank_of(solution_.comm) == 0 ? std::vector<double>(seen.data(), seen.data() + seen.size())
                                      : std::vector<double>();
}

void BorderedMumps::backward(const std::vector<double>& lambda, std::span<const Vec> x) const
{
  MultiVector result = solution_;
  if (B_)
  {
    PetscInt size = 0, first = 0, last = 0;
    check(MatGetSize(B_, &size, nullptr));
    check(MatGetOwnershipRange(B_, &first, &last));
    std::vector<double> forces = lambda;
    broadcast(forces, solution_.comm);
    const MatrixXd own = MatrixXd::Map(forces.data(), size, solution_.columns()).middleRows(first, last - first);
    result.entries -= factor_.solve(product(transposed_, {solution_.comm, own}).entries);
  }
  for (std::size_t k = 0; k < x.size(); ++k) copy_column(result, static_cast<Index>(k), x[k]);
}

} // namespace squeal
