#pragma once
/// The factor of Q(s) = s^2 M + s C + K at complex s, by MUMPS's complex arithmetic itself: PETSc knows only the one it
/// was built for, and real numbers make everything else twice as fast.
#include "squeal/analysis/complex_block.hpp"
#include "squeal/analysis/quadratic.hpp"

#include <complex>
#include <memory>

namespace squeal
{

/// It moves from s to s; the ordering is found once. The problem's matrices are lent.
class ComplexFactor
{
public:
  explicit ComplexFactor(const QuadraticProblem& problem);
  ~ComplexFactor();

  /// LibraryError: out of memory, or s is an eigenvalue.
  void move_to(std::complex<double> s);
  std::complex<double> s() const;

  /// Q(s)^-1 X
  ComplexBlock solved(const ComplexBlock& X) const;

private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

} // namespace squeal
