#pragma once
/// The residual of the quadratic eigenproblem with distributed matrices and real arithmetic. Collective.
#include "squeal/base/petsc.hpp"

#include <complex>

namespace squeal
{

/// Borrowed.
struct QuadraticMatrices
{
  Mat M, C, K;
};

/// Borrowed; the two parts of a complex vector.
struct ComplexVector
{
  Vec real, imaginary;
};

/// residual = (lambda^2 M + lambda C + K) y
void quadratic_residual(const QuadraticMatrices& A, std::complex<double> lambda, ComplexVector y,
                        ComplexVector residual);

} // namespace squeal
