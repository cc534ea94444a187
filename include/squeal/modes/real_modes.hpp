#pragma once
/// Real modes, K x = omega^2 M x (src/README.md, section 3.6). Small problems are solved by LAPACK, large ones in
/// slices of frequency by block Krylov spaces (shift_invert.hpp). By Sylvester's law the factor at the end of the band
/// counts the eigenvalues below it. All functions are collective. Error: memory runs out, or some motion has neither
/// mass nor stiffness.
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/modes.hpp"

#include <map>

namespace squeal
{

/// -1e-8 trace(K)/trace(M) [1/s2], just below zero for any finite element model. K - shift M is positive definite also
/// where a free body leaves K singular.
double shift_below_zero(Mat M, Mat K);

/// Counts the omega below a limit: of a small problem from all eigenvalues, of a large one by the inertia of a factor.
/// Counts are kept.
struct RealCount
{
  Mat K = nullptr, M = nullptr; // borrowed
  PencilOptions options{};
  std::vector<double> all{};     // eigenvalues omega^2 of a small problem
  std::map<double, int> below{}; // the counts so far
  EliminationOrder order{};      // of a large problem, from the first count on
  ShiftInvert pencil{};          // the same
};

/// A count for K x = omega^2 M x. Borrows M and K.
RealCount make_real_count(Mat M, Mat K, const ModesOptions& options);

/// The number of eigenvalues below omega [rad/s].
int count_below(RealCount& count, double omega);

/// Of K, found once.
const EliminationOrder& order_of(RealCount& count);

/// Gives back the memory of the factor. A further count makes it again.
void free_factor(RealCount& count);

/// All omega from `least` to `top` [rad/s], in descending order. None if the search does not converge. An omega that is
/// missed makes a count below some limit too large, not too small.
std::vector<double> omegas_between(RealCount& count, double least, double top);

/// The lowest `count` modes, or all if there are fewer. Shapes are x, in the rows of K.
RealModes solve_real_modes(Mat M, Mat K, PetscInt count, const ModesOptions& options);

/// All modes with frequency below `band` [Hz]. Shapes are x, in the rows of K.
RealModes solve_real_modes_below(Mat M, Mat K, double band, const ModesOptions& options);

} // namespace squeal
