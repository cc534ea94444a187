#pragma once
/// The symmetric eigenproblem K y = omega^2 M y under the real modes: SLEPc's Krylov-Schur around shifts that climb
/// from just below zero, complete by Sylvester's law, the factor at each shift counting what lies below it (after
/// Grimes, Lewis, Simon 1994); LAPACK when small.
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/modes/modes.hpp"

#include <map>

namespace squeal
{

/// Just below zero for any finite element model: -1e-8 trace(K)/trace(M) [1/s2]. A free body leaves K singular, and
/// K - shift M is positive definite still.
double shift_below_zero(Mat M, Mat K);

/// How many omega lie below others, by a factor each or, when small, all of them once; what was asked is kept.
struct RealCount
{
  ShiftInvert pencil;
  std::vector<double> all; // eigenvalues, when small
  std::map<double, int> below;
};

RealCount make_real_count(Mat M, Mat K, int dense_limit);

/// Below omega [rad/s].
int count_below(RealCount& count, double omega);

/// All omega from `least` to `top` [rad/s], nearest `top` first. None if the search does not end. One that it misses
/// makes the count below others too large, not too small.
std::vector<double> omegas_between(RealCount& count, double least, double top);

/// The lowest `count`, or as many as there are; shapes are y.
RealModes solve_real_modes(Mat M, Mat K, int count, int dense_limit);

/// All with omega below `band` [Hz].
RealModes solve_real_modes_below(Mat M, Mat K, double band, int dense_limit);

/// -modes_dense_limit
int dense_limit_option();

} // namespace squeal
