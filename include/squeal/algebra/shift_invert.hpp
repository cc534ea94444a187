#pragma once
/// The factor of K - shift M by MUMPS, with METIS's nested dissection (src/README.md, section 8.6).
/// It takes MUMPS's own interface, since PETSc's has no way to pass an order of elimination.
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/algebra/multivector.hpp"

#include <memory>
#include <vector>

namespace squeal
{

/// The part of a factor that is kept.
enum class Keep
{
  factor, // L D L' of a symmetric K - shift M
  count,  // of eigenvalues below the shift alone
  lu,     // L U of an unsymmetric one
};

/// Options of all factors by MUMPS of the modes.
struct PencilOptions
{
  PetscInt room = 30;            // [%] memory beyond MUMPS's estimate to start with; it grows where that is too little
  double whole_limit = 0.2;      // [GB] of a factor that every rank makes whole
  const char* prefix = "modes_"; // of MUMPS's own controls in the database
};

/// A nested dissection, on every rank. It serves every matrix of nearly the same pattern.
struct EliminationOrder
{
  std::vector<int> position; // of each degree of freedom, counted from one as MUMPS does
  double entries = 0;        // of a symmetric factor
};

/// By the lower triangle of K. Collective.
EliminationOrder elimination_order(Mat K);

/// The order of elimination is found once and serves every shift. Where memory would not hold the factor beside all
/// else, it is kept in files of the checkpoints' folder. Members are collective, but for those that return a number.
class PencilFactor
{
public:
  /// `M` may be null: K alone is factored. `order`: one that is known; null: found here.
  PencilFactor(Mat K, Mat M, Keep keep, const PencilOptions& options, const EliminationOrder* order = nullptr);
  ~PencilFactor();

  /// Returns false if the shift is an eigenvalue. Throws LibraryError if memory runs out.
  bool factorise(double shift);

  /// The number of eigenvalues below the shift (Sylvester's law of inertia). Not of Keep::lu.
  int negative_pivots() const;

  /// (K - shift M)^-1 X; not of Keep::count.
  MultiVector solve(const MultiVector& X) const;

  double entries() const;         // of the factor, on all ranks that share it
  double foreseen_memory() const; // of these ranks [bytes]; no factor needs to be made

private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// Memory of a PencilFactor of K and M on all ranks together [bytes], by the forecast of a factor of K. Collective.
double forecast_pencil(const FactorForecast& forecast, double entries_of_K, Keep keep, const PencilOptions& options,
                       MPI_Comm comm);

// The eigenvalues theta of K y = theta M y nearest a real shift. A block Krylov space of (K - shift
// M)^-1 M finds them (src/README.md, section 8.7).
//
// Blocks are used for two reasons. Brakes have many nearly equal modes (doublets of a disc, one mode for each pin). A
// space grown from a single vector finds these late or never. MUMPS reads its factor once for a block. There are no
// restarts: the caller moves the shift instead. All functions are collective. Error: memory runs out (LibraryError).

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
