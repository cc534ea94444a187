#pragma once
/// What factors of a matrix will take, by their symbolic analysis (src/README.md, section 8.9).
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/algebra/pencil_factor.hpp"

namespace squeal
{

/// Of all ranks together.
struct FactorForecast
{
  FactorKind kind = FactorKind::automatic; // that it will be
  double bytes = 0;                        // of a Factor while it is made, without its Schur complement
  double symmetric = 0, not_symmetric = 0; // numbers in MUMPS's L D L' and L U of A while they are made
  double entries = 0;                      // of L of A alone
  double border_entries = 0;               // of E in a supernodal factor; 0: of another kind
  double operations = 0;                   // to make a Factor, on the rank that has most to do
  double inner_operations = 0;             // to make L L' of A alone, on one rank
};

/// Of a Factor of A and B, and of MUMPS's factors of A in the same order. B may be null. Collective.
FactorForecast forecast_factor(Mat A, Mat B, const FactorOptions& options);

/// Memory of a PencilFactor of K and M on all ranks together [bytes], by the forecast of a factor of K.
double forecast_pencil(const FactorForecast& forecast, double entries_of_K, Symmetry symmetry,
                       const PencilOptions& options, MPI_Comm comm);

} // namespace squeal
