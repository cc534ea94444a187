#include "squeal/shooting/multipliers.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>

namespace squeal
{

namespace
{

/// dPhi_T/dx applied to directions at an orbit, or what it does beside the flow's own direction.
struct Monodromy
{
  const Flow& flow;
  const Orbit& orbit;
  double step = 0;  // of difference quotients, in the energy norm
  Owned<Vec> phase; // energy image of the unit flow, divided by |d|; null: nothing is taken out
};

Owned<Vec> image_of(const Monodromy& monodromy, Vec direction)
{
  const Orbit& orbit = monodromy.orbit;
  const Owned<Vec> moved = copy_of(orbit.state);
  Owned<Vec> end = zeros_like(orbit.state);
  check(VecAXPY(moved, monodromy.step, direction));
  monodromy.flow.integrate(orbit.period, moved, end, nullptr);
  check(VecAXPY(end, -1, orbit.state));
  check(VecAXPY(end, -1, orbit.defect));
  check(VecScale(end, 1 / monodromy.step));
  return end;
}

/// Takes the flow's own direction out of x.
void project(const Monodromy& monodromy, Vec x)
{
  if (!monodromy.phase.get()) return;
  double along = 0;
  check(VecDot(monodromy.phase, x, &along));
  check(VecAXPY(x, -along, monodromy.orbit.rate));
}

/// A state with a part in every direction, the same for any number of ranks.
Owned<Vec> every_direction(const OrbitProblem& problem)
{
  Owned<Vec> start = zeros_like(problem.equilibrium);
  int part = 0;
  for (const Vec vector : {displacement(start), velocity(start)})
  {
    PetscInt first = 0, last = 0;
    check(VecGetOwnershipRange(vector, &first, &last));
    for (PetscInt i = first; i < last; ++i)
      check(VecSetValue(vector, i, std::cos(1 + 2.4 * static_cast<double>(i) + 1.3 * part), INSERT_VALUES));
    check(VecAssemblyBegin(vector));
    check(VecAssemblyEnd(vector));
    // displacements and velocities of the same weight
    const Owned<Vec> alone = zeros_like(start);
    check(VecCopy(vector, part == 0 ? displacement(alone) : velocity(alone)));
    check(VecScale(vector, 1 / std::max(energy_norm(problem.flow, alone), 1e-300)));
    ++part;
  }
  return start;
}

/// The sum of a change of amplitude and the other unstable motions, each of energy norm 1.
Owned<Vec> motions_that_may_grow(const OrbitProblem& problem, const Orbit& orbit,
                                 const std::vector<Owned<Vec>>& other_unstable)
{
  Owned<Vec> start = fluctuation_of(problem, orbit);
  normalise(problem.flow, start);
  for (const Owned<Vec>& motion : other_unstable) check(VecAXPY(start, 1 / energy_norm(problem.flow, motion), motion));
  return start;
}

struct Krylov
{
  std::vector<Owned<Vec>> base; // energy-orthonormal
  Eigen::MatrixXd H;            // the monodromy matrix on it
};

Krylov arnoldi(const Monodromy& monodromy, Owned<Vec> start, int steps)
{
  Krylov krylov{{}, Eigen::MatrixXd::Zero(steps, steps)};
  project(monodromy, start);
  normalise(monodromy.flow, start);
  krylov.base.push_back(std::move(start));
  for (Eigen::Index k = 0; k < steps; ++k)
  {
    Owned<Vec> image = image_of(monodromy, krylov.base[static_cast<std::size_t>(k)]);
    project(monodromy, image);
    for (int pass = 0; pass < 2; ++pass)
      for (Eigen::Index i = 0; i <= k; ++i)
      {
        const Vec member = krylov.base[static_cast<std::size_t>(i)];
        const double along = energy_product(monodromy.flow, member, image);
        krylov.H(i, k) += along;
        check(VecAXPY(image, -along, member));
      }
    const double left = energy_norm(monodromy.flow, image);
    if (k + 1 == steps || left < 1e-6) break; // the rest is noise of the differences
    krylov.H(k + 1, k) = left;
    check(VecScale(image, 1 / left));
    krylov.base.push_back(std::move(image));
  }
  const auto size = static_cast<Eigen::Index>(krylov.base.size());
  krylov.H.conservativeResize(size, size);
  return krylov;
}

struct RitzPair
{
  std::complex<double> value;
  Eigen::VectorXd vector; // real part, in the Krylov base
};

/// Largest first.
std::vector<RitzPair> ritz_pairs(const Krylov& krylov)
{
  const Eigen::EigenSolver<Eigen::MatrixXd> solver(krylov.H);
  if (solver.info() != Eigen::Success)
    throw Error("shooting: the eigenvalues of the monodromy matrix did not converge");
  std::vector<RitzPair> pairs;
  for (Eigen::Index i = 0; i < krylov.H.rows(); ++i)
  {
    Eigen::VectorXcd y = solver.eigenvectors().col(i);
    Eigen::Index largest = 0;
    y.cwiseAbs().maxCoeff(&largest);
    y *= std::conj(y(largest)) / std::abs(y(largest)); // its largest entry real
    pairs.push_back({solver.eigenvalues()(i), y.real()});
  }
  std::sort(pairs.begin(), pairs.end(),
            [](const RitzPair& a, const RitzPair& b) { return std::abs(a.value) > std::abs(b.value); });
  return pairs;
}

/// The shift's own multiplier, in the middle of what the monodromy matrix makes of it.
double shift_multiplier(const Monodromy& monodromy)
{
  const Owned<Vec> shift = copy_of(monodromy.orbit.rate.get());
  normalise(monodromy.flow, shift);
  const Owned<Vec> image = image_of(monodromy, shift);
  return energy_product(monodromy.flow, shift, image);
}

/// `whole`: every multiplier is known. A few Krylov steps may lift one of modulus 1 a little: 1.006 was seen.
Stability verdict(double largest, double error, bool whole)
{
  const double above = std::max(error, whole ? 1e-6 : 1e-2), below = std::max(error, 1e-6);
  if (largest < 1 - below) return Stability::stable;
  return largest > 1 + above ? Stability::unstable : Stability::undecided;
}

/// Of the whole monodromy matrix: takes the shift's pair out and returns its distance from 1.
double remove_shift(std::vector<RitzPair>& pairs)
{
  const auto shift = std::min_element(pairs.begin(), pairs.end(),
                                      [](const RitzPair& a, const RitzPair& b)
                                      { return std::abs(a.value - 1.) < std::abs(b.value - 1.); });
  const double distance = std::abs(shift->value - 1.);
  pairs.erase(shift);
  return distance;
}

} // namespace

FloquetAnalysis find_multipliers(const OrbitProblem& problem, const ShootingOptions& options, const Orbit& orbit,
                                 const std::vector<Owned<Vec>>& other_unstable)
{
  PetscInt dofs = 0;
  check(VecGetSize(displacement(orbit.state), &dofs));
  PetscInt wanted = options.multipliers;
  if (wanted < 0) wanted = dofs <= 25 ? 2 * dofs : 8 + 2 * static_cast<PetscInt>(other_unstable.size());
  const int steps = static_cast<int>(std::min(wanted, 2 * dofs));
  FloquetAnalysis result;
  Multipliers& multipliers = result.multipliers;
  if (steps == 0) return result;
  const bool whole = steps == 2 * dofs;
  Monodromy monodromy{problem.flow, orbit, options.difference * orbit.fluctuation, {}};
  if (!whole)
  {
    const double speed = energy_norm(problem.flow, orbit.rate);
    monodromy.phase = zeros_like(orbit.rate);
    energy_image(problem.flow, orbit.rate, monodromy.phase);
    check(VecScale(monodromy.phase, 1 / (speed * speed)));
  }
  const Krylov krylov = arnoldi(
      monodromy, whole ? every_direction(problem) : motions_that_may_grow(problem, orbit, other_unstable), steps);
  std::vector<RitzPair> pairs = ritz_pairs(krylov);
  multipliers.periods = static_cast<long>(krylov.base.size()) + (whole ? 0 : 1);
  multipliers.trivial_error = whole ? remove_shift(pairs) : std::abs(shift_multiplier(monodromy) - 1);
  if (pairs.empty()) return result;
  for (const RitzPair& pair : pairs) multipliers.values.push_back(pair.value);
  multipliers.stability = verdict(std::abs(pairs.front().value), multipliers.trivial_error, whole);
  result.fastest = zeros_like(orbit.state);
  for (std::size_t i = 0; i < krylov.base.size(); ++i)
    check(VecAXPY(result.fastest, pairs.front().vector(static_cast<Eigen::Index>(i)), krylov.base[i]));
  normalise(problem.flow, result.fastest);
  return result;
}

} // namespace squeal
