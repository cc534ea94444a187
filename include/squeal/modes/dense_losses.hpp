#pragma once
/// Dense quadratic eigenproblems with loss factors (src/README.md, section 3.11):
///     Q(lambda) y = 0,   Q = lambda^2 M + lambda C + K + f K_loss
/// f is i, of complex stiffness K + i K_loss, where lambda oscillates (Im(lambda) > 0); 0 of a
/// real lambda. Matrices are square, of one size and not symmetric in general.
#include "squeal/algebra/dense_eigenproblems.hpp"

#include <array>
#include <optional>
#include <span>
#include <string>

namespace squeal
{

/// f
std::complex<double> loss_factor_of(std::complex<double> lambda);

/// Of M, C, K and K_loss.
using ComplexFactors = std::array<std::complex<double>, 4>;

/// lambda^2, lambda, 1 and f
ComplexFactors loss_factors(std::complex<double> lambda);

/// M, C, K and K_loss.
using LossyMatrices = std::array<Eigen::MatrixXd, 4>;

/// The sum of f_k A_k.
Eigen::MatrixXcd sum(const LossyMatrices& A, const ComplexFactors& factors);

/// Makes a pair that is nearly one of the problem its own, by Newton's method on (lambda, y). Returns whether it found
/// one that oscillates.
bool solve_lossy(const LossyMatrices& problem, DenseEigenpair& pair);

/// The same beside other pairs of the problem, by Newton's method without what its vector has of them: near ones would
/// draw it to themselves.
bool solve_lossy_beside(const LossyMatrices& problem, std::span<const DenseEigenpair> others, DenseEigenpair& pair);

/// What pairs without K_loss become as it grows from zero, followed together so that neighbours stay apart.
std::vector<DenseEigenpair> with_losses(const LossyMatrices& problem, const std::vector<DenseEigenpair>& without);

/// Pairs of neighbouring frequency. Those from `first` to `end` are solved together, on the span of the vectors of all.
struct NeighbouringPairs
{
  std::vector<std::size_t> places; // among the eigenvalues
  std::size_t first = 0, end = 0;  // of the places
};

/// Two pairs are one where both are less apart: lambdas over |lambda|, and the sine between right vectors. Those of
/// defective pairs are as far apart as the root of rounding at least.
inline constexpr double same_lambda = 1e-8, same_vector = 1e-9;

/// Whether Newton's method led two pairs to one, by such limits. Of near pairs it leaves vectors off by rounding over
/// their distance, so that looser ones tell where to look.
struct Sameness
{
  double lambda = same_lambda, vector = same_vector;
};

inline constexpr Sameness perhaps{1e-7, 1e-4};

bool are_one(const DenseEigenpair& a, const DenseEigenpair& b, const Sameness& limits = {});

/// The lambda of a pair with losses that is another one's as well, if there is any.
std::optional<std::complex<double>> doubled_lambda(const std::vector<TwoSidedPair>& pairs);

/// The sentence that says so.
std::string describe_doubled(std::complex<double> lambda);

/// Of pairs in a group, at most: what serves where modes differ by more than losses change them, in little time, and
/// what a cluster of modes may need.
inline constexpr std::size_t usual_group = 16, largest_group = 64;

/// All eigenvalues that oscillate, by frequency.
std::vector<NeighbouringPairs> neighbouring_pairs(const std::vector<std::complex<double>>& eigenvalues,
                                                  std::size_t in_group);

/// What pairs without K_loss become with it, both vectors; from the matrices of rank 0, on every rank. Pairs that do
/// not oscillate stay. Two may become one: of a problem that is not yet exact, or beyond what was asked for.
/// Collective.
void add_losses_shared(MPI_Comm comm, const LossyMatrices& problem, std::vector<TwoSidedPair>& pairs);

/// Makes pairs that are nearly those of the problem its own; from the matrices of rank 0,
/// on every rank. Collective.
void refine_lossy_shared(MPI_Comm comm, const LossyMatrices& problem, std::vector<TwoSidedPair>& pairs);

} // namespace squeal
