#pragma once
/// The eigenvalues theta of K y = theta M y, symmetric or not, nearest a real shift, by a block Krylov space of
/// (K - shift M)^-1 M.
///
/// Blocks, because brakes have many nearly equal modes (doublets of a disc, one a pin), which a space grown from a
/// single vector finds late or never, and because MUMPS reads its factor once for a block. No restarts: a shift is
/// moved on instead.
#include "squeal/analysis/block.hpp"

#include <complex>

namespace squeal
{

/// A factor that moves from shift to shift; the ordering is found once.
struct ShiftInvert
{
  Mat K = nullptr, M = nullptr; // lent
  MatFactorType kind = MAT_FACTOR_CHOLESKY;
  double shift = 0;
  Owned<Mat> shifted, factor; // K - shift M
};

/// MAT_FACTOR_CHOLESKY: L D L' of symmetric K and M; MAT_FACTOR_LU: of any.
ShiftInvert make_shift_invert(Mat K, Mat M, MatFactorType kind);

/// To the shift, or a little below it where it is an eigenvalue. LibraryError: memory ran out.
/// Options: -modes_mat_mumps_...; room beyond MUMPS's estimate (icntl_14) grows by itself.
void move_to(ShiftInvert& pencil, double shift);

/// Sylvester: as many eigenvalues lie below the shift as its L D L' has negative pivots.
int negative_pivots(const ShiftInvert& pencil);

/// Orthonormal basis of the invariant subspace of all theta with |theta - shift| <= reach.
struct Nearest
{
  Block space;
  std::vector<std::complex<double>> theta;
  double reach = 0;
  bool converged = false; // or the space grew to its limit, and nothing is given
};

/// At least `count` of them, and at least those within `radius`.
Nearest solve_nearest(const ShiftInvert& pencil, PetscInt count, double radius);

/// MUMPS does the factorisations of a spectral transformation of SLEPc's.
void use_mumps(ST transformation);

} // namespace squeal
