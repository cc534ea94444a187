#include "squeal/study/sensitivity.hpp"

#include "held_vectors.hpp"
#include "squeal/reduction/sliding_basis.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;

constexpr double relative_step = 1e-4; // of central differences: most numbers enter M, C and K linearly

/// phi^H C_f phi of one pair: by the law, and by the direction of friction.
struct PairDamping
{
  double of_speed = 0, of_direction = 0;
};

std::vector<PairDamping> pair_dampings(const SlidingEquilibrium& sliding, const HeldVectors& vectors, std::size_t mode)
{
  const auto& [structure, interface, equilibrium] = sliding;
  const TangentView drive(interface.drive, interface.directions);
  const std::vector<double> re = relative(interface, column(vectors.right, mode, structure.load)),
                            im = relative(interface, column(vectors.right, mode + vectors.count(), structure.load));
  const PairView real(re, interface.directions), imaginary(im, interface.directions),
      reactions(equilibrium.reactions, interface.directions);
  std::vector<PairDamping> result(equilibrium.closed.size());
  for (std::size_t i = 0; i < result.size(); ++i)
  {
    if (!equilibrium.closed[i] || reactions.normal(i) <= 0) continue;
    const SlidingFriction friction = sliding_friction(interface.friction.of(i), reactions.normal(i), drive.of(i));
    const auto product_with = [&](const auto& damping)
    {
      double sum = 0;
      for (const auto& motion : {real.tangential(i), imaginary.tangential(i)})
        for (std::size_t k = 0; k < motion.size(); ++k)
          for (std::size_t l = 0; l < motion.size(); ++l) sum += motion[k] * damping[k][l] * motion[l];
      return sum;
    };
    result[i].of_speed = product_with(friction.damping_of_speed);
    if (interface.friction.common.direction_damping)
      result[i].of_direction = product_with(friction.damping) - result[i].of_speed;
  }
  return result;
}

/// Powers of the pairs, of their friction and of damping: their sum is twice the growth rate.
void find_powers(const SlidingEquilibrium& sliding, const HeldVectors& vectors, const AtHeldVectors& held,
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
    const std::vector<PairDamping> dampings = pair_dampings(sliding, vectors, j);
    double sum = 0;
    const auto put_in = [&](std::vector<double>& powers, std::size_t contact, double power)
    {
      powers.resize(std::max(powers.size(), contact + 1));
      powers[contact] += power;
      sum += power;
    };
    for (std::size_t i = 0; i < motion.size(); ++i)
    {
      const double power = 2 * std::real(std::conj(lambda * motion[i]) * vectors.reactions[j][i]) / energy;
      const std::size_t contact = interface.friction.contact_of(i);
      causes.pair_powers.push_back(power);
      put_in(causes.contact_powers, contact, power);
      const double scale = -2 * std::norm(lambda) / energy;
      put_in(causes.falling_friction_powers, contact, scale * dampings[i].of_speed);
      put_in(causes.turning_friction_powers, contact, scale * dampings[i].of_direction);
    }
    const double loss = std::real(std::conj(lambda) * loss_factor_of(lambda)) * held.loss[j];
    causes.damping_power = 2 * (std::norm(lambda) * held.damping[j] + loss) / energy;
    causes.defect = sum - causes.damping_power - 2 * lambda.real();
  }
}

/// The strain energy of the closed pairs with a compliance, over that of the mode, of each contact.
std::vector<double> strain_of_contacts(const SensitivityProblem& problem, const HeldVectors& vectors,
                                       const AtHeldVectors& held, std::size_t mode)
{
  const auto& [structure, interface, equilibrium] = problem.sliding;
  const std::vector<Complex> normal =
      pair_motions(interface, vectors.right, mode, vectors.count(), structure.load).normal;
  std::vector<double> strain(problem.contacts.size());
  for (std::size_t i = 0; i < normal.size(); ++i)
    if (const double compliance = compliance_of(interface, i); compliance > 0 && equilibrium.closed[i])
    {
      const std::size_t contact = interface.friction.contact_of(i);
      strain.resize(std::max(strain.size(), contact + 1));
      strain[contact] += std::norm(normal[i]) / compliance / held.stiffness[mode];
    }
  return strain;
}

