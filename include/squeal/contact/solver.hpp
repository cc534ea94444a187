#pragma once
/// Contact with Coulomb friction on the condensed operator (src/README.md, sections 4.4, 4.6, 4.7): find r with w = W r
/// + b and every pair's law of pair_law.hpp. Every solver has the same residual, the natural map of a pair |r - proj(r
/// - rho w)| with rho = 1/W_ii. It is over the largest reaction, or over rho max|b| where that is smaller, and always
/// of W itself in double precision.
///
/// gauss_seidel: one exact local solve a pair and sweep. Each change of a reaction is followed by w; pairs that no
/// longer move are passed over. A large W is swept over through its near field, in single precision, by several ranks
/// side by side: each then learns what the others changed. One product with W between sweeps and the verdict closes
/// the residual. Where that does not help, the sweeps read W itself. From the fifth on they are combined (Anderson).
/// fixed_point: the paper's; without friction it contracts for 0 < rho < 2/lambda_max(W), at a rate set by cond(W).
///
/// Caveat: neither is sure to converge where mu couples sliding and pressure strongly; the result says so.
#include "squeal/base/petsc.hpp"
#include "squeal/base/words.hpp"
#include "squeal/contact/contact_operator.hpp"

namespace squeal
{

/// The method of the sweeps.
enum class ContactSolver
{
  gauss_seidel,
  fixed_point,
};

template <> inline constexpr std::array words_of<ContactSolver> = {"gauss_seidel", "fixed_point"};

/// How contact problems are solved.
struct ContactSettings
{
  ContactSolver solver = ContactSolver::gauss_seidel;
  double tolerance = 1e-10; // on the residual
  PetscInt max_iterations = 1000;
  double rho = 0; // of the fixed point, over 1/lambda_max(W); 0: chosen, and halved when the residual grows
};

/// How one problem ended.
struct ContactResult
{
  int iterations = 0; // sweeps
  double residual = 0;
  bool converged = false;
};

/// The last solutions of one trajectory, latest first, and W times them: a warm start then needs no product with W.
struct ContactMemory
{
  std::vector<std::vector<double>> r, Wr;
  int since_read = 0; // solutions accepted since W was last read
};

/// One problem. `r`: start in, solution out.
struct ContactProblem
{
  const std::vector<double>& b;
  std::vector<double>& r;
  ContactMemory& memory;
};

/// Solves a problem from its `r`, which becomes the solution [N]. A problem that does not converge says so in its
/// result. On rank 0, or collective of the ranks that share W, with the same problem on each.
ContactResult solve_contact(const ContactOperator& W, const PairFriction& friction, const ContactSettings& settings,
                            const ContactProblem& problem);

} // namespace squeal
