#include "squeal/study/sensitivity.hpp"

#include "held_modes.hpp"
#include "squeal/modes/quadratic.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace squeal
{

namespace
{

/// phi^H C_f phi of one pair: by the law, and by the direction of friction.
struct PairDamping
{
  double of_speed = 0, of_direction = 0;
};

std::vector<PairDamping> pair_dampings(const SlidingEquilibrium& sliding, const MultiVector& phi)
{
  const auto& [structure, interface, equilibrium] = sliding;
  const TangentView drive(interface.drive, interface.directions);
  const Eigen::VectorXcd motion = pair_rows(interface, phi);
  const PairRows<Index> rows(interface.directions);
  const PairView reactions(equilibrium.reactions, interface.directions);
  std::vector<PairDamping> result(equilibrium.closed.size());
  for (std::size_t i = 0; i < result.size(); ++i)
  {
    if (!equilibrium.closed[i] || reactions.normal(i) <= 0) continue;
    const SlidingFriction friction = sliding_friction(interface.friction.of(i), reactions.normal(i), drive.of(i));
    const auto slip = motion.segment(rows.tangential(static_cast<Index>(i)), interface.directions);
    const auto product_with = [&](const auto& damping)
    {
      double sum = 0;
      for (Index k = 0; k < slip.size(); ++k)
        for (Index l = 0; l < slip.size(); ++l)
          sum += damping[static_cast<std::size_t>(k)][static_cast<std::size_t>(l)] * real(conj(slip(k)) * slip(l));
      return sum;
    };
    result[i].of_speed = product_with(friction.damping_of_speed);
    if (interface.friction.common.direction_damping)
      result[i].of_direction = product_with(friction.damping) - result[i].of_speed;
  }
  return result;
}

/// phi^H A phi of M and of K with the springs of the closed pairs, of each contact.
struct Energies
{
  double mass = 0, stiffness = 0;
  std::vector<double> of_contacts{};
};

/// Adds to the entry of a contact.
void add(std::vector<double>& of_contacts, std::size_t contact, double value)
{
  of_contacts.resize(std::max(of_contacts.size(), contact + 1));
  of_contacts[contact] += value;
}

Energies energies_of(const SlidingEquilibrium& sliding, const MultiVector& phi)
{
  const auto& [structure, interface, equilibrium] = sliding;
  Energies energies{quadratic_form(structure.M, phi), quadratic_form(structure.K, phi)};
  const PairMotions motions = pair_motions(interface, phi);
  for (std::size_t i = 0; i < motions.normal.size(); ++i)
  {
    if (!equilibrium.closed[i]) continue;
    const double compliance = compliance_of(interface, i),
                 springs = (compliance > 0 ? std::norm(motions.normal[i]) / compliance : 0) +
                           std::norm(motions.elastic[i][0]) + std::norm(motions.elastic[i][1]);
    energies.stiffness += springs;
    add(energies.of_contacts, interface.friction.contact_of(i), springs);
  }
  return energies;
}

/// Powers of the pairs, of their friction and of damping: their sum is twice the growth rate.
void find_powers(const SlidingEquilibrium& sliding, const HeldMode& mode, ModeCauses& causes)
{
  const auto& [structure, interface, equilibrium] = sliding;
  const Complex lambda = mode.lambda;
  const Energies energies = energies_of(sliding, mode.right);
  const double energy = std::norm(lambda) * energies.mass + energies.stiffness;
  const std::vector<Complex> motion = pair_motions(interface, mode.right).friction;
  const std::vector<PairDamping> dampings = pair_dampings(sliding, mode.right);
  for (std::size_t i = 0; i < motion.size(); ++i)
  {
    const double power = 2 * std::real(std::conj(lambda * motion[i]) * mode.reactions[i]) / energy,
                 scale = -2 * std::norm(lambda) / energy;
    const std::size_t contact = interface.friction.contact_of(i);
    causes.pair_powers.push_back(power);
    add(causes.contact_powers, contact, power);
    add(causes.falling_friction_powers, contact, scale * dampings[i].of_speed);
    add(causes.turning_friction_powers, contact, scale * dampings[i].of_direction);
  }
  const double loss = quadratic_form(structure.K_loss, mode.right),
               viscous = quadratic_form(structure.C, mode.right) - (loss > 0 ? loss / structure.loss_omega : 0);
  causes.damping_power =
      2 * (std::norm(lambda) * viscous + std::real(std::conj(lambda) * loss_factor_of(lambda)) * loss) / energy;
  causes.defect = -causes.damping_power - 2 * lambda.real();
  for (const auto* powers : {&causes.contact_powers, &causes.falling_friction_powers, &causes.turning_friction_powers})
    causes.defect = std::accumulate(powers->begin(), powers->end(), causes.defect);
}

/// Finds the share of each component in the energies: what doubling its mass and stiffness adds.
void find_shares(const SensitivityProblem& problem, const std::vector<HeldMode>& modes, Sensitivity& result)
{
  const Structure& own = problem.sliding.structure;
  std::vector<Energies> energies;
  for (const HeldMode& mode : modes) energies.push_back(energies_of(problem.sliding, mode.right));
  for (const SceneComponent& component : problem.components)
  {
    if (component.doubled.empty()) continue;
    const Model doubled = problem.model_with(component.doubled);
    for (std::size_t j = 0; j < modes.size(); ++j)
    {
      const auto added = [&](Mat twice, Mat once)
      { return quadratic_form(twice, modes[j].right) - quadratic_form(once, modes[j].right); };
      result.modes[j].shares.push_back({component.table, component.name,
                                        added(doubled.structure.M, own.M) / energies[j].mass,
                                        added(doubled.structure.K, own.K) / energies[j].stiffness});
    }
  }
  for (std::size_t j = 0; j < modes.size(); ++j)
  {
    std::vector<EnergyShare>& shares = result.modes[j].shares;
    for (std::size_t i = 0; i < energies[j].of_contacts.size(); ++i)
      if (const double strain = energies[j].of_contacts[i] / energies[j].stiffness; strain > 0)
        shares.push_back({"contact", i < problem.contacts.size() ? problem.contacts[i] : "", 0, strain});
    EnergyShare rest{"", "", 1, 1};
    for (const EnergyShare& share : shares) rest.kinetic -= share.kinetic, rest.strain -= share.strain;
    for (const SceneComponent& component : problem.components)
      if (component.doubled.empty()) shares.push_back({component.table, component.name, rest.kinetic, rest.strain});
  }
}

/// Derivatives by numbers, of all modes at once.
class NumberDerivatives
{
public:
  NumberDerivatives(const SensitivityProblem& problem, const std::vector<HeldMode>& modes)
      : problem_(problem), modes_(modes), own_(residuals_at(problem.sliding, modes)),
        equilibria_(problem.equilibrium_options)
  {
    equilibria_.expect(problem.sliding.equilibrium.closed);
  }

  /// By a central difference, or by one of fourth order over a longer step. The longer one is taken where an eigenvalue
  /// moves by so little that it drowns in rounding, as by a loss factor of 1e-6.
  std::vector<NumberDerivative> by(const SceneNumber& number)
  {
    constexpr double short_step = 1e-4; // most numbers enter M, C and K linearly
    constexpr double clear = 1e-8;      // change of an eigenvalue: its rounding, about 1e-15, is below 1e-6 of it
    if (number.value == 0) return by_one_side(number);
    const double step = short_step * number.value;
    const auto above = beside(number, step), below = beside(number, -step);
    if (!above || !below) return unknown(number);
    if (std::ranges::min(changes(*above)) >= clear) return quotients(number, step, {{0.5, *above}, {-0.5, *below}});
    for (const double part : {1e-2, 1e-3})
    {
      const double longer = part * number.value;
      if (const auto far_below = beside(number, -2 * longer), far_above = beside(number, 2 * longer);
          far_below && far_above)
        if (const auto lower = beside(number, -longer), upper = beside(number, longer); lower && upper)
          return quotients(number, longer,
                           {{2. / 3, *upper}, {-2. / 3, *lower}, {-1. / 12, *far_above}, {1. / 12, *far_below}});
    }
    return by_one_side(number);
  }

private:
  using Residuals = std::vector<Complex>;

  /// The residuals of the held vectors at another value. Nothing where other pairs are closed, where that is no scene,
  /// or where pairs that stick face another way: the residual lacks their friction.
  std::optional<Residuals> beside(const SceneNumber& number, double step)
  try
  {
    const Model model = problem_.model_with(std::array{SceneNumber{number.key, number.value + step}});
    const auto& [structure, interface, own] = problem_.sliding;
    PetscBool same_rows = PETSC_TRUE;
    if (has_undriven_pairs(interface)) check(MatEqual(model.interface.B, interface.B, &same_rows));
    if (!same_rows) return std::nullopt;
    const Equilibrium equilibrium = equilibria_.at(model.structure, model.interface);
    if (equilibrium.outcome.kind != OutcomeKind::converged || equilibrium.closed != own.closed) return std::nullopt;
    return residuals_at({model.structure, model.interface, equilibrium}, modes_);
  }
  catch (const Error&)
  {
    return std::nullopt;
  }

  std::vector<NumberDerivative> unknown(const SceneNumber& number) const
  {
    return std::vector<NumberDerivative>(modes_.size(), {number});
  }

  /// A model with its weight in a difference quotient.
  struct Weighted
  {
    double weight;
    const Residuals& model;
  };

  std::vector<NumberDerivative> quotients(const SceneNumber& number, double step,
                                          std::initializer_list<Weighted> models) const
  {
    std::vector<NumberDerivative> result = unknown(number);
    for (std::size_t j = 0; j < result.size(); ++j)
    {
      result[j].known = true;
      for (const auto& [weight, model] : models) result[j].lambda -= weight / step * model[j];
    }
    return result;
  }

  /// Changes of the eigenvalues, over their sizes.
  std::vector<double> changes(const Residuals& other) const
  {
    std::vector<double> result;
    for (std::size_t j = 0; j < modes_.size(); ++j)
      result.push_back(std::abs(other[j] - own_[j]) / std::abs(modes_[j].lambda));
    return result;
  }

  /// Derivatives by a difference of third order to one side, since many numbers are not negative. The number itself
  /// tells no step. A first one, of its size, one unit or the largest thousandth of it that serves, shows the step that
  /// moves an eigenvalue by 1e-6. The errors, its cube and rounding over it, are then both about 1e-9 and less.
  std::vector<NumberDerivative> by_one_side(const SceneNumber& number)
  {
    constexpr double wanted = 1e-6, smaller = 1e-3, least = 1e-12, rounding = 1e-14;
    const double unit = number.value == 0 ? 1 : number.value;
    double step = unit;
    std::optional<Residuals> first = beside(number, step);
    while (!first && step / unit > least) first = beside(number, step *= smaller);
    if (!first) return unknown(number);
    if (const double moved = std::ranges::max(changes(*first)); moved > rounding) step *= wanted / moved;
    for (int attempt = 0; attempt < 4; ++attempt, step *= smaller)
      if (const auto three = beside(number, 3 * step))
        if (const auto two = beside(number, 2 * step), one = beside(number, step); one && two)
          return quotients(number, step, {{-11. / 6, own_}, {3, *one}, {-1.5, *two}, {1. / 3, *three}});
    return unknown(number);
  }

  const SensitivityProblem& problem_;
  const std::vector<HeldMode>& modes_;
  const Residuals own_;
  Equilibria equilibria_;
};

/// By the change of the residual, with vectors and reactions held and the equilibrium free to change.
void find_number_derivatives(const SensitivityProblem& problem, const std::vector<HeldMode>& modes, Sensitivity& result)
{
  NumberDerivatives derivatives(problem, modes);
  for (const SceneNumber& number : problem.numbers)
    for (std::size_t j = 0; const NumberDerivative& derivative : derivatives.by(number))
      result.modes[j++].numbers.push_back(derivative);
}

void find_probe_derivatives(Mat probes, const HeldMode& mode, ModeCauses& causes)
{
  const Eigen::MatrixXd right = whole_product(probes, mode.right), left = whole_product(probes, mode.left);
  for (Index i = 0; i < right.rows(); ++i)
  {
    const Complex stiffness = -Complex(left(i, 0), left(i, 1)) * Complex(right(i, 0), right(i, 1));
    causes.probes.push_back({mode.lambda * mode.lambda * stiffness, mode.lambda * stiffness, stiffness});
  }
}

/// A with `factor` times p p' of the probe's row p added.
Owned<Mat> with_added(Mat A, Mat probes, int probe, double factor)
{
  const MPI_Comm comm = comm_of(probes);
  const std::vector<PetscInt> rows(own_rows(probes).holds(probe), probe); // on one rank
  const Owned<Mat> row = part_of(probes, set_of(comm, rows), set_of(comm, own_columns(probes)));
  Owned<Mat> square, result = copy_of(A);
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

} // namespace

Sensitivity find_sensitivity(const SensitivityProblem& problem)
{
  Sensitivity result;
  result.outcome.kind = OutcomeKind::converged;
  const std::vector<HeldMode> modes = unstable_modes(problem, result);
  for (std::size_t j = 0; j < modes.size(); ++j)
  {
    find_powers(problem.sliding, modes[j], result.modes[j]);
    find_probe_derivatives(problem.probes, modes[j], result.modes[j]);
  }
  if (modes.empty()) return result;
  find_shares(problem, modes, result);
  find_number_derivatives(problem, modes, result);
  find_change_effects(problem, result);
  return result;
}

} // namespace squeal
