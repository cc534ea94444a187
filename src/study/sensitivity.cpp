#include "squeal/study/sensitivity.hpp"

#include "sliding_basis.hpp"
#include "squeal/modes/two_sided.hpp"

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

constexpr double relative_step = 1e-4; // of central differences: most numbers enter M, C and K linearly

/// Modes with both vectors in the structure's degrees of freedom: real parts of all, then imaginary parts. The vectors
/// solve
///     Q right = R' reactions,   B_n right + c reactions = 0,   Q'left + B_n' sides = 0,   R left = c sides
/// on the closed pairs, R = B_n + mu e.B_t, c their compliance.
struct Vectors
{
  std::vector<Complex> lambda{};
  std::vector<LossKind> loss{};
  MultiVector right, left;
  std::vector<std::vector<Complex>> reactions{}, sides{}; // by modes and pairs; 0 on open pairs

  std::size_t count() const { return lambda.size(); }
};

/// x'A y of each mode, without conjugation, from the products of all parts.
Complex bilinear(const MatrixXd& products, std::size_t mode, std::size_t count)
{
  const auto re = static_cast<Index>(mode), im = static_cast<Index>(mode + count);
  return {products(re, re) - products(im, im), products(re, im) + products(im, re)};
}

/// x^H A x of each mode, A symmetric.
double hermitian(const MatrixXd& products, std::size_t mode, std::size_t count)
{
  const auto re = static_cast<Index>(mode), im = static_cast<Index>(mode + count);
  return products(re, re) + products(im, im);
}

Owned<Vec> column(const MultiVector& X, std::size_t j, Vec pattern)
{
  Owned<Vec> x = zeros_like(pattern);
  copy_column(X, static_cast<Index>(j), x);
  return x;
}

/// B_n x and mu e.B_t x of every pair: their sum is R x.
struct PairMotions
{
  std::vector<Complex> normal, friction;
};

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

/// What one model makes of vectors that are held.
struct AtHeldVectors
{
  std::vector<Complex> residual;       // left'(Q right - R' reactions) + sides'(B_n right + c reactions)
  std::vector<EigenvalueSlope> slopes; // of left' Q right
  // right^H A right, C with that of the friction direction, K with the springs of the pairs, and that of loss factors
  std::vector<double> mass, damping, stiffness, loss;
};

/// A matrix of a structure that may lack it, as products with vectors.
MultiVector product_or_zero(Mat A, const MultiVector& X)
{
  return A ? product(A, X) : MultiVector{X.comm, MatrixXd::Zero(X.entries.rows(), X.columns())};
}

AtHeldVectors at_held_vectors(const SlidingEquilibrium& sliding, const Vectors& vectors)
{
  const auto& [structure, interface, equilibrium] = sliding;
  const std::size_t count = vectors.count();
  const MultiVector M_right = product(structure.M, vectors.right), K_right = product(structure.K, vectors.right),
                    loss_right = product_or_zero(structure.K_loss, vectors.right);
  MultiVector C_right = product(sliding_damping(sliding), vectors.right);
  if (structure.K_loss.get()) C_right.entries -= loss_right.entries / structure.loss_omega;
  const MatrixXd M = inner_products(vectors.left, M_right), C = inner_products(vectors.left, C_right),
                 K = inner_products(vectors.left, K_right), L = inner_products(vectors.left, loss_right);
  const MatrixXd m = inner_products(vectors.right, M_right), c = inner_products(vectors.right, C_right),
                 k = inner_products(vectors.right, K_right), l = inner_products(vectors.right, loss_right);
  AtHeldVectors held;
  for (std::size_t j = 0; j < count; ++j)
  {
    const Complex lambda = vectors.lambda[j], mass = bilinear(M, j, count), damping = bilinear(C, j, count),
                  loss = bilinear(L, j, count);
    Complex residual =
        lambda * (lambda * mass + damping) + bilinear(K, j, count) + loss_factor_of(vectors.loss[j], lambda) * loss;
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
    held.slopes.push_back(slope_of(vectors.loss[j], lambda, mass, damping, loss));
    held.mass.push_back(hermitian(m, j, count));
    held.damping.push_back(hermitian(c, j, count));
    held.stiffness.push_back(stiffness);
    held.loss.push_back(hermitian(l, j, count));
  }
  return held;
}

