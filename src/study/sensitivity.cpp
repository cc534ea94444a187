#include "squeal/study/sensitivity.hpp"

#include "point_modes.hpp"

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

/// Modes with both vectors in the structure's degrees of freedom: real parts of all, then imaginary parts.
struct Vectors
{
  std::vector<Complex> lambda{};
  MultiVector right, left;
  std::vector<std::vector<Complex>> reactions{}; // normal, of the right vectors

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

/// mu e.B_t x of every pair.
std::vector<Complex> friction_motion(const Interface& interface, const MultiVector& X, std::size_t mode,
                                     std::size_t count, Vec pattern)
{
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  const std::vector<double> re = relative(interface, column(X, mode, pattern)),
                            im = relative(interface, column(X, mode + count, pattern));
  const PairView real(re, interface.directions), imaginary(im, interface.directions);
  std::vector<Complex> result(mu.size());
  for (std::size_t i = 0; i < mu.size(); ++i)
    for (std::size_t k = 0; k < e.of(i).size(); ++k)
      result[i] += mu[i] * e.of(i)[k] * Complex(real.tangential(i)[k], imaginary.tangential(i)[k]);
  return result;
}

/// What one model makes of vectors that are held.
struct AtHeldVectors
{
  std::vector<Complex> residual;                // left' [Q(lambda) right - R' reactions]
  std::vector<Complex> slope;                   // left' Q'(lambda) right
  std::vector<double> mass, damping, stiffness; // right^H A right, C with that of the friction direction
};

AtHeldVectors at_held_vectors(const SlidingEquilibrium& sliding, const Vectors& vectors)
{
  const auto& [structure, interface, equilibrium] = sliding;
  const std::size_t count = vectors.count();
  MultiVector C_right = product(structure.C, vectors.right);
  const auto part = interface.friction.direction_damping ? FrictionDamping::whole : FrictionDamping::of_speed;
  if (interface.pairs > 0)
    if (const Owned<Mat> Cf = friction_damping(interface, equilibrium.closed, equilibrium.reactions, part); Cf.get())
      C_right.entries += product(Cf, vectors.right).entries;
  const MultiVector M_right = product(structure.M, vectors.right), K_right = product(structure.K, vectors.right);
  const MatrixXd M = inner_products(vectors.left, M_right), C = inner_products(vectors.left, C_right),
                 K = inner_products(vectors.left, K_right);
  const MatrixXd m = inner_products(vectors.right, M_right), c = inner_products(vectors.right, C_right),
                 k = inner_products(vectors.right, K_right);
  AtHeldVectors held;
  for (std::size_t j = 0; j < count; ++j)
  {
    const Complex lambda = vectors.lambda[j], mass = bilinear(M, j, count), damping = bilinear(C, j, count);
    Complex residual = lambda * (lambda * mass + damping) + bilinear(K, j, count);
    const std::vector<Complex> motion = friction_motion(interface, vectors.left, j, count, structure.load);
    for (std::size_t i = 0; i < motion.size(); ++i) residual -= vectors.reactions[j][i] * motion[i];
    held.residual.push_back(residual);
    held.slope.push_back(2. * lambda * mass + damping);
    held.mass.push_back(hermitian(m, j, count));
    held.damping.push_back(hermitian(c, j, count));
    held.stiffness.push_back(hermitian(k, j, count));
  }
  return held;
}

/// The unstable modes with left vectors, on a basis of this one point.
Vectors unstable_vectors(const SensitivityProblem& problem, Sensitivity& result)
{
  const auto& [structure, interface, equilibrium] = problem.sliding;
  const ClosedContact& contact = problem.linearised.contact;
  const double band = problem.modes_settings.band;
  constexpr double exact = 1e-13; // derivatives are off by the vectors' errors to first order
  ModesBasis basis = make_modes_basis({structure, interface, band, problem.modes_options}, equilibrium.closed);
  const PointModes point = find_point_modes(basis, {problem.sliding, band, exact, SweepOptions{}.passes});
  const std::size_t wanted = problem.modes.unstable().size();
  std::vector<TwoSidedPair> pairs;
  for (std::size_t k = 0; k < point.pairs.size(); ++k)
    for (const ComplexMode& mode : problem.modes.unstable())
      if (std::abs(point.pairs[k].lambda - mode.lambda) < 1e-7 * std::abs(mode.lambda))
      {
        pairs.push_back(point.pairs[k]);
        result.modes.emplace_back().lambda = point.pairs[k].lambda;
        result.modes.back().backward_error = point.errors[k];
        break;
      }
  if (pairs.size() != wanted)
  {
    result.modes.clear();
    result.outcome = {OutcomeKind::not_converged, "the left vectors of the unstable modes were not found", 0, 0};
    return {{}, empty_multivector(structure.K), empty_multivector(structure.K)};
  }
  Vectors vectors{{}, expanded(basis, contact, pairs, Side::right), expanded(basis, contact, pairs, Side::left)};
  for (std::size_t j = 0; j < wanted; ++j)
  {
    vectors.lambda.push_back(pairs[j].lambda);
    vectors.reactions.push_back(normal_reactions(problem.linearised.reaction, pairs[j].lambda,
                                                 column(vectors.right, j, structure.load),
                                                 column(vectors.right, j + wanted, structure.load)));
    result.outcome.residual = std::max(result.outcome.residual, result.modes[j].backward_error);
  }
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
        friction_motion(interface, vectors.right, j, vectors.count(), sliding.structure.load);
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
    causes.damping_power = 2 * std::norm(lambda) * held.damping[j] / energy;
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

/// The held vectors at one side of a number; nothing where other pairs are closed.
std::optional<AtHeldVectors> hold_at(const SensitivityProblem& problem, NearbyEquilibria& equilibria,
                                     const Vectors& vectors, const SceneNumber& number)
{
  const BrakeModel model = problem.model_with(number);
  const std::optional<Equilibrium> other = equilibria.at(model);
  const Equilibrium& equilibrium = other ? *other : problem.sliding.equilibrium;
  if (equilibrium.outcome.kind != OutcomeKind::converged || equilibrium.closed != problem.sliding.equilibrium.closed)
    return std::nullopt;
  return at_held_vectors({model.structure, model.interface, equilibrium}, vectors);
}

/// -left' dQ right/(left' Q' right), with the reactions held and the equilibrium free to change.
void find_number_derivatives(const SensitivityProblem& problem, const Vectors& vectors, const AtHeldVectors& held,
                             Sensitivity& result)
{
  NearbyEquilibria equilibria(problem);
  for (const SceneNumber& number : problem.numbers)
  {
    const double step = relative_step * number.value;
    const auto above = hold_at(problem, equilibria, vectors, {number.key, number.value + step}),
               below = hold_at(problem, equilibria, vectors, {number.key, number.value - step});
    for (std::size_t j = 0; j < vectors.count(); ++j)
    {
      NumberDerivative derivative{number};
      if (above && below)
      {
        derivative.known = true;
        derivative.lambda = -(above->residual[j] - below->residual[j]) / (2 * step) / held.slope[j];
        derivative.kinetic = (above->mass[j] - below->mass[j]) / (2 * relative_step) / held.mass[j];
        derivative.strain = (above->stiffness[j] - below->stiffness[j]) / (2 * relative_step) / held.stiffness[j];
      }
      result.modes[j].numbers.push_back(derivative);
    }
  }
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
      const Complex unit = -Complex(left_re[i], left_im[i]) * Complex(right_re[i], right_im[i]) / held.slope[j];
      const Complex lambda = vectors.lambda[j];
      result.modes[j].probes.push_back({lambda * lambda * unit, lambda * unit, unit});
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
