#pragma once
/// The symmetric eigenproblem K y = omega^2 M y of the real modes. Small problems are solved by LAPACK. Large ones are
/// solved by block Krylov spaces about shifts that rise from just below zero (after Grimes, Lewis, Simon 1994). By
/// Sylvester's law the factor at each shift counts the eigenvalues below it, so that none is missed.
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/modes.hpp"

#include <map>

namespace squeal
{

/// -1e-8 trace(K)/trace(M) [1/s2], just below zero for any finite element model. K - shift M is positive definite also
/// where a free body leaves K singular.
double shift_below_zero(Mat M, Mat K);

/// Counts the omega below a limit: of a small problem from all eigenvalues, of a large one by the inertia of a factor,
/// whose result is kept.
struct RealCount
{
  ShiftInvert pencil;          // of a large problem
  std::vector<double> all;     // eigenvalues omega^2 of a small problem
  std::map<double, int> below; // the counts so far
};

RealCount make_real_count(Mat M, Mat K, int dense_limit);

/// The number of eigenvalues below omega [rad/s].
int count_below(RealCount& count, double omega);

/// All omega from `least` to `top` [rad/s], in descending order. None if the search does not converge. An omega that is
/// missed makes a count below some limit too large, not too small.
std::vector<double> omegas_between(RealCount& count, double least, double top);

/// The lowest `count` modes, or all if there are fewer; shapes are y.
RealModes solve_real_modes(Mat M, Mat K, int count, int dense_limit);

/// All modes with frequency below `band` [Hz]; shapes are y.
RealModes solve_real_modes_below(Mat M, Mat K, double band, int dense_limit);

} // namespace squeal
