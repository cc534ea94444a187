#pragma once
/// Eigenproblems of dense matrices, n x n column-major, solved whole by LAPACK on one rank.
#include "squeal/base/petsc.hpp"

#include <complex>
#include <vector>

namespace squeal
{

struct DenseEigenpair
{
  std::complex<double> lambda;
  std::vector<std::complex<double>> y;
};

/// All pairs with Im >= 0 and finite lambda; the collective form works on rank 0 and tells the others.
std::vector<DenseEigenpair> solve_dense_quadratic_shared(MPI_Comm comm, int n, const std::vector<double>& M,
                                                         const std::vector<double>& C, const std::vector<double>& K);
std::vector<DenseEigenpair> solve_dense_quadratic(int n, const std::vector<double>& M, const std::vector<double>& C,
                                                  const std::vector<double>& K);

/// Symmetric K y = lambda M y with M positive semidefinite and K - shift M positive definite, shift < 0: ascending
/// finite lambda, and M-normalised y one after the other.
void solve_dense_symmetric(int n, const std::vector<double>& M, const std::vector<double>& K, double shift,
                           std::vector<double>& lambda, std::vector<double>& y);

/// The whole matrix, column-major, on every rank. Collective.
std::vector<double> dense_copy(Mat A);

/// real, imaginary = (lambda^2 M + lambda C + K) (y_r + i y_i)
void quadratic_residual(Mat M, Mat C, Mat K, std::complex<double> lambda, Vec y_r, Vec y_i, Vec real, Vec imaginary);

} // namespace squeal
