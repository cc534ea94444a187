#include "harmonic_basis.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/LU>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

constexpr PetscInt sketched = 32;     // random vectors: a norm is off by 13 % (one standard deviation)
constexpr double variance = 1. / 3;   // of their entries, even in (-1, 1)
constexpr double least_error = 1e-14; // backward error that no correction makes smaller

/// Factors of M, C, K and K_loss.
std::array<Complex, 4> factors_at(Complex s)
{
  return {s * s, s, 1, Complex(0, 1)};
}

std::array<Complex, 4> factors_at(double omega)
{
  return factors_at(Complex(0, omega));
}

/// Q(omega) from the first `columns` columns of the matrices, `rows` of them.
MatrixXcd sum_at(double omega, const std::vector<MatrixXd>& A, Index rows, Index columns)
{
  const auto factor = factors_at(omega);
  MatrixXcd Q = MatrixXcd::Zero(rows, columns);
  for (std::size_t k = 0; k < A.size(); ++k) Q += factor[k] * A[k].topLeftCorner(rows, columns);
  return Q;
}

void append_columns(MatrixXd& A, const MatrixXd& columns)
{
  A.conservativeResize(columns.rows(), A.cols() + columns.cols());
  A.rightCols(columns.cols()) = columns;
}

void append_rows(MatrixXd& A, const MatrixXd& rows)
{
  A.conservativeResize(A.rows() + rows.rows(), rows.cols());
  A.bottomRows(rows.rows()) = rows;
}

/// Residuals of one side at omega in the first column of `residuals`, over what is allowed in that of `defects`.
void estimate_residuals(const HarmonicBasis& basis, ResponseEnd side, double omega, const MatrixXcd& a,
                        double tolerance, Eigen::Ref<Eigen::VectorXd> residuals, Eigen::Ref<Eigen::VectorXd> defects)
{
  const auto which = static_cast<std::size_t>(side);
  const HarmonicSide& own = basis.problem.of(side);
  const MatrixXcd left =
      sum_at(omega, basis.sketches[which], basis.S.columns(), a.rows()) * a - basis.sketched[which].cast<Complex>();
  const auto factor = factors_at(omega);
  double scale = 0;
  for (std::size_t k = 0; k < own.matrices.size(); ++k) scale += std::abs(factor[k]) * basis.problem.norms[k];
  for (Index j = 0; j < a.cols(); ++j)
  {
    const double size = own.sizes[static_cast<std::size_t>(j)];
    residuals(j) = left.col(j).norm() / std::sqrt(variance * sketched) / size;
    defects(j) = residuals(j) / std::max(tolerance, least_error * scale * a.col(j).norm() / size); // |V a| = |a|
  }
}

} // namespace

HarmonicBasis make_harmonic_basis(const HarmonicProblem& problem)
{
  const Mat pattern = problem.sides[0].matrices[0];
  HarmonicBasis basis{problem, empty_multivector(pattern), random_multivector(pattern, sketched)};
  basis.products.resize(problem.norms.size());
  for (std::size_t i = 0; i < 2; ++i)
  {
    basis.sketches[i].resize(problem.norms.size());
    basis.sketched[i] = inner_products(basis.S, problem.sides[i].forces);
  }
  return basis;
}

Index extend(HarmonicBasis& basis, MultiVector X)
{
  const Index gained = extend_orthonormal(basis.V, std::move(X)), size = basis.size();
  if (gained == 0) return 0;
  const MultiVector W = columns_from(basis.V, size - gained);
  for (std::size_t i = 0; i < 2; ++i) append_rows(basis.forces[i], inner_products(W, basis.problem.sides[i].forces));
  for (std::size_t k = 0; k < basis.products.size(); ++k)
  {
    const std::array images = {product(basis.problem.sides[0].matrices[k], W),
                               product(basis.problem.sides[1].matrices[k], W)};
    for (std::size_t i = 0; i < 2; ++i) append_columns(basis.sketches[i][k], inner_products(basis.S, images[i]));
    MatrixXd& A = basis.products[k];
    A.conservativeResize(size, size);
    A.rightCols(gained) = inner_products(basis.V, images[0]);
    A.bottomRows(gained) = inner_products(images[1], basis.V);
  }
  return gained;
}

std::array<MatrixXcd, 2> solve_at(double omega, const HarmonicBasis& basis, Index size)
{
  const Eigen::PartialPivLU<MatrixXcd> Q(sum_at(omega, basis.products, size, size));
  return {Q.solve(basis.forces[0].topRows(size).cast<Complex>()),
          Q.transpose().solve(basis.forces[1].topRows(size).cast<Complex>())};
}

HarmonicScan scan(const HarmonicBasis& basis, std::span<const double> omega, Index size, double tolerance)
{
  const auto count = static_cast<Index>(omega.size());
  const Index b = basis.problem.sides[0].forces.columns(), c = basis.problem.sides[1].forces.columns();
  HarmonicScan result{MatrixXcd::Zero(b * c, count), MatrixXd::Zero(b + c, count), MatrixXd::Zero(b + c, count), b};
  const MPI_Comm comm = basis.V.comm;
  for (Index f = rank_of(comm); f < count; f += ranks_of(comm))
  {
    const double at = omega[static_cast<std::size_t>(f)];
    const auto [a, d] = solve_at(at, basis, size);
    result.receptance.col(f) = (basis.forces[1].topRows(size).transpose() * a).reshaped();
    estimate_residuals(basis, ResponseEnd::driven, at, a, tolerance, result.residuals.col(f).head(b),
                       result.defects.col(f).head(b));
    estimate_residuals(basis, ResponseEnd::read, at, d, tolerance, result.residuals.col(f).tail(c),
                       result.defects.col(f).tail(c));
  }
  for (MatrixXd* part : {&result.residuals, &result.defects}) // zeros but on one rank: the sums are exact
    MPI_Allreduce(MPI_IN_PLACE, part->data(), to_int(part->size()), MPI_DOUBLE, MPI_SUM, comm);
  MPI_Allreduce(MPI_IN_PLACE, result.receptance.data(), to_int(2 * result.receptance.size()), MPI_DOUBLE, MPI_SUM,
                comm);
  return result;
}

MultiVector dynamic_image(const HarmonicSide& side, Complex s, const MultiVector& x)
{
  MultiVector image{x.comm, MatrixXd::Zero(x.entries.rows(), 2)};
  const auto factor = factors_at(s);
  for (std::size_t k = 0; k < side.matrices.size(); ++k)
  {
    const MatrixXd Ax = product(side.matrices[k], x).entries;
    image.entries.col(0) += factor[k].real() * Ax.col(0) - factor[k].imag() * Ax.col(1);
    image.entries.col(1) += factor[k].imag() * Ax.col(0) + factor[k].real() * Ax.col(1);
  }
  return image;
}

MultiVector residual_of(const HarmonicBasis& basis, ResponseEnd side, Index force, double omega,
                        const Eigen::VectorXcd& a)
{
  const HarmonicSide& own = basis.problem.of(side);
  MultiVector residual = dynamic_image(own, Complex(0, omega), combination(basis.V, parts_of(a)));
  residual.entries.col(0) -= own.forces.entries.col(force);
  return residual;
}

} // namespace squeal
