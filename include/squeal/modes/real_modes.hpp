#pragma once
/// Real modes, K x = omega^2 M x (src/README.md, section 3.6). Small problems are solved by LAPACK, large ones in
/// slices of frequency by block Krylov spaces (shift_invert.hpp). By Sylvester's law the factor at the end of the band
/// counts the eigenvalues below it. All functions are collective. Error: memory runs out, or some motion has neither
/// mass nor stiffness.
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/modes.hpp"

namespace squeal
{

/// -1e-8 trace(K)/trace(M) [1/s2], just below zero for any finite element model. K - shift M is positive definite also
/// where a free body leaves K singular.
double shift_below_zero(Mat M, Mat K);

/// The number of eigenvalues of K x = theta M x below `limit` [1/s2], or below a slightly lower limit where that is
/// one.
struct Inertia
{
  double limit = 0;
  int below = 0;
};

/// The count below a limit by a factor that is not kept.
Inertia inertia_at(double limit, Mat M, Mat K, const PencilOptions& options, const EliminationOrder& order);

/// All modes with frequency below `band` [Hz]. Shapes are x, in the rows of K.
RealModes solve_real_modes_below(Mat M, Mat K, double band, const ModesOptions& options);

} // namespace squeal