/// What each component holds of the energies: what doubling its mass and stiffness adds.
void find_shares(const SensitivityProblem& problem, const HeldVectors& vectors, const AtHeldVectors& held,
                 Sensitivity& result)
{
  const std::vector<double> stiffness = quadratic_forms(problem.sliding.structure.K, vectors);
  for (const SceneComponent& component : problem.components)
  {
    if (component.doubled.empty()) continue;
    const BrakeModel doubled = problem.model_with(component.doubled);
    const std::vector<double> M = quadratic_forms(doubled.structure.M, vectors),
                              K = quadratic_forms(doubled.structure.K, vectors);
    for (std::size_t j = 0; j < vectors.count(); ++j)
      result.modes[j].shares.push_back({component.table, component.name, (M[j] - held.mass[j]) / held.mass[j],
                                        (K[j] - stiffness[j]) / held.stiffness[j]});
  }
  for (std::size_t j = 0; j < vectors.count(); ++j)
  {
    std::vector<EnergyShare>& shares = result.modes[j].shares;
    const std::vector<double> strain = strain_of_contacts(problem, vectors, held, j);
    for (std::size_t i = 0; i < strain.size(); ++i)
      if (strain[i] > 0)
        shares.push_back({"contact", i < problem.contacts.size() ? problem.contacts[i] : "", 0, strain[i]});
    EnergyShare rest{"", "", 1, 1};
    for (const EnergyShare& share : shares) rest.kinetic -= share.kinetic, rest.strain -= share.strain;
    for (const SceneComponent& component : problem.components)
      if (component.doubled.empty()) shares.push_back({component.table, component.name, rest.kinetic, rest.strain});
  }
}

/// Whether two interfaces of one B put the same conditions on an equilibrium: friction by its value at each drive
/// speed, whichever number of the law gives it.
bool same_contact(const Interface& a, const Interface& b)
{
  return a.gap == b.gap && a.compliance == b.compliance && drive_friction(a) == drive_friction(b) &&
         drive_directions(a) == drive_directions(b);
}

/// Derivatives by numbers, of all modes at once.
class NumberDerivatives
{
public:
  NumberDerivatives(const SensitivityProblem& problem, const HeldVectors& vectors, const AtHeldVectors& held)
      : problem_(problem), vectors_(vectors), held_(held), equilibria_(problem.equilibrium_options)
  {
    equilibria_.expect(problem.sliding.equilibrium.closed);
  }

  std::vector<NumberDerivative> by(const SceneNumber& number)
  {
    return number.value == 0 ? by_one_side(number) : by_both_sides(number);
  }

private:
  /// The held vectors with another value; nothing where other pairs are closed.
  std::optional<AtHeldVectors> hold_at(const std::string& key, double value)
  {
    const BrakeModel model = problem_.model_with(std::array{SceneNumber{key, value}});
    const auto& [structure, interface, own] = problem_.sliding;
    const bool same = model.structure.K.get() == structure.K && model.interface.B.get() == interface.B &&
                      model.structure.load.get() == structure.load && same_contact(model.interface, interface);
    std::optional<Equilibrium> other;
    if (interface.pairs > 0 && !same) other = equilibria_.at(model.structure, model.interface);
    const Equilibrium& equilibrium = other ? *other : own;
    if (equilibrium.outcome.kind != OutcomeKind::converged || equilibrium.closed != own.closed) return std::nullopt;
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
      for (const auto& [weight, model] : models) residual += weight * model.residual[j];
      result[j].known = true;
      result[j].lambda = -residual / (step * held_.slopes[j]);
    }
    return result;
  }

  /// By a central difference, but for modes whose change drowns in rounding, as by a loss factor of 1e-6.
  std::vector<NumberDerivative> by_both_sides(const SceneNumber& number)
  {
    constexpr double clear = 1e-8; // change of an eigenvalue: its rounding, about 1e-15, is below 1e-6 of it
    const double step = relative_step * number.value;
    const auto above = hold_at(number.key, number.value + step), below = hold_at(number.key, number.value - step);
    if (!above || !below) return unknown(number);
    auto result = quotients(number, step, {{0.5, *above}, {-0.5, *below}});
    std::vector<std::size_t> unclear;
    for (std::size_t j = 0; j < result.size(); ++j)
      if (change(*above, j) < clear) unclear.push_back(j);
    if (!unclear.empty()) take_long_steps(number, unclear, result);
    return result;
  }

  /// Of some modes by a central difference of fourth order, whose steps of a hundredth leave 1e-8 of a number's
  /// inverse, say; of a thousandth where other pairs are closed there, or the values make no scene. Steps to one side
  /// are longer and have less rounding: they are taken where they agree with the central difference within its
  /// rounding, as where the number enters linearly, or where there is none.
  void take_long_steps(const SceneNumber& number, const std::vector<std::size_t>& modes,
                       std::vector<NumberDerivative>& result)
  {
    constexpr double rounding = 1e-14;
    const auto one_sided = by_one_side(number);
    for (const double part : {1e-2, 1e-3})
    {
      const double step = part * number.value;
      const auto at = [&](int steps) { return try_at(number.key, number.value + steps * step); };
      const auto below = at(-1), above = at(1), far_below = at(-2), far_above = at(2);
      if (!below || !above || !far_below || !far_above) continue;
      const auto central =
          quotients(number, step, {{2. / 3, *above}, {-2. / 3, *below}, {-1. / 12, *far_above}, {1. / 12, *far_below}});
      for (const std::size_t j : modes)
      {
        const double difference = std::abs(one_sided[j].lambda - central[j].lambda);
        const bool agree = one_sided[j].known && difference <= rounding * std::abs(vectors_.lambda[j] / step);
        result[j] = agree ? one_sided[j] : central[j];
      }
      return;
    }
    for (const std::size_t j : modes) result[j] = one_sided[j];
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

  /// Of an eigenvalue, over its size.
  double change(const AtHeldVectors& other, std::size_t mode) const
  {
    return std::abs((other.residual[mode] - held_.residual[mode]) / held_.slopes[mode]) /
           std::abs(vectors_.lambda[mode]);
  }

  double largest_change(const AtHeldVectors& other) const
  {
    double largest = 0;
    for (std::size_t j = 0; j < vectors_.count(); ++j) largest = std::max(largest, change(other, j));
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
    if (const double moved = largest_change(*first); moved > rounding) step *= wanted / moved;
    for (int attempt = 0; attempt < 4; ++attempt, step *= smaller)
      if (const auto three = beside(3 * step))
        if (const auto two = beside(2 * step), one = beside(step); one && two)
          return quotients(number, step, {{-11. / 6, held_}, {3, *one}, {-1.5, *two}, {1. / 3, *three}});
    return unknown(number);
  }

  const SensitivityProblem& problem_;
  const HeldVectors& vectors_;
  const AtHeldVectors& held_;
  Equilibria equilibria_;
};

