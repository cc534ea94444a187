#pragma once
/// Unilateral contact with friction of known direction, in gaps and reactions (src/README.md, section 2.4):
///     N g = q + M r,   0 <= g _|_ r >= 0.
/// N is the identity, unless the structure is held by contact only (equilibrium/equilibrium.hpp says how it arises).
///
/// Status iteration: with the pairs split into closed (g = 0) and open (r = 0) the problem is linear; every pair whose
/// sign is wrong changes status (block principal pivoting, Judice and Pires 1994). When that stops reducing their
/// number, Lemke's path takes over. Arithmetic of one rank.
#include <Eigen/LU>
#include <memory>
#include <optional>
#include <vector>

namespace squeal
{

/// N g = q + M r over the pairs; matrices are pairs x pairs.
struct ComplementarityProblem
{
  Eigen::MatrixXd N, M;  // N empty: identity
  std::vector<double> q; // [m] gaps without reactions
  double compliance = 0; // [m/N] typical of M: reactions times it are compared with gaps
};

/// Gaps and reactions of a split, one a pair.
struct SplitSolution
{
  std::vector<double> gap, reaction; // [m, N], zero by the split where they are not unknown
  double defect = 0;                 // of the linear equations, relative: not small if the split is singular
};

/// N g - M r = rhs with g = 0 on closed pairs and r = 0 on open ones, factored once for several right-hand sides; least
/// squares where that is singular. Error: an entry is not finite.
class SplitSolver
{
public:
  /// `problem` is borrowed.
  SplitSolver(const ComplementarityProblem& problem, std::vector<char> closed);
  SplitSolution solve(const std::vector<double>& rhs) const;

private:
  const ComplementarityProblem& problem_;
  std::vector<char> closed_;
  Eigen::MatrixXd storage_;                                                 // of the factors
  std::optional<Eigen::PartialPivLU<Eigen::Ref<Eigen::MatrixXd>>> factors_; // none if a pivot is lost in rounding
};

/// How the search for a split ended.
enum class StatusOutcome
{
  converged,
  impossible,    // there is no solution
  not_converged, // none was found, and nothing proves that there is none
};

/// The split that the search ended with, one entry a pair.
struct StatusSolution
{
  StatusOutcome outcome = StatusOutcome::not_converged;
  int iterations = 0;
  std::vector<char> closed;
  std::vector<double> gap, reaction;   // [m, N]; empty unless converged
  std::unique_ptr<SplitSolver> solver; // of this split; null unless converged
};

/// Solves by status iteration from the split `first`, in at most `max_iterations` splits, then by Lemke's path from it
/// and by trying all splits of up to 12 pairs. "Impossible" is proved: no split fits, or no reactions at all keep every
/// gap from being negative. The solver borrows the problem. Error: an entry is not finite.
StatusSolution solve_by_status(const ComplementarityProblem& problem, const std::vector<char>& first,
                               int max_iterations);

/// Whether the symmetric part of M is positive definite, N being the identity: then there is one solution and no other.
bool has_one_solution(const ComplementarityProblem& problem);

/// The largest natural map of a pair, |r - max(0, r - rho g)|, over the largest reaction; over the largest rho |pull|
/// where no pair has a reaction.
double unilateral_residual(const std::vector<double>& reaction, const std::vector<double>& gap,
                           const std::vector<double>& rho, const std::vector<double>& pull);

} // namespace squeal
