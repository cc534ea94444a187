#pragma once
/// Contact with Coulomb friction on the condensed operator (method, section 4): find r with w = W r + b,
///     0 <= w_n _|_ r_n >= 0,   |r_t| <= mu r_n,   r_t opposes w_t.
/// Residual: the natural map per pair, |r - proj(r - rho w)| with rho = 1/W_ii, over the largest reaction.
#include <string>
#include <vector>

namespace squeal
{

struct ContactSettings
{
  std::string solver = "gauss_seidel"; // block Gauss-Seidel, or the paper's "fixed_point"
  double tolerance = 1e-10;
  int max_iterations = 1000;
  double rho = 0; // of the fixed point, over 1/lambda_max(W); 0: chosen
};

struct ContactResult
{
  int iterations = 0;
  double residual = 0;
  bool converged = false;
};

/// `W` row-major symmetric (size x size, size = pairs * (1 + directions)); `r` warm start in, solution out.
ContactResult solve_contact(const std::vector<double>& W, const std::vector<double>& b, int pairs, int directions,
                            double friction, const ContactSettings& settings, std::vector<double>& r);

} // namespace squeal
