#pragma once
/// The symmetric eigenproblem K y = omega^2 M y under the real modes: SLEPc's Krylov-Schur, shift-inverted just below
/// zero, its completeness certified by the inertia of K - omega^2 M (Sylvester's law); LAPACK when small.
#include "squeal/analysis/modes.hpp"

namespace squeal
{

/// Just below zero for any finite element model: -1e-8 trace(K)/trace(M) [1/s2]. A free body leaves K singular, and
/// K - shift M is positive definite still.
double shift_below_zero(Mat M, Mat K);

/// K - shift M
Owned<Mat> shifted(Mat M, Mat K, double shift);

/// How many omega lie below `band` [Hz].
int count_real_modes(Mat M, Mat K, double band, int dense_limit);

/// The lowest `count`, or as many as there are; shapes are y.
RealModes solve_real_modes(Mat M, Mat K, int count, int dense_limit);

/// -modes_dense_limit
int dense_limit_option();

} // namespace squeal
