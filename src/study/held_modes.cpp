#include "held_modes.hpp"

#include "squeal/modes/quadratic.hpp"
#include "squeal/reduction/sliding_basis.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// M, C, K and K_loss, of which some may be null.
using Matrices = std::array<Mat, 4>;

MultiVector scaled(const MultiVector& x, Complex factor)
{
  const Eigen::Matrix2d turn{{factor.real(), factor.imag()}, {-factor.imag(), factor.real()}};
  return {x.comm, x.entries * turn};
}

/// The sum of f_k A_k x.
MultiVector weighted_sum(const Matrices& matrices, const ComplexFactors& factors, const MultiVector& x)
{
  MultiVector sum{x.comm, Eigen::MatrixXd::Zero(x.entries.rows(), 2)};
  for (std::size_t k = 0; k < matrices.size(); ++k)
    if (matrices[k]) sum.entries += scaled(product(matrices[k], x), factors[k]).entries;
  return sum;
}

/// The factors of Q(lambda), where C has the viscous equivalent of the loss factors.
ComplexFactors factors_of(Complex lambda, const Structure& structure)
{
  ComplexFactors factors = loss_factors(lambda);
  if (structure.K_loss.get()) factors[3] -= lambda / structure.loss_omega;
  return factors;
}

/// The factors of Q's derivative.
ComplexFactors slopes_of(Complex lambda, const Structure& structure)
{
  return {2. * lambda, 1, 0, structure.K_loss.get() ? -1 / structure.loss_omega : 0};
}

/// Forces of the pairs without a compliance, from those of a motion on their pivots.
std::vector<Complex> forces_of_rigid_pairs(Mat operation, const MultiVector& forces)
{
  const Eigen::MatrixXd of_pairs = whole_product(operation, forces);
  std::vector<Complex> result;
  for (Index i = 0; i < of_pairs.rows(); ++i) result.emplace_back(of_pairs(i, 0), of_pairs(i, 1));
  return result;
}

/// Sets the reactions and the sides. `own`: matrices of the sliding structure, `transposed`: theirs.
void set_multipliers(const SensitivityProblem& problem, const Matrices& own, const Matrices& transposed, HeldMode& mode)
{
  const auto& [structure, interface, equilibrium] = problem.sliding;
  const ClosedContact& contact = problem.linearised.contact;
  const ComplexFactors factors = factors_of(mode.lambda, structure);
  mode.reactions = forces_of_rigid_pairs(contact.reaction, weighted_sum(own, factors, mode.right));
  mode.sides = forces_of_rigid_pairs(contact.normal_reaction, weighted_sum(transposed, factors, mode.left));
  const PairMotions of_right = pair_motions(interface, mode.right), of_left = pair_motions(interface, mode.left);
  for (std::size_t i = 0; i < mode.sides.size(); ++i)
  {
    const double compliance = compliance_of(interface, i);
    mode.sides[i] *= -1;
    if (!equilibrium.closed[i] || compliance == 0) continue;
    mode.reactions[i] = -of_right.normal[i] / compliance;
    mode.sides[i] = (of_left.normal[i] + of_left.friction[i]) / compliance;
  }
}

} // namespace

Eigen::VectorXcd pair_rows(const Interface& interface, const MultiVector& x)
{
  const Eigen::MatrixXd rows = whole_product(interface.B, x);
  return rows.col(0) + Complex(0, 1) * rows.col(1);
}

PairMotions pair_motions(const Interface& interface, const MultiVector& x)
{
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  const Eigen::VectorXcd motion = pair_rows(interface, x);
  const PairRows<Index> rows(interface.directions);
  PairMotions result{{}, std::vector<Complex>(mu.size()), std::vector<std::array<Complex, 2>>(mu.size())};
  for (std::size_t i = 0; i < mu.size(); ++i)
  {
    const auto pair = static_cast<Index>(i);
    const double of_slip = slip_compliance_of(interface, i);
    result.normal.push_back(motion(rows.normal(pair)));
    for (Index k = 0; k < interface.directions; ++k)
    {
      const Complex slip = motion(rows.tangential(pair) + k);
      result.friction[i] += mu[i] * e.of(i)[static_cast<std::size_t>(k)] * slip;
      if (of_slip > 0) result.elastic[i][static_cast<std::size_t>(k)] = slip / std::sqrt(of_slip);
    }
  }
  return result;
}

