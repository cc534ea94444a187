#include "squeal/algebra/quadratic_residual.hpp"

namespace squeal
{

void quadratic_residual(Mat M, Mat C, Mat K, std::complex<double> lambda, Vec y_r, Vec y_i, Vec real, Vec imaginary)
{
  const std::complex<double> square = lambda * lambda;
  const Owned<Vec> a = zeros_like(real), b = zeros_like(real);
  check(MatMult(K, y_r, real));
  check(MatMult(K, y_i, imaginary));
  for (const auto& [A, factor] : {std::pair{C, lambda}, std::pair{M, square}})
  {
    check(MatMult(A, y_r, a));
    check(MatMult(A, y_i, b));
    check(VecAXPBYPCZ(real, factor.real(), -factor.imag(), 1, a, b));
    check(VecAXPBYPCZ(imaginary, factor.imag(), factor.real(), 1, a, b));
  }
}

} // namespace squeal