/// Sets the reactions and the sides of the vectors of one mode.
void set_multipliers(const SensitivityProblem& problem, std::size_t mode, Vectors& vectors)
{
  const auto& [structure, interface, equilibrium] = problem.sliding;
  const LinearisedSliding& linearised = problem.linearised;
  const std::size_t count = vectors.count();
  const Complex lambda = vectors.lambda[mode];
  // of linearised.C, which holds the loss at its own frequency
  const Complex loss =
      structure.K_loss.get() ? loss_factor_of(vectors.loss[mode], lambda) - lambda / structure.loss_omega : 0;
  const std::array matrices{std::pair{structure.M.get(), lambda * lambda}, std::pair{linearised.C.get(), lambda},
                            std::pair{linearised.K.get() ? linearised.K.get() : structure.K.get(), Complex(1)},
                            std::pair{structure.K_loss.get(), loss}};
  const std::vector<Index> parts{static_cast<Index>(mode), static_cast<Index>(mode + count)};
  /// Of the pairs without a compliance, from the forces Q x or Q'x on their pivots.
  const auto rigid = [&](const MultiVector& X, Mat operation, bool transposed)
  {
    const MultiVector x{X.comm, X.entries(Eigen::all, parts)};
    MatrixXcd force = MatrixXcd::Zero(x.entries.rows(), 1);
    for (const auto& [A, factor] : matrices)
    {
      if (!A) continue;
      const MultiVector image = transposed ? product(transpose_of(A), x) : product(A, x);
      force += factor * (image.entries.col(0) + Complex(0, 1) * image.entries.col(1));
    }
    MatrixXd both(force.rows(), 2);
    both << force.real(), force.imag();
    const MatrixXd of_pairs = whole_product(operation, {x.comm, both});
    std::vector<Complex> result;
    for (Index i = 0; i < of_pairs.rows(); ++i) result.emplace_back(of_pairs(i, 0), of_pairs(i, 1));
    return result;
  };
  std::vector<Complex> reactions = rigid(vectors.right, linearised.contact.reaction, false),
                       sides = rigid(vectors.left, linearised.contact.normal_reaction, true);
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

/// The unstable modes with their left vectors.
Vectors unstable_vectors(const SensitivityProblem& problem, Sensitivity& result)
{
  constexpr double exact = 1e-10; // backward error
  constexpr double same = 1e-7;   // of lambda, which the modes have with their own tolerance
  const auto& [structure, interface, equilibrium] = problem.sliding;
  const ClosedContact& contact = problem.linearised.contact;
  const QuadraticProblem matrices = sliding_problem(structure, problem.linearised);
  const Owned<Mat> K_loss = structure.K_loss.get() ? project(structure.K_loss, contact.Y, contact.Z) : Owned<Mat>{};
  TwoSidedProblem two_sided = make_two_sided(matrices, K_loss, problem.modes_options.pencil);
  Vectors vectors{{}, {}, empty_multivector(structure.K), empty_multivector(structure.K)};
  std::vector<TwoSidedMode> modes;
  for (const ComplexMode& mode : problem.modes.unstable())
  {
    const LossKind kind = loss_kind_of(mode);
    const std::array shape{mode.real.get(), mode.imaginary.get()};
    modes.push_back(find_two_sided(two_sided, kind, mode.lambda, kept_rows(columns_of(shape), contact)));
    const auto& [lambda, right, left, error] = modes.back();
    if (!(error < exact) || !(std::abs(lambda - mode.lambda) < same * std::abs(lambda)))
    {
      result.modes.clear();
      result.outcome = {OutcomeKind::not_converged,
                        format("the left vector of the unstable mode at %.6g Hz was not found", mode.frequency_hz()), 0,
                        error};
      return {{}, {}, empty_multivector(structure.K), empty_multivector(structure.K)};
    }
    vectors.lambda.push_back(lambda);
    vectors.loss.push_back(kind);
    ModeCauses& causes = result.modes.emplace_back();
    causes.lambda = lambda;
    causes.backward_error = error;
    result.outcome.residual = std::max(result.outcome.residual, error);
  }
  vectors.right = lifted(contact.Z, modes, &TwoSidedMode::right);
  vectors.left = lifted(contact.Y, modes, &TwoSidedMode::left);
  for (std::size_t j = 0; j < vectors.count(); ++j) set_multipliers(problem, j, vectors);
  return vectors;
}

/// Powers of the pairs and of damping: their difference is twice the growth rate.
void find_powers(const SlidingEquilibrium& sliding, const Vectors& vectors, const AtHeldVectors& held,
                 Sensitivity& result)
{
  const Interface& interface = sliding.interface;
  for (std::size_t j = 0; j < vectors.count(); ++j)
  {
    ModeCauses& causes = result.modes[j];
    const Complex lambda = vectors.lambda[j];
    const double energy = std::norm(lambda) * held.mass[j] + held.stiffness[j];
    const std::vector<Complex> motion =
        pair_motions(interface, vectors.right, j, vectors.count(), sliding.structure.load).friction;
    double sum = 0;
    for (std::size_t i = 0; i < motion.size(); ++i)
    {
      const double power = 2 * std::real(std::conj(lambda * motion[i]) * vectors.reactions[j][i]) / energy;
      const std::size_t contact =
          interface.geometry.empty() ? 0 : static_cast<std::size_t>(interface.geometry[i].contact);
      causes.pair_powers.push_back(power);
      causes.contact_powers.resize(std::max(causes.contact_powers.size(), contact + 1));
      causes.contact_powers[contact] += power;
      sum += power;
    }
    const double loss = std::real(std::conj(lambda) * loss_factor_of(vectors.loss[j], lambda)) * held.loss[j];
    causes.damping_power = 2 * (std::norm(lambda) * held.damping[j] + loss) / energy;
    causes.defect = sum - causes.damping_power - 2 * lambda.real();
  }
}

/// Whether two interfaces of one B put the same conditions on an equilibrium: friction by its value at each drive
/// speed, whichever number of the law gives it.
bool same_contact(const Interface& a, const Interface& b)
{
  return a.gap == b.gap && a.compliance == b.compliance && drive_friction(a) == drive_friction(b) &&
         drive_directions(a) == drive_directions(b);
}

/// The equilibrium of a model that differs in one number, with as little work as it needs.
class NearbyEquilibria
{
public:
  explicit NearbyEquilibria(const SensitivityProblem& problem)
      : problem_(problem), options_(problem.equilibrium_options)
  {
    if (options_.check_max_iterations < 0) options_.check_max_iterations = 0;
  }

  /// Nothing where it is the equilibrium of the problem itself.
  std::optional<Equilibrium> at(const BrakeModel& model)
  {
    const auto& [structure, interface, equilibrium] = problem_.sliding;
    PetscBool same_load = PETSC_FALSE;
    check(VecEqual(model.structure.load, structure.load, &same_load));
    const bool same = equal(model.structure.K, structure.K) && equal(model.interface.B, interface.B);
    if (interface.pairs == 0 || (same && same_load == PETSC_TRUE && same_contact(model.interface, interface)))
      return std::nullopt;
    if (same && !compliance_) compliance_.emplace(structure, interface, options_);
    if (!same || !compliance_->serves(model.interface))
      return find_equilibrium(model.structure, model.interface,
                              PairCompliance(model.structure, model.interface, options_), equilibrium.closed, options_);
    return find_equilibrium(model.structure, model.interface, *compliance_, equilibrium.closed, options_);
  }

private:
  const SensitivityProblem& problem_;
  EquilibriumOptions options_;
  std::optional<PairCompliance> compliance_{}; // of the problem's own K and B
};

/// Derivatives by numbers, of all modes at once.
class NumberDerivatives
{
public:
  NumberDerivatives(const SensitivityProblem& problem, const Vectors& vectors, const AtHeldVectors& held)
      : problem_(problem), vectors_(vectors), held_(held), equilibria_(problem)
  {
  }

  std::vector<NumberDerivative> by(const SceneNumber& number)
  {
    return number.value == 0 ? by_one_side(number) : by_both_sides(number);
  }

private:
  /// The held vectors with another value; nothing where other pairs are closed.
  std::optional<AtHeldVectors> hold_at(const std::string& key, double value)
  {
    const BrakeModel model = problem_.model_with({key, value});
    const std::optional<Equilibrium> other = equilibria_.at(model);
    const Equilibrium& equilibrium = other ? *other : problem_.sliding.equilibrium;
    if (equilibrium.outcome.kind != OutcomeKind::converged || equilibrium.closed != problem_.sliding.equilibrium.closed)
      return std::nullopt;
    return at_held_vectors({model.structure, model.interface, equilibrium}, vectors_);
  }

  std::vector<NumberDerivative> unknown(const SceneNumber& number) const
  {
    return std::vector<NumberDerivative>(vectors_.count(), {number});
  }

  /// A model with its weight in a difference quotient.
  struct Weighted
  {
    double weight;
    const AtHeldVectors& model;
  };

  std::vector<NumberDerivative> quotients(const SceneNumber& number, double step,
                                          std::initializer_list<Weighted> models) const
  {
    std::vector<NumberDerivative> result = unknown(number);
    for (std::size_t j = 0; j < result.size(); ++j)
    {
      Complex residual = 0;
      double mass = 0, stiffness = 0;
      for (const auto& [weight, model] : models)
      {
        residual += weight * model.residual[j];
        mass += weight * model.mass[j];
        stiffness += weight * model.stiffness[j];
      }
      result[j].known = true;
      result[j].lambda = eigenvalue_change(held_.slopes[j], residual / step);
      result[j].kinetic = number.value * mass / step / held_.mass[j];
      result[j].strain = number.value * stiffness / step / held_.stiffness[j];
    }
    return result;
  }

  /// By a central difference, unless it drowns in rounding, as of a loss factor of 1e-6.
  std::vector<NumberDerivative> by_both_sides(const SceneNumber& number)
  {
    constexpr double clear = 1e-8; // change of an eigenvalue: its rounding, about 1e-15, is below 1e-6 of it
    const double step = relative_step * number.value;
    const auto above = hold_at(number.key, number.value + step), below = hold_at(number.key, number.value - step);
    if (!above || !below) return unknown(number);
    if (largest_change(*above) < clear)
      if (auto derivatives = by_one_side(number); derivatives.front().known) return derivatives;
    return quotients(number, step, {{0.5, *above}, {-0.5, *below}});
  }

  /// The same; nothing, too, where the value makes no scene.
  std::optional<AtHeldVectors> try_at(const std::string& key, double value)
  {
    try
    {
      return hold_at(key, value);
    }
    catch (const LibraryError&)
    {
      throw;
    }
    catch (const Error&)
    {
      return std::nullopt;
    }
  }

  /// The largest change of an eigenvalue over its size.
  double largest_change(const AtHeldVectors& other) const
  {
    double largest = 0;
    for (std::size_t j = 0; j < vectors_.count(); ++j)
      largest = std::max(largest, std::abs(eigenvalue_change(held_.slopes[j], other.residual[j] - held_.residual[j])) /
                                      std::abs(vectors_.lambda[j]));
    return largest;
  }

  /// By a difference of third order to one side, since many numbers are not negative. The number itself tells no step:
  /// a first one, of one unit or the largest of its thousandth parts that serves, shows the step that moves an
  /// eigenvalue by 1e-6. The errors, its cube and rounding over it, are then both about 1e-9 and less.
  std::vector<NumberDerivative> by_one_side(const SceneNumber& number)
  {
    constexpr double wanted = 1e-6, smaller = 1e-3, least = 1e-12, rounding = 1e-14;
    const auto beside = [&](double step) { return try_at(number.key, number.value + step); };
    double step = 1;
    std::optional<AtHeldVectors> first = beside(step);
    while (!first && step > least) first = beside(step *= smaller);
    if (!first) return unknown(number);
    if (const double change = largest_change(*first); change > rounding) step *= wanted / change;
    for (int attempt = 0; attempt < 4; ++attempt, step *= smaller)
      if (const auto three = beside(3 * step))
        if (const auto two = beside(2 * step), one = beside(step); one && two)
          return quotients(number, step, {{-11. / 6, held_}, {3, *one}, {-1.5, *two}, {1. / 3, *three}});
    return unknown(number);
  }

  const SensitivityProblem& problem_;
  const Vectors& vectors_;
  const AtHeldVectors& held_;
  NearbyEquilibria equilibria_;
};

/// By the change of the residual, with vectors and reactions held and the equilibrium free to change.
void find_number_derivatives(const SensitivityProblem& problem, const Vectors& vectors, const AtHeldVectors& held,
                             Sensitivity& result)
{
  NumberDerivatives derivatives(problem, vectors, held);
  for (const SceneNumber& number : problem.numbers)
    for (std::size_t j = 0; const NumberDerivative& derivative : derivatives.by(number))
      result.modes[j++].numbers.push_back(derivative);
}

void find_probe_derivatives(const SensitivityProblem& problem, const Vectors& vectors, const AtHeldVectors& held,
                            Sensitivity& result)
{
  PetscInt probes = 0;
  check(MatGetSize(problem.probes, &probes, nullptr));
  const Vec pattern = problem.sliding.structure.load;
  const auto values = [&](const MultiVector& X, std::size_t j)
  {
    Owned<Vec> read;
    check(MatCreateVecs(problem.probes, nullptr, read.put()));
    check(MatMult(problem.probes, column(X, j, pattern), read));
    return all_entries(read);
  };
  const std::size_t count = vectors.count();
  for (std::size_t j = 0; j < count; ++j)
  {
    const std::vector<double> right_re = values(vectors.right, j), right_im = values(vectors.right, j + count),
                              left_re = values(vectors.left, j), left_im = values(vectors.left, j + count);
    for (std::size_t i = 0; i < static_cast<std::size_t>(probes); ++i)
    {
      const Complex unit = Complex(left_re[i], left_im[i]) * Complex(right_re[i], right_im[i]);
      const Complex lambda = vectors.lambda[j];
      const auto by = [&](Complex factor) { return eigenvalue_change(held.slopes[j], factor * unit); };
      result.modes[j].probes.push_back({by(lambda * lambda), by(lambda), by(1)});
    }
  }
}

/// A with `factor` times p p' of the probe's row p added.
Owned<Mat> with_added(Mat A, Mat probes, int probe, double factor)
{
  PetscInt first = 0, last = 0, first_column = 0, last_column = 0;
  check(MatGetOwnershipRange(probes, &first, &last));
  check(MatGetOwnershipRangeColumn(probes, &first_column, &last_column));
  const PetscInt own = probe >= first && probe < last ? 1 : 0;
  Owned<IS> rows, columns;
  check(ISCreateStride(comm_of(probes), own, probe, 1, rows.put()));
  check(ISCreateStride(comm_of(probes), last_column - first_column, first_column, 1, columns.put()));
  Owned<Mat> row, square, result = copy_of(A);
  check(MatCreateSubMatrix(probes, rows, columns, MAT_INITIAL_MATRIX, row.put()));
  check(MatTransposeMatMult(row, row, MAT_INITIAL_MATRIX, PETSC_DEFAULT, square.put()));
  check(MatAXPY(result, factor, square, DIFFERENT_NONZERO_PATTERN));
  check(MatSetOption(result, MAT_SYMMETRIC, PETSC_TRUE));
  return result;
}

/// The modes of the structure with a change, about the same equilibrium.
Modes changed_modes(const SensitivityProblem& problem, const Change& change, int probe)
{
  const Structure& own = problem.sliding.structure;
  Structure changed;
  changed.M = with_added(own.M, problem.probes, probe, change.mass);
  changed.C = with_added(own.C, problem.probes, probe, change.damping);
  changed.K = with_added(own.K, problem.probes, probe, change.stiffness);
  for (const auto member : {&Structure::G, &Structure::H, &Structure::K_loss})
    if ((own.*member).get()) changed.*member = copy_of((own.*member).get());
  changed.loss_omega = own.loss_omega;
  changed.load = copy_of(own.load);
  changed.names = own.names;
  const SlidingEquilibrium sliding{changed, problem.sliding.interface, problem.sliding.equilibrium};
  ModesSettings settings = problem.modes_settings;
  settings.method = ModesMethod::full;
  return find_modes(sliding, linearise(sliding), settings, problem.modes_options);
}

void find_change_effects(const SensitivityProblem& problem, Sensitivity& result)
{
  for (std::size_t c = 0; c < problem.changes.size(); ++c)
  {
    const Change& change = problem.changes[c];
    const int probe = problem.probes_of_changes[c];
    const Modes modes = changed_modes(problem, change, probe);
    for (ModeCauses& causes : result.modes)
    {
      const ProbeDerivative& by = causes.probes[static_cast<std::size_t>(probe)];
      ChangeEffect effect;
      effect.predicted =
          causes.lambda + change.mass * by.mass + change.damping * by.damping + change.stiffness * by.stiffness;
      const auto farther = [&](const ComplexMode& a, const ComplexMode& b)
      { return std::abs(a.lambda - effect.predicted) < std::abs(b.lambda - effect.predicted); };
      const auto nearest = std::min_element(modes.modes.begin(), modes.modes.end(), farther);
      effect.found = modes.outcome.kind == OutcomeKind::converged && nearest != modes.modes.end();
      if (effect.found)
        effect.computed = nearest->lambda;
      else
      {
        result.outcome.kind = OutcomeKind::not_converged;
        result.outcome.reason = "the modes of the structure with the change at " + change.probe + " were not found";
      }
      causes.changes.push_back(effect);
    }
  }
}

} // namespace

Sensitivity find_sensitivity(const SensitivityProblem& problem)
{
  Sensitivity result;
  result.outcome.kind = OutcomeKind::converged;
  const Vectors vectors = unstable_vectors(problem, result);
  if (vectors.count() == 0) return result;
  const AtHeldVectors held = at_held_vectors(problem.sliding, vectors);
  find_powers(problem.sliding, vectors, held, result);
  find_number_derivatives(problem, vectors, held, result);
  find_probe_derivatives(problem, vectors, held, result);
  find_change_effects(problem, result);
  return result;
}

} // namespace squeal
