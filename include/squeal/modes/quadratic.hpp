#pragma once
/// The quadratic eigenproblem (lambda^2 M + lambda C + K) y = 0, unsymmetric (src/README.md, sections 3.4, 8.8).
///
/// The problem, its pairs, and SLEPc's two-level Arnoldi method (TOAR; Lu, Su, Bai 2016), shift-inverted near zero,
/// which the program's own search is compared with (pair_search.hpp). Time is scaled by the band, lambda = 2 pi band
/// nu; without that, growth rates lose their third digit.
///
/// Backward error of a pair (Tisseur 2000), in 1-norms of the matrices and 2-norms of the vectors:
///     eta = |(lambda^2 M + lambda C + K) y| / ((|lambda|^2 |M| + |lambda| |C| + |K|) |y|)
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"

#include <array>
#include <complex>

namespace squeal
{

/// (lambda^2 M + lambda C + K) y = 0.
struct QuadraticProblem
{
  Owned<Mat> M, C, K; // AIJ, of one layout
};

/// C without the viscous equivalent of loss factors, under which modes would be overdamped far above its frequency. The
/// structure has a K_loss. Collective.
Owned<Mat> without_loss(Mat C, const Structure& structure);

/// The stiffness of loss factors, Y'.Z; null without them. Collective.
Owned<Mat> sliding_loss(const Structure& structure, const LinearisedSliding& linearised);

/// That of small motions about sliding, Y'.Z, with C without the viscous equivalent of loss factors. Collective.
QuadraticProblem sliding_problem(const Structure& structure, const LinearisedSliding& linearised);

/// An eigenvalue with its vector.
struct Eigenpair
{
  std::complex<double> lambda; // [1/s]
  Owned<Vec> real, imaginary;  // of y; 2-norm of y is 1
  double backward_error = 0;
};

/// Which eigenvalues are sought: least <= |lambda|^2 < limit [1/s2], Im > 0, or real and positive.
struct Window
{
  double least = 0, limit = 0;
  bool has_decays = false; // real negative lambda, too
  bool holds(std::complex<double> lambda) const;
};

/// The solver's own options have the prefix -modes_: -modes_pep_tol, -modes_st_…
struct QuadraticSettings
{
  double band = 0;  // [Hz] every pair with |lambda| <= 2 pi band
  double shift = 0; // of large problems: real, near zero, in parts of 2 pi band, not an eigenvalue; 0 if K is regular
  int expected = 0; // pairs in the band, for a start
};

/// outcome: "converged" or "not converged" (the band was not covered); residual: the largest backward error.
struct QuadraticSolution
{
  Outcome outcome;
  std::vector<Eigenpair> pairs{}; // Im > 0 in the band, and real positive ones; largest real part first
};

/// The pairs in the band by SLEPc's TOAR. Motions of a free body (|lambda|^2 below 1e-12 |K|/|M|) are no vibration and
/// are left out. Real negative lambda are among the pairs. Collective. Error: memory runs out.
QuadraticSolution solve_quadratic(const QuadraticProblem& problem, const QuadraticSettings& settings);

/// Sorts the pairs by falling real part, and sets outcome.residual to the largest backward error. Not collective.
void sort_and_measure(QuadraticSolution& solution);

/// Sizes of M [kg], C [N s/m] and K [N/m], for backward errors.
struct QuadraticNorms
{
  double M = 0, C = 0, K = 0; // 1-norms
};

/// The norms of the three matrices. Collective.
QuadraticNorms norms_of(const QuadraticProblem& problem);

/// |lambda|^2 up to which a motion is that of a free body, not a vibration: 1e-12 |K|/|M| [1/s2]. Not collective.
double vibration_floor(const QuadraticNorms& norms);

/// eta = |Q(lambda) y| / ((|lambda|^2 |M| + |lambda| |C| + |K|) |y|) [-]. Collective.
double backward_error(const QuadraticProblem& problem, const QuadraticNorms& norms, const Eigenpair& pair);

// Dense quadratic eigenproblems with loss factors (src/README.md, section 3.11):
//     Q(lambda) y = 0,   Q = lambda^2 M + lambda C + K + f K_loss
// f is i, of complex stiffness K + i K_loss, where lambda oscillates (Im(lambda) > 0); 0 of a real lambda. Matrices
// are square, of one size and not symmetric in general. An empty K_loss is zero. Functions whose name ends in _shared
// are collective and take the matrices of rank 0.

/// f
std::complex<double> loss_factor_of(std::complex<double> lambda);

/// Factors of M, C, K and K_loss.
using ComplexFactors = std::array<std::complex<double>, 4>;

/// lambda^2, lambda, 1 and f
ComplexFactors loss_factors(std::complex<double> lambda);

/// M, C, K and K_loss.
using LossyMatrices = std::array<Eigen::MatrixXd, 4>;

/// The sum of f_k A_k.
Eigen::MatrixXcd sum(const LossyMatrices& A, const ComplexFactors& factors);

/// All pairs with Im(lambda) >= 0 and |lambda| <= limit. Those that are real without K_loss stay as they are.
/// Collective.
std::vector<DenseEigenpair> solve_lossy_shared(MPI_Comm comm, const LossyMatrices& problem,
                                               Vectors which = Vectors::right, double limit = HUGE_VAL);

} // namespace squeal
