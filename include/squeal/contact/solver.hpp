#pragma once
/// Contact with Coulomb friction on the condensed operator (method, section 4): find r with w = W r + b,
///     0 <= w_n _|_ r_n >= 0,   |r_t| <= mu r_n,   r_t opposes w_t.
/// Residual, one measure for every solver: the natural map per pair, |r - proj(r - rho w)| with rho = 1/W_ii, over the
/// largest reaction, or over rho max|b| where that is smaller.
///
/// gauss_seidel: one exact local solve a pair and sweep; w follows each change of a reaction, so that a sweep reads W
/// once at most, and is formed afresh before the residual is believed where rounding could matter. Under-relaxed when
/// 50 sweeps bring nothing.
/// fixed_point: the paper's r_n <- max(0, r_n - rho w_n), r_t <- proj_disc(mu r_n)(r_t - rho w_t); contracts without
/// friction for 0 < rho < 2/lambda_max(W), at a rate set by cond(W).
///
/// Caveat: neither is sure to converge where mu couples sliding and pressure strongly; the result says so.
#include <string>
#include <vector>

namespace squeal
{

struct ContactSettings
{
  std::string solver = "gauss_seidel"; // block Gauss-Seidel, or the paper's "fixed_point"
  double tolerance = 1e-10;            // on the residual
  int max_iterations = 1000;
  double rho = 0; // of the fixed point, over 1/lambda_max(W); 0: chosen, and halved when the residual grows
};

struct ContactResult
{
  int iterations = 0; // sweeps
  double residual = 0;
  bool converged = false;
};

/// `W` row-major symmetric (size x size, size = pairs * (1 + directions)); `r` warm start in, solution out.
ContactResult solve_contact(const std::vector<double>& W, const std::vector<double>& b, int pairs, int directions,
                            double friction, const ContactSettings& settings, std::vector<double>& r);

/// w = W r + b; rows of W whose reaction is zero are not read.
std::vector<double> relative_velocity(const std::vector<double>& W, const std::vector<double>& b,
                                      const std::vector<double>& r);

/// The residual above of reactions r with w = W r + b.
double contact_residual(const std::vector<double>& W, const std::vector<double>& w, int pairs, int directions,
                        double friction, const std::vector<double>& r);

} // namespace squeal
