#include "held_vectors.hpp"

#include "squeal/reduction/sliding_basis.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

/// x'A y of a mode, without conjugation, from the products of all parts.
Complex bilinear(const MatrixXd& products, std::size_t mode, std::size_t count)
{
  const auto re = static_cast<Index>(mode), im = static_cast<Index>(mode + count);
  return {products(re, re) - products(im, im), products(re, im) + products(im, re)};
}

/// x^H A x of a mode, A symmetric.
double hermitian(const MatrixXd& products, std::size_t mode, std::size_t count)
{
  const auto re = static_cast<Index>(mode), im = static_cast<Index>(mode + count);
  return products(re, re) + products(im, im);
}

/// A X; zero without a matrix.
MultiVector product_or_zero(Mat A, const MultiVector& X)
{
  return A ? product(A, X) : MultiVector{X.comm, MatrixXd::Zero(X.entries.rows(), X.columns())};
}

} // namespace

Owned<Vec> column(const MultiVector& X, std::size_t j, Vec pattern)
{
  Owned<Vec> x = zeros_like(pattern);
  copy_column(X, static_cast<Index>(j), x);
  return x;
}

PairMotions pair_motions(const Interface& interface, const MultiVector& X, std::size_t mode, std::size_t count,
                         Vec pattern)
{
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  const std::vector<double> re = relative(interface, column(X, mode, pattern)),
                            im = relative(interface, column(X, mode + count, pattern));
  const PairView real(re, interface.directions), imaginary(im, interface.directions);
  PairMotions result{{}, std::vector<Complex>(mu.size())};
  for (std::size_t i = 0; i < mu.size(); ++i)
  {
    result.normal.emplace_back(real.normal(i), imaginary.normal(i));
    for (std::size_t k = 0; k < e.of(i).size(); ++k)
      result.friction[i] += mu[i] * e.of(i)[k] * Complex(real.tangential(i)[k], imaginary.tangential(i)[k]);
  }
  return result;
}

std::vector<double> quadratic_forms(Mat A, const HeldVectors& vectors)
{
  const MatrixXd products = inner_products(vectors.right, product(A, vectors.right));
  std::vector<double> result;
  for (std::size_t j = 0; j < vectors.count(); ++j) result.push_back(hermitian(products, j, vectors.count()));
  return result;
}

AtHeldVectors at_held_vectors(const SlidingEquilibrium& sliding, const HeldVectors& vectors)
{
  const auto& [structure, interface, equilibrium] = sliding;
  const std::size_t count = vectors.count();
  const MultiVector M_right = product(structure.M, vectors.right), K_right = product(structure.K, vectors.right),
                    loss_right = product_or_zero(structure.K_loss, vectors.right);
  const auto damped = [&](Mat C) // without what C has for the losses
  {
    MultiVector force = product(C, vectors.right);
    if (structure.K_loss.get()) force.entries -= loss_right.entries / structure.loss_omega;
    return force;
  };
  const MatrixXd M = inner_products(vectors.left, M_right),
                 C = inner_products(vectors.left, damped(sliding_damping(sliding))),
                 K = inner_products(vectors.left, K_right), L = inner_products(vectors.left, loss_right);
  const MatrixXd m = inner_products(vectors.right, M_right), c = inner_products(vectors.right, damped(structure.C)),
                 k = inner_products(vectors.right, K_right), l = inner_products(vectors.right, loss_right);
  AtHeldVectors held;
  for (std::size_t j = 0; j < count; ++j)
  {
    const Complex lambda = vectors.lambda[j], mass = bilinear(M, j, count), damping = bilinear(C, j, count),
                  loss = bilinear(L, j, count);
    Complex residual = lambda * (lambda * mass + damping) + bilinear(K, j, count) + loss_factor_of(lambda) * loss;
    double stiffness = hermitian(k, j, count);
    const PairMotions of_left = pair_motions(interface, vectors.left, j, count, structure.load),
                      of_right = pair_motions(interface, vectors.right, j, count, structure.load);
    for (std::size_t i = 0; i < of_left.normal.size(); ++i)
    {
      const double compliance = compliance_of(interface, i);
      const Complex reaction = vectors.reactions[j][i], side = vectors.sides[j][i];
      residual +=
          side * (of_right.normal[i] + compliance * reaction) - reaction * (of_left.normal[i] + of_left.friction[i]);
      if (equilibrium.closed[i] && compliance > 0) stiffness += std::norm(of_right.normal[i]) / compliance;
    }
    held.residual.push_back(residual);
    held.slopes.push_back(2. * lambda * mass + damping);
    held.mass.push_back(hermitian(m, j, count));
    held.damping.push_back(hermitian(c, j, count));
    held.stiffness.push_back(stiffness);
    held.loss.push_back(hermitian(l, j, count));
  }
  return held;
}

