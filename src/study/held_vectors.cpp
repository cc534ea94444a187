#include "held_vectors.hpp"

#include "squeal/modes/two_sided.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;

/// left'A right of a mode, without conjugation, from A on the basis; zero without a matrix.
Complex of_both_sides(const MatrixXd& A, std::size_t mode, std::size_t count)
{
  if (A.size() == 0) return 0;
  const auto re = static_cast<Index>(mode), im = static_cast<Index>(mode + count), left = static_cast<Index>(2 * count);
  return {A(left + re, re) - A(left + im, im), A(left + re, im) + A(left + im, re)};
}

/// The real parts of all vectors, then the imaginary ones, in the structure's degrees of freedom.
MultiVector in_structure(Mat lift, const std::vector<TwoSidedMode>& modes, MultiVector TwoSidedMode::*side)
{
  MultiVector x = empty_multivector(lift);
  for (const Index part : {0, 1})
    for (const TwoSidedMode& mode : modes) append(x, {x.comm, (mode.*side).entries.col(part)});
  return product(lift, x);
}

/// The normal reactions of the pairs to a mode.
std::vector<Complex> reactions_to(const SensitivityProblem& problem, const HeldVectors& vectors, std::size_t mode)
{
  const Structure& structure = problem.sliding.structure;
  const Complex lambda = vectors.lambda[mode];
  const auto parts = right_parts(vectors, mode, structure.load);
  std::vector<Complex> reactions = normal_reactions(problem.linearised.reaction, lambda, parts[0], parts[1]);
  if (!structure.K_loss.get()) return reactions;
  // beyond linearised.C, which holds the loss at the stated frequency
  const Complex factor = loss_factor_of(lambda) - lambda / structure.loss_omega;
  const MultiVector shape = columns_of(std::array{parts[0].get(), parts[1].get()});
  const MatrixXd of_loss = whole_product(problem.linearised.contact.reaction, product(structure.K_loss, shape));
  for (Index i = 0; i < of_loss.rows(); ++i)
    reactions[static_cast<std::size_t>(i)] += factor * Complex(of_loss(i, 0), of_loss(i, 1));
  return reactions;
}

} // namespace

std::array<Owned<Vec>, 2> right_parts(const HeldVectors& vectors, std::size_t mode, Vec pattern)
{
  std::array<Owned<Vec>, 2> parts{zeros_like(pattern), zeros_like(pattern)};
  copy_column(vectors.right, static_cast<Index>(mode), parts[0]);
  copy_column(vectors.right, static_cast<Index>(mode + vectors.count()), parts[1]);
  return parts;
}

PairMotions pair_motions(const SlidingEquilibrium& sliding, const HeldVectors& vectors, std::size_t mode)
{
  const Interface& interface = sliding.interface;
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  const auto parts = right_parts(vectors, mode, sliding.structure.load);
  const std::vector<double> re = relative(interface, parts[0]), im = relative(interface, parts[1]);
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
  std::vector<double> result(vectors.count());
  if (!A) return result;
  const Eigen::VectorXd products = symmetric_inner_products(vectors.right, A).diagonal();
  for (std::size_t j = 0; j < result.size(); ++j)
    result[j] = products(static_cast<Index>(j)) + products(static_cast<Index>(j + vectors.count()));
  return result;
}

AtHeldVectors at_held_vectors(const SlidingEquilibrium& sliding, HeldVectors& vectors)
{
  set_model(vectors.basis, sliding.structure, sliding.interface);
  const auto [M, C, K, K_loss] = project(vectors.basis, linearise_point(sliding));
  AtHeldVectors held;
  for (std::size_t j = 0; j < vectors.count(); ++j)
  {
    const Complex lambda = vectors.lambda[j], mass = of_both_sides(M, j, vectors.count()),
                  damping = of_both_sides(C, j, vectors.count()), loss = of_both_sides(K_loss, j, vectors.count());
    held.residual.push_back(lambda * (lambda * mass + damping) + of_both_sides(K, j, vectors.count()) +
                            loss_factor_of(lambda) * loss);
    held.slopes.push_back(2. * lambda * mass + damping);
  }
  return held;
}

HeldVectors unstable_vectors(const SensitivityProblem& problem, Sensitivity& result)
{
  constexpr double exact = 1e-10; // backward error
  constexpr double same = 1e-7;   // of lambda, which the modes have with their own tolerance
  const auto& [structure, interface, equilibrium] = problem.sliding;
  const ClosedContact& contact = problem.linearised.contact;
  const QuadraticProblem matrices = sliding_problem(structure, problem.linearised);
  const Owned<Mat> K_loss = structure.K_loss.get() ? project(structure.K_loss, contact.Y, contact.Z) : Owned<Mat>{};
  TwoSidedProblem two_sided = make_two_sided(matrices, K_loss, problem.modes_options.pencil);
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
      return {};
    }
    ModeCauses& causes = result.modes.emplace_back();
    causes.lambda = lambda;
    causes.backward_error = error;
    result.outcome.residual = std::max(result.outcome.residual, error);
  }
  HeldVectors vectors{{},
                      in_structure(contact.Z, modes, &TwoSidedMode::right),
                      in_structure(contact.Y, modes, &TwoSidedMode::left),
                      {}};
  vectors.basis.T = vectors.right;
  append(vectors.basis.T, vectors.left);
  for (const TwoSidedMode& mode : modes) vectors.lambda.push_back(mode.lambda);
  for (std::size_t j = 0; j < modes.size(); ++j) vectors.reactions.push_back(reactions_to(problem, vectors, j));
  return vectors;
}

} // namespace squeal
