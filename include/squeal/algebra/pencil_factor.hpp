#pragma once
/// The factor of K - shift M by MUMPS itself, in METIS's order, which PETSc cannot hand to it: by nested dissection L
/// of an elastic block of 32 670 degrees of freedom has 14e6 entries, by the orderings that MUMPS brings along 17e6.
/// Right-hand sides pass through rank 0.
#include "squeal/algebra/multivector.hpp"

#include <memory>

namespace squeal
{

enum class Symmetry
{
  none,      // L U
  symmetric, // L D L', which counts eigenvalues
};

/// It moves from shift to shift; the order is found once. K and M are lent.
class PencilFactor
{
public:
  PencilFactor(Mat K, Mat M, Symmetry symmetry);
  ~PencilFactor();

  /// False if the shift is an eigenvalue. LibraryError: memory ran out.
  /// Option: -modes_factor_room [%] beyond MUMPS's estimate of its memory; it grows by itself.
  bool factorise(double shift);

  /// As many eigenvalues lie below the shift (Sylvester). Symmetric only.
  int negative_pivots() const;

  Block solved(const Block& X) const;

private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

} // namespace squeal
