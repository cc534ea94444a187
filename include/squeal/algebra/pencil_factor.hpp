#pragma once
/// The factor of K - shift M by MUMPS (src/README.md, section 8.6).
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/algebra/multivector.hpp"

#include <memory>

namespace squeal
{

/// The property of the pencil that its factor makes use of.
enum class Symmetry
{
  none,      // L U
  symmetric, // L D L', which counts eigenvalues
};

/// Options of all factors by MUMPS of the modes.
struct PencilOptions
{
  PetscInt room = 30;        // [%] memory beyond MUMPS's estimate to start with; it grows where that is too little
  double whole_limit = 0.05; // [GB] of a K whose factor every rank makes whole
};

/// The order of elimination is found once and serves every shift. Members are collective, but for negative_pivots.
class PencilFactor
{
public:
  PencilFactor(Mat K, Mat M, Symmetry symmetry, const PencilOptions& options);
  ~PencilFactor();

  /// Returns false if the shift is an eigenvalue. Throws LibraryError if memory runs out.
  bool factorise(double shift);

  /// The number of eigenvalues below the shift (Sylvester's law of inertia). For Symmetry::symmetric only.
  int negative_pivots() const;

  /// (K - shift M)^-1 X
  MultiVector solve(const MultiVector& X) const;

  /// (K - shift M)'^-1 X
  MultiVector solve_transposed(const MultiVector& X) const;

private:
  struct Parts;
  template <class Solve> MultiVector solve_with(const MultiVector& X, const Solve& solution_of) const;
  std::unique_ptr<Parts> parts_;
};

/// Memory of a PencilFactor of K and M on all ranks together [bytes], by the forecast of a factor of K.
double forecast_pencil(const FactorForecast& forecast, double entries_of_K, Symmetry symmetry,
                       const PencilOptions& options, MPI_Comm comm);

} // namespace squeal
