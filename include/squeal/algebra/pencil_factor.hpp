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

/// The order of elimination is found once and serves every shift. Members are collective, but for those that return a
/// number.
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
  static void solve_by_columns(Parts& parts, MultiVector& Y);
  static void solve_by_rows(Parts& parts, MultiVector& Y);
  std::unique_ptr<Parts> parts_;
};

/// Memory of a PencilFactor of K and M on all ranks together [bytes], by the forecast of a factor of K.
double forecast_pencil(const FactorForecast& forecast, double entries_of_K, const PencilOptions& options,
                       MPI_Comm comm);

} // namespace squeal
