#include "squeal/algebra/quadratic_residual.hpp"

namespace squeal
{

void quadratic_residual(const QuadraticMatrices& A, std::complex<double> lambda, ComplexVector y,
                        ComplexVector residual)
{
  const auto [real, imaginary] = residual;
  const std::complex<double> square = lambda * lambda;
  const Owned<Vec> a = zeros_like(real), b = zeros_like(real);
  check(MatMult(A.K, y.real, real));
  check(MatMult(A.K, y.imaginary, imaginary));
  for (const auto& [matrix, factor] : {std::pair{A.C, lambda}, std::pair{A.M, square}})
  {
    check(MatMult(matrix, y.real, a));
    check(MatMult(matrix, y.imaginary, b));
    check(VecAXPBYPCZ(real, factor.real(), -factor.imag(), 1, a, b));
    check(VecAXPBYPCZ(imaginary, factor.imag(), factor.real(), 1, a, b));
  }
}

} // namespace squeal
