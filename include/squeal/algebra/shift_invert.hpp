#pragma once
/// The eigenvalues theta of K y = theta M y, symmetric or not, nearest a real shift, by a block Krylov space of
/// (K - shift M)^-1 M.
///
/// Blocks, because brakes have many nearly equal modes (doublets of a disc, one a pin), which a space grown from a
/// single vector finds late or never, and because MUMPS reads its factor once for a block. No restarts: a shift is
/// moved on instead.
#include "squeal/algebra/pencil_factor.hpp"

#include <complex>

namespace squeal
{

struct ShiftInvert
{
  Mat K = nullptr, M = nullptr; // lent
  double shift = 0;
  std::unique_ptr<PencilFactor> factor; // of K - shift M
};

ShiftInvert make_shift_invert(Mat K, Mat M, Symmetry symmetry);

/// To the shift, or a little below it where it is an eigenvalue. LibraryError: memory ran out.
void move_to(ShiftInvert& pencil, double shift);

/// Orthonormal basis of the invariant subspace of all theta with |theta - shift| <= reach.
struct Nearest
{
  Block space;
  std::vector<std::complex<double>> theta;
  double reach = 0;
  bool converged = false; // or the space grew to its limit, and nothing is given
};

/// At least `count` of them, and at least those within `radius`; `tolerance`: by how much the space misses being
/// invariant, relative to the eigenvalues of the inverse.
Nearest solve_nearest(const ShiftInvert& pencil, PetscInt count, double radius, double tolerance);

/// MUMPS does the factorisations of a spectral transformation of SLEPc's.
void use_mumps(ST transformation);

} // namespace squeal