double quadratic_form(Mat A, const MultiVector& x)
{
  return A ? inner_products(x, product(A, x)).trace() : 0;
}

std::vector<Complex> residuals_at(const SlidingEquilibrium& sliding, const std::vector<HeldMode>& modes)
{
  const auto& [structure, interface, equilibrium] = sliding;
  const Owned<Mat> C = sliding_damping(sliding);
  const Matrices matrices{structure.M, C, structure.K, structure.K_loss};
  std::vector<Complex> residuals;
  for (const HeldMode& mode : modes)
  {
    const PairMotions of_left = pair_motions(interface, mode.left), of_right = pair_motions(interface, mode.right);
    Complex residual = bilinear(mode.left, weighted_sum(matrices, factors_of(mode.lambda, structure), mode.right));
    for (std::size_t i = 0; i < mode.sides.size(); ++i)
    {
      residual += mode.sides[i] * (of_right.normal[i] + compliance_of(interface, i) * mode.reactions[i]) -
                  mode.reactions[i] * (of_left.normal[i] + of_left.friction[i]);
      for (std::size_t k = 0; equilibrium.closed[i] && k < 2; ++k)
        residual += of_left.elastic[i][k] * of_right.elastic[i][k];
    }
    residuals.push_back(residual);
  }
  return residuals;
}

std::vector<HeldMode> unstable_modes(const SensitivityProblem& problem, Sensitivity& result)
{
  constexpr double exact = 1e-10; // backward error
  constexpr double same = 1e-7;   // of lambda, which the modes have with their own tolerance
  const auto& [structure, interface, equilibrium] = problem.sliding;
  const auto& [contact, C, K, M_z, K_z] = problem.linearised;
  const QuadraticProblem matrices = sliding_problem(structure, problem.linearised);
  const Owned<Mat> K_loss = sliding_loss(structure, problem.linearised);
  TwoSidedProblem two_sided = make_two_sided(matrices, K_loss, K_z, M_z, problem.modes_options.pencil);
  const Matrices own{structure.M, C, K.get() ? K.get() : structure.K.get(), structure.K_loss};
  std::array<Owned<Mat>, 4> turned{};
  Matrices transposed{};
  for (std::size_t k = 0; k < own.size(); ++k)
    if (own[k]) transposed[k] = turned[k] = transpose_of(own[k]);
  std::vector<HeldMode> held;
  for (const ComplexMode& mode : problem.modes.unstable())
  {
    const std::array parts{mode.real.get(), mode.imaginary.get()};
    const MultiVector phi = columns_of(parts);
    const auto [lambda, right, left, error] = find_two_sided(two_sided, mode.lambda, kept_rows(phi, contact));
    if (!(error < exact) || !(std::abs(lambda - mode.lambda) < same * std::abs(lambda)))
    {
      result.modes.clear();
      result.outcome = {OutcomeKind::not_converged,
                        format("the left vector of the unstable mode at %.6g Hz was not found", mode.frequency_hz()), 0,
                        error};
      return {};
    }
    HeldMode& one = held.emplace_back(HeldMode{lambda, product(contact.Z, right), product(contact.Y, left)});
    const Eigen::MatrixXd by_phi = inner_products(one.right, phi);
    one.right = scaled(one.right, Complex(by_phi.trace(), by_phi(0, 1) - by_phi(1, 0)) /
                                      inner_products(one.right, one.right).trace());
    one.left = scaled(one.left, 1. / bilinear(one.left, weighted_sum(own, slopes_of(lambda, structure), one.right)));
    set_multipliers(problem, own, transposed, one);
    ModeCauses& causes = result.modes.emplace_back();
    causes.lambda = lambda;
    causes.backward_error = error;
    causes.left = one.left;
    result.outcome.residual = std::max(result.outcome.residual, error);
  }
  return held;
}

} // namespace squeal
