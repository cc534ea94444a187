#pragma once
/// The residual of the quadratic eigenproblem with distributed matrices and real arithmetic.
#include "squeal/base/petsc.hpp"

#include <complex>

namespace squeal
{

/// real + i imaginary = (lambda^2 M + lambda C + K) (y_r + i y_i)
void quadratic_residual(Mat M, Mat C, Mat K, std::complex<double> lambda, Vec y_r, Vec y_i, Vec real, Vec imaginary);

} // namespace squeal
