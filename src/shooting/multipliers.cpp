#include "squeal/shooting/multipliers.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <numbers>
#include <span>

namespace squeal
{

namespace
{

/// dPhi_T/dx applied to directions at an orbit, or what it does beside the flow's own direction.
struct Monodromy
{
  const Flow& flow;
  const Orbit& orbit;
  double step = 0;    // of difference quotients, in the energy norm
  Owned<Vec> phase{}; // energy image of the unit flow, divided by |d|; null: nothing is taken out

  bool exact() const { return static_cast<bool>(flow.apply_tangent); }
};

/// x_k = dPhi_T/dx x_k
void multiply(const Monodromy& monodromy, std::span<const Owned<Vec>> states)
{
  const Orbit& orbit = monodromy.orbit;
  if (monodromy.exact())
  {
    monodromy.flow.apply_tangent(std::vector<Vec>(states.begin(), states.end()));
    return;
  }
  const Owned<Vec> moved = zeros_like(orbit.state);
  for (const Owned<Vec>& state : states)
  {
    const double step = monodromy.step / std::max(energy_norm(monodromy.flow, state), 1e-300);
    check(VecWAXPY(moved, step, state, orbit.state));
    monodromy.flow.integrate(orbit.period, moved, state, nullptr);
    check(VecAXPY(state, -1, orbit.state));
    check(VecAXPY(state, -1, orbit.defect));
    check(VecScale(state, 1 / step));
  }
}

/// Takes the flow's own direction out of x.
void project(const Monodromy& monodromy, Vec x)
{
  if (!monodromy.phase.get()) return;
  double along = 0;
  check(VecDot(monodromy.phase, x, &along));
  check(VecAXPY(x, -along, monodromy.orbit.rate));
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

struct Eigenpair
{
  std::complex<double> value;
  Eigen::VectorXcd vector; // of norm 1, in the coordinates of the matrix
};

/// Largest first.
std::vector<Eigenpair> eigenpairs(const Eigen::MatrixXd& A)
{
  const Eigen::EigenSolver<Eigen::MatrixXd> solver(A);
  if (solver.info() != Eigen::Success)
    throw Error("shooting: the eigenvalues of the monodromy matrix did not converge");
  std::vector<Eigenpair> pairs;
  for (Eigen::Index i = 0; i < A.rows(); ++i)
    pairs.push_back({solver.eigenvalues()(i), solver.eigenvectors().col(i).normalized()});
  std::sort(pairs.begin(), pairs.end(),
            [](const Eigenpair& a, const Eigenpair& b) { return std::abs(a.value) > std::abs(b.value); });
  return pairs;
}

/// The real part of a vector whose largest entry is made real.
Eigen::VectorXd real_part(Eigen::VectorXcd y)
{
  Eigen::Index largest = 0;
  y.cwiseAbs().maxCoeff(&largest);
  y *= std::conj(y(largest)) / std::abs(y(largest));
  return y.real();
}

struct Krylov
{
  std::vector<Owned<Vec>> base; // energy-orthonormal
  Eigen::MatrixXd H;            // the monodromy matrix on it
  double remainder = 0;         // norm of what the last image adds to the space
};

/// Of each Ritz pair the norm of its residual.
double residual_of(const Krylov& krylov, const Eigenpair& pair)
{
  return krylov.remainder * std::abs(pair.vector(pair.vector.size() - 1));
}

/// The place of the shift in time among the pairs: near 1, with the vector that is closest to the flow.
std::size_t find_shift(const std::vector<Eigenpair>& pairs, const Eigen::VectorXd& flow)
{
  std::size_t place = 0;
  double best = -1;
  for (std::size_t i = 0; i < pairs.size(); ++i)
  {
    const double likeness = std::abs(pairs[i].vector.dot(flow.normalized())) - 10 * std::abs(pairs[i].value - 1.);
    if (i > 0 && likeness <= best) continue;
    best = likeness;
    place = i;
  }
  return place;
}

/// The Ritz pairs without that of the shift in time, which is in the space unless it was taken out. `distance`: of the
/// shift's own multiplier from 1.
std::vector<Eigenpair> without_shift(const Monodromy& monodromy, const Krylov& krylov, double& distance)
{
  std::vector<Eigenpair> pairs = eigenpairs(krylov.H);
  if (monodromy.phase.get()) return pairs;
  Eigen::VectorXd flow(krylov.H.rows());
  for (Eigen::Index i = 0; i < flow.size(); ++i)
    flow(i) = energy_product(monodromy.flow, krylov.base[static_cast<std::size_t>(i)], monodromy.orbit.rate);
  const std::size_t shift = find_shift(pairs, flow);
  distance = std::abs(pairs[shift].value - 1.);
  pairs.erase(pairs.begin() + static_cast<std::ptrdiff_t>(shift));
  return pairs;
}

/// Whether the residual of the largest Ritz value is below a tenth of its distance from the unit circle.
bool leading_converged(const Krylov& krylov, const std::vector<Eigenpair>& pairs)
{
  return !pairs.empty() && residual_of(krylov, pairs.front()) < 0.1 * std::abs(std::abs(pairs.front().value) - 1);
}

/// Appends the image of the base's last member to the space. Returns the part of it that is new.
Owned<Vec> extend(const Monodromy& monodromy, Krylov& krylov)
{
  const auto k = static_cast<Eigen::Index>(krylov.base.size()) - 1;
  krylov.H.conservativeResizeLike(Eigen::MatrixXd::Zero(k + 1, k + 1));
  if (k > 0) krylov.H(k, k - 1) = krylov.remainder;
  Owned<Vec> image = copy_of(krylov.base.back().get());
  multiply(monodromy, std::span(&image, 1));
  project(monodromy, image);
  for (int pass = 0; pass < 2; ++pass)
    for (Eigen::Index i = 0; i <= k; ++i)
    {
      const Vec member = krylov.base[static_cast<std::size_t>(i)];
      const double along = energy_product(monodromy.flow, member, image);
      krylov.H(i, k) += along;
      check(VecAXPY(image, -along, member));
    }
  krylov.remainder = energy_norm(monodromy.flow, image);
  return image;
}

/// `steps` Arnoldi steps; where `steps` is negative, at most -`steps` until the largest value has converged.
Krylov arnoldi(const Monodromy& monodromy, Owned<Vec> start, PetscInt steps)
{
  constexpr std::size_t looked_at = 8;                     // steps between two looks at the leading value
  const double nothing = monodromy.exact() ? 1e-13 : 1e-6; // below: rounding, noise of the differences
  Krylov krylov;
  project(monodromy, start);
  normalise(monodromy.flow, start);
  krylov.base.push_back(std::move(start));
  for (;;)
  {
    Owned<Vec> next = extend(monodromy, krylov);
    const std::size_t size = krylov.base.size();
    if (size == static_cast<std::size_t>(std::abs(steps)) || krylov.remainder < nothing) return krylov;
    double distance = 0;
    if (steps < 0 && size % looked_at == 0 && leading_converged(krylov, without_shift(monodromy, krylov, distance)))
      return krylov;
    check(VecScale(next, 1 / krylov.remainder));
    krylov.base.push_back(std::move(next));
  }
}

/// The shift's own multiplier, in the middle of what the monodromy matrix makes of it.
double shift_multiplier(const Monodromy& monodromy)
{
  const Owned<Vec> shift = copy_of(monodromy.orbit.rate.get());
  normalise(monodromy.flow, shift);
  Owned<Vec> image = copy_of(shift.get());
  multiply(monodromy, std::span(&image, 1));
  return energy_product(monodromy.flow, shift, image);
}

/// Entries of a state, velocities over 2 pi/T: of the displacements' size in a vibration.
Eigen::VectorXd coordinates_of(Vec state, double period)
{
  const std::vector<double> u = all_entries(displacement(state)), v = all_entries(velocity(state));
  Eigen::VectorXd all(static_cast<Eigen::Index>(u.size() + v.size()));
  all << Eigen::VectorXd::Map(u.data(), static_cast<Eigen::Index>(u.size())),
      Eigen::VectorXd::Map(v.data(), static_cast<Eigen::Index>(v.size())) * (period / (2 * std::numbers::pi));
  return all;
}

void add_entry(Vec part, PetscInt row, double value)
{
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(part, &first, &last));
  if (row >= first && row < last) check(VecSetValue(part, row, value, INSERT_VALUES));
  check(VecAssemblyBegin(part));
  check(VecAssemblyEnd(part));
}

/// The state of these coordinates.
Owned<Vec> state_at(const Eigen::VectorXd& coordinates, const Orbit& orbit)
{
  Owned<Vec> state = zeros_like(orbit.state);
  const auto dofs = static_cast<PetscInt>(coordinates.size() / 2);
  for (PetscInt i = 0; i < 2 * dofs; ++i)
    if (coordinates(i) != 0)
      add_entry(i < dofs ? displacement(state) : velocity(state), i % dofs,
                coordinates(i) * (i < dofs ? 1 : 2 * std::numbers::pi / orbit.period));
  return state;
}

/// The matrix in the coordinates of the states.
Eigen::MatrixXd whole_matrix(const Monodromy& monodromy, PetscInt dofs)
{
  Eigen::MatrixXd M(2 * dofs, 2 * dofs);
  std::vector<Owned<Vec>> columns;
  for (PetscInt k = 0; k < 2 * dofs; ++k)
    columns.push_back(state_at(Eigen::VectorXd::Unit(2 * dofs, k), monodromy.orbit));
  multiply(monodromy, columns);
  for (PetscInt k = 0; k < 2 * dofs; ++k)
    M.col(k) = coordinates_of(columns[static_cast<std::size_t>(k)], monodromy.orbit.period);
  return M;
}

/// Says what the bars allow. `complete`: no larger multiplier is to be expected. The `converged` largest values alone
/// can leave it undecided: an Arnoldi space always holds smaller ones that have not converged.
void decide(Multipliers& multipliers, bool complete, std::size_t converged)
{
  multipliers.stability = complete ? Stability::stable : Stability::undecided;
  if (!complete)
    multipliers.would_decide = "the largest multiplier has not converged: a larger -cycle_multipliers would decide";
  for (std::size_t i = 0; i < multipliers.values.size(); ++i)
  {
    const std::complex<double> value = multipliers.values[i];
    const double size = std::abs(value), error = multipliers.errors[i];
    if (size - error > 1)
    {
      multipliers.stability = Stability::unstable;
      multipliers.crossing = value.imag() != 0  ? Crossing::neimark_sacker
                             : value.real() < 0 ? Crossing::period_doubling
                                                : Crossing::fold;
      multipliers.would_decide.clear();
      return;
    }
    if (i >= converged || size + error < 1 || multipliers.stability == Stability::undecided) continue;
    multipliers.stability = Stability::undecided;
    multipliers.would_decide =
        format("a multiplier of %.6f with an error of %.1e reaches across 1: a smaller tolerance "
               "or more steps a period would decide",
               size, error);
  }
}

/// All multipliers. Bars: the change of each when the grid of time moves by half a step.
FloquetAnalysis from_whole_matrix(const Monodromy& monodromy, PetscInt dofs)
{
  FloquetAnalysis result;
  Multipliers& multipliers = result.multipliers;
  const Orbit& orbit = monodromy.orbit;
  std::vector<Eigenpair> moved;
  if (monodromy.exact())
  {
    monodromy.flow.record_period(orbit.period, orbit.state, 0.5);
    moved = eigenpairs(whole_matrix(monodromy, dofs));
    monodromy.flow.record_period(orbit.period, orbit.state, 0);
    multipliers.periods += 2 * dofs;
  }
  std::vector<Eigenpair> pairs = eigenpairs(whole_matrix(monodromy, dofs));
  multipliers.periods += 2 * dofs;
  const std::size_t shift = find_shift(pairs, coordinates_of(orbit.rate, orbit.period));
  multipliers.trivial_error = std::abs(pairs[shift].value - 1.);
  pairs.erase(pairs.begin() + static_cast<std::ptrdiff_t>(shift));
  for (const Eigenpair& pair : pairs)
  {
    double error = multipliers.trivial_error; // of the differences
    if (!moved.empty())
    {
      const auto nearest = std::min_element(moved.begin(), moved.end(),
                                            [&](const Eigenpair& a, const Eigenpair& b) {
                                              return std::abs(a.value - pair.value) < std::abs(b.value - pair.value);
                                            });
      error = std::abs(nearest->value - pair.value);
    }
    multipliers.values.push_back(pair.value);
    multipliers.errors.push_back(std::max(error, 1e-9));
  }
  if (pairs.empty()) return result;
  decide(multipliers, true, multipliers.values.size());
  result.fastest = state_at(real_part(pairs.front().vector), orbit);
  normalise(monodromy.flow, result.fastest);
  return result;
}

/// Takes the flow's own direction out of the space: an exact eigenvector only as far as the shift's multiplier is 1.
void take_out_shift(Monodromy& monodromy)
{
  const double speed = energy_norm(monodromy.flow, monodromy.orbit.rate);
  monodromy.phase = zeros_like(monodromy.orbit.rate);
  energy_image(monodromy.flow, monodromy.orbit.rate, monodromy.phase);
  check(VecScale(monodromy.phase, 1 / (speed * speed)));
}

/// Of a large system. Bars: twice the residual of each Ritz pair.
FloquetAnalysis from_arnoldi(Monodromy& monodromy, Owned<Vec> start, PetscInt steps)
{
  FloquetAnalysis result;
  Multipliers& multipliers = result.multipliers;
  const Orbit& orbit = monodromy.orbit;
  if (monodromy.exact())
  {
    monodromy.flow.record_period(orbit.period, orbit.state, 0);
    check(VecAXPY(start, energy_norm(monodromy.flow, start) / energy_norm(monodromy.flow, orbit.rate), orbit.rate));
  }
  else
    take_out_shift(monodromy);
  const Krylov krylov = arnoldi(monodromy, std::move(start), steps);
  if (!monodromy.exact()) multipliers.trivial_error = std::abs(shift_multiplier(monodromy) - 1);
  const std::vector<Eigenpair> pairs = without_shift(monodromy, krylov, multipliers.trivial_error);
  multipliers.periods = static_cast<long>(krylov.base.size()) + (monodromy.exact() ? 0 : 1);
  if (pairs.empty()) return result;
  for (const Eigenpair& pair : pairs)
  {
    multipliers.values.push_back(pair.value);
    multipliers.errors.push_back(2 * residual_of(krylov, pair));
  }
  decide(multipliers, leading_converged(krylov, pairs), 1);
  result.fastest = zeros_like(orbit.state);
  const Eigen::VectorXd fastest = real_part(pairs.front().vector);
  for (std::size_t i = 0; i < krylov.base.size(); ++i)
    check(VecAXPY(result.fastest, fastest(static_cast<Eigen::Index>(i)), krylov.base[i]));
  normalise(monodromy.flow, result.fastest);
  return result;
}

} // namespace

FloquetAnalysis find_multipliers(const OrbitProblem& problem, const ShootingOptions& options, const Orbit& orbit,
                                 const std::vector<Owned<Vec>>& other_unstable)
{
  if (options.multipliers == 0) return {};
  PetscInt dofs = 0;
  check(VecGetSize(displacement(orbit.state), &dofs));
  Monodromy monodromy{problem.flow, orbit, options.difference * orbit.fluctuation};
  const bool whole = options.multipliers > 0 ? options.multipliers >= 2 * dofs : dofs <= (monodromy.exact() ? 100 : 25);
  if (whole) return from_whole_matrix(monodromy, dofs);
  const PetscInt steps = options.multipliers > 0 ? options.multipliers : dofs <= 10000 ? -96 : -24;
  return from_arnoldi(monodromy, motions_that_may_grow(problem, orbit, other_unstable), steps);
}

} // namespace squeal
