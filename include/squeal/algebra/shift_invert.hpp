#pragma once
/// The eigenvalues theta of K y = theta M y nearest a real shift. A block Krylov space of (K - shift
/// M)^-1 M finds them (src/README.md, section 8.7).
///
/// Blocks are used for two reasons. Brakes have many nearly equal modes (doublets of a disc, one mode for each pin). A
/// space grown from a single vector finds these late or never. MUMPS reads its factor once for a block. There are no
/// restarts: the caller moves the shift instead. All functions are collective. Error: memory runs out (LibraryError).
#include "squeal/algebra/pencil_factor.hpp"

namespace squeal
{

/// The pencil K - shift M, factored at its shift [units of theta].
struct ShiftInvert
{
  Mat K = nullptr, M = nullptr; // borrowed
  double shift = 0;
  std::unique_ptr<PencilFactor> factor{}; // of K - shift M
};

/// The pencil at shift 0, not yet factored. Collective. K and M are borrowed and must outlive it. `order`: one that is
/// known; null: found here.
ShiftInvert make_shift_invert(Mat K, Mat M, Keep keep, const PencilOptions& options,
                              const EliminationOrder* order = nullptr);

/// Factors K - shift M, or with a slightly lower shift where this one is an eigenvalue. Throws LibraryError if memory
/// runs out.
void move_to(ShiftInvert& pencil, double shift);

/// Orthonormal basis of the invariant subspace of all theta with |theta - shift| <= reach, and of guards.
struct Nearest
{
  MultiVector space;
  std::vector<double> theta;
  bool converged = false; // if not, the space grew to its limit, and theta is empty
};

/// The `count` nearest theta and all within `radius` of the shift. `tolerance`: the residual of the invariant
/// subspace, relative to the smallest |1/(theta - shift)| in it. `guards`: by this part of its size the space is wider,
/// of the next nearest theta, whose residual is larger.
Nearest solve_nearest(const ShiftInvert& pencil, PetscInt count, double radius, double tolerance, double guards = 0);

/// Sets a spectral transformation of SLEPc to shift-and-invert with MUMPS's LU, before it is set up.
void use_mumps(ST transformation);

} // namespace squeal