/// By the change of the residual, with vectors and reactions held and the equilibrium free to change.
void find_number_derivatives(const SensitivityProblem& problem, const HeldVectors& vectors, const AtHeldVectors& held,
                             Sensitivity& result)
{
  NumberDerivatives derivatives(problem, vectors, held);
  for (const SceneNumber& number : problem.numbers)
    for (std::size_t j = 0; const NumberDerivative& derivative : derivatives.by(number))
      result.modes[j++].numbers.push_back(derivative);
}

void find_probe_derivatives(const SensitivityProblem& problem, const HeldVectors& vectors, const AtHeldVectors& held,
                            Sensitivity& result)
{
  const Eigen::MatrixXd right = whole_product(problem.probes, vectors.right),
                        left = whole_product(problem.probes, vectors.left);
  const auto count = static_cast<Eigen::Index>(vectors.count());
  for (Eigen::Index j = 0; j < count; ++j)
    for (Eigen::Index i = 0; i < right.rows(); ++i)
    {
      const auto mode = static_cast<std::size_t>(j);
      const Complex unit = Complex(left(i, j), left(i, j + count)) * Complex(right(i, j), right(i, j + count));
      const Complex lambda = vectors.lambda[mode];
      const auto by = [&](Complex factor) { return -factor * unit / held.slopes[mode]; };
      result.modes[mode].probes.push_back({by(lambda * lambda), by(lambda), by(1)});
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
  return find_modes(sliding, linearise(sliding), problem.modes_settings, problem.modes_options);
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
      const auto nearest = std::ranges::min_element(
          modes.modes, {}, [&](const ComplexMode& mode) { return std::abs(mode.lambda - effect.predicted); });
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

/// Keeps the left vector psi of each mode phi, of which the held right one is a multiple, with psi'Q'(lambda) phi = 1.
void keep_left(const Modes& modes, const HeldVectors& vectors, const AtHeldVectors& held, Sensitivity& result)
{
  const auto count = static_cast<Eigen::Index>(vectors.count());
  const Eigen::MatrixXd own = inner_products(vectors.right, vectors.right);
  for (std::size_t mode = 0; mode < vectors.count(); ++mode)
  {
    const auto re = static_cast<Eigen::Index>(mode), im = re + count;
    const std::array shape{modes.modes[mode].real.get(), modes.modes[mode].imaginary.get()};
    const Eigen::MatrixXd phi = inner_products(vectors.right, columns_of(shape));
    const Complex multiple(phi(re, 0) + phi(im, 1), phi(re, 1) - phi(im, 0)),
        factor = (own(re, re) + own(im, im)) / (multiple * held.slopes[mode]);
    const Eigen::Matrix2d turn{{factor.real(), factor.imag()}, {-factor.imag(), factor.real()}};
    result.modes[mode].left = {vectors.left.comm, vectors.left.entries(Eigen::all, std::array{re, im}) * turn};
  }
}

} // namespace

Sensitivity find_sensitivity(const SensitivityProblem& problem)
{
  Sensitivity result;
  result.outcome.kind = OutcomeKind::converged;
  const HeldVectors vectors = unstable_vectors(problem, result);
  if (vectors.count() == 0) return result;
  const AtHeldVectors held = at_held_vectors(problem.sliding, vectors);
  keep_left(problem.modes, vectors, held, result);
  find_powers(problem.sliding, vectors, held, result);
  find_shares(problem, vectors, held, result);
  find_number_derivatives(problem, vectors, held, result);
  find_probe_derivatives(problem, vectors, held, result);
  find_change_effects(problem, result);
  return result;
}

} // namespace squeal