namespace
{

/// M, C, K and K_loss of the sliding structure and their transposes; null: the structure has none.
struct SlidingMatrices
{
  std::array<Mat, 4> own{};
  std::array<Owned<Mat>, 4> transposed{};
};

SlidingMatrices sliding_matrices(const Structure& structure, const LinearisedSliding& linearised)
{
  SlidingMatrices matrices{
      {structure.M, linearised.C, linearised.K.get() ? linearised.K.get() : structure.K.get(), structure.K_loss}};
  for (std::size_t k = 0; k < 4; ++k)
    if (matrices.own[k]) matrices.transposed[k] = transpose_of(matrices.own[k]);
  return matrices;
}

/// The forces of the pairs without a compliance, from those of a motion x on their pivots: `operation` times the sum of
/// f_k A_k x.
std::vector<Complex> forces_of_rigid_pairs(Mat operation, const std::array<Mat, 4>& matrices,
                                           const std::array<Complex, 4>& factors, const MultiVector& x)
{
  MatrixXcd force = MatrixXcd::Zero(x.entries.rows(), 1);
  for (std::size_t k = 0; k < 4; ++k)
  {
    if (!matrices[k]) continue;
    const MultiVector image = product(matrices[k], x);
    force += factors[k] * (image.entries.col(0) + Complex(0, 1) * image.entries.col(1));
  }
  MatrixXd both(force.rows(), 2);
  both << force.real(), force.imag();
  const MatrixXd of_pairs = whole_product(operation, {x.comm, both});
  std::vector<Complex> result;
  for (Index i = 0; i < of_pairs.rows(); ++i) result.emplace_back(of_pairs(i, 0), of_pairs(i, 1));
  return result;
}

/// Sets the reactions and the sides of the vectors of one mode.
void set_multipliers(const SensitivityProblem& problem, const SlidingMatrices& matrices, std::size_t mode,
                     HeldVectors& vectors)
{
  const auto& [structure, interface, equilibrium] = problem.sliding;
  const ClosedContact& contact = problem.linearised.contact;
  const std::size_t count = vectors.count();
  const Complex lambda = vectors.lambda[mode];
  // beyond linearised.C, which holds the loss at the stated frequency
  const Complex loss = structure.K_loss.get() ? loss_factor_of(lambda) - lambda / structure.loss_omega : 0;
  const std::array<Complex, 4> factors{lambda * lambda, lambda, 1, loss};
  const auto of_mode = [&](const MultiVector& X)
  {
    const std::vector<Index> parts{static_cast<Index>(mode), static_cast<Index>(mode + count)};
    return MultiVector{X.comm, X.entries(Eigen::all, parts)};
  };
  std::array<Mat, 4> transposed{};
  std::copy(matrices.transposed.begin(), matrices.transposed.end(), transposed.begin());
  std::vector<Complex> reactions =
                           forces_of_rigid_pairs(contact.reaction, matrices.own, factors, of_mode(vectors.right)),
                       sides =
                           forces_of_rigid_pairs(contact.normal_reaction, transposed, factors, of_mode(vectors.left));
  const PairMotions of_right = pair_motions(interface, vectors.right, mode, count, structure.load),
                    of_left = pair_motions(interface, vectors.left, mode, count, structure.load);
  for (std::size_t i = 0; i < reactions.size(); ++i)
  {
    const double compliance = compliance_of(interface, i);
    sides[i] *= -1;
    if (!equilibrium.closed[i] || compliance == 0) continue;
    reactions[i] = -of_right.normal[i] / compliance;
    sides[i] = (of_left.normal[i] + of_left.friction[i]) / compliance;
  }
  vectors.reactions.push_back(std::move(reactions));
  vectors.sides.push_back(std::move(sides));
}

/// The real parts of all vectors, then the imaginary ones, in the structure's degrees of freedom.
MultiVector lifted(Mat lift, const std::vector<TwoSidedMode>& modes, MultiVector TwoSidedMode::*side)
{
  MultiVector x = empty_multivector(lift);
  for (const Index part : {0, 1})
    for (const TwoSidedMode& mode : modes) append(x, {x.comm, (mode.*side).entries.col(part)});
  return product(lift, x);
}

} // namespace

HeldVectors unstable_vectors(const SensitivityProblem& problem, Sensitivity& result)
{
  constexpr double exact = 1e-10; // backward error
  constexpr double same = 1e-7;   // of lambda, which the modes have with their own tolerance
  const auto& [structure, interface, equilibrium] = problem.sliding;
  const ClosedContact& contact = problem.linearised.contact;
  const QuadraticProblem matrices = sliding_problem(structure, problem.linearised);
  const Owned<Mat> K_loss = sliding_loss(structure, problem.linearised);
  TwoSidedProblem two_sided =
      make_two_sided(matrices, K_loss, problem.linearised.K_z, problem.linearised.M_z, problem.modes_options.pencil);
  HeldVectors vectors{{}, empty_multivector(structure.K), empty_multivector(structure.K)};
  std::vector<TwoSidedMode> modes;
  for (const ComplexMode& mode : problem.modes.unstable())
  {
    const std::array shape{mode.real.get(), mode.imaginary.get()};
    modes.push_back(find_two_sided(two_sided, mode.lambda, kept_rows(columns_of(shape), contact)));
    const auto& [lambda, right, left, error] = modes.back();
    if (!(error < exact) || !(std::abs(lambda - mode.lambda) < same * std::abs(lambda)))
    {
      result.modes.clear();
      result.outcome = {OutcomeKind::not_converged,
                        format("the left vector of the unstable mode at %.6g Hz was not found", mode.frequency_hz()), 0,
                        error};
      return {{}, empty_multivector(structure.K), empty_multivector(structure.K)};
    }
    vectors.lambda.push_back(lambda);
    ModeCauses& causes = result.modes.emplace_back();
    causes.lambda = lambda;
    causes.backward_error = error;
    result.outcome.residual = std::max(result.outcome.residual, error);
  }
  vectors.right = lifted(contact.Z, modes, &TwoSidedMode::right);
  vectors.left = lifted(contact.Y, modes, &TwoSidedMode::left);
  const SlidingMatrices own = sliding_matrices(structure, problem.linearised);
  for (std::size_t j = 0; j < vectors.count(); ++j) set_multipliers(problem, own, j, vectors);
  return vectors;
}

} // namespace squeal
