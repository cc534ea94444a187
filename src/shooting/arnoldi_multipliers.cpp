#include "arnoldi_multipliers.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

struct Krylov
{
  std::vector<Owned<Vec>> base; // energy-orthonormal
  Eigen::MatrixXd H;            // the monodromy matrix on it
  double remainder = 0;         // norm of what the last image adds to the space
};

/// Of each Ritz pair the norm of its residual.
double residual_of(const Krylov& krylov, const DenseEigenpair& pair)
{
  return krylov.remainder * std::abs(pair.y(pair.y.size() - 1));
}

/// The Ritz pairs without that of the shift in time. `distance`: of the shift's own multiplier from 1.
std::vector<DenseEigenpair> without_shift(const Monodromy& monodromy, const Krylov& krylov, double& distance)
{
  std::vector<DenseEigenpair> pairs = solve_dense_unsymmetric(krylov.H);
  Eigen::VectorXd flow(krylov.H.rows());
  for (Eigen::Index i = 0; i < flow.size(); ++i)
    flow(i) = energy_product(monodromy.flow, krylov.base[static_cast<std::size_t>(i)], monodromy.orbit.rate);
  const std::size_t shift = find_shift(pairs, flow);
  distance = std::abs(pairs[shift].lambda - 1.);
  pairs.erase(pairs.begin() + static_cast<std::ptrdiff_t>(shift));
  return pairs;
}

/// Whether the residual of the largest Ritz value is below a tenth of its distance from the unit circle.
bool leading_converged(const Krylov& krylov, const std::vector<DenseEigenpair>& pairs)
{
  return !pairs.empty() && residual_of(krylov, pairs.front()) < 0.1 * std::abs(std::abs(pairs.front().lambda) - 1);
}

/// Appends the image of the base's last member to the space. Returns the part of it that is new.
Owned<Vec> extend(const Monodromy& monodromy, Krylov& krylov)
{
  const auto k = static_cast<Eigen::Index>(krylov.base.size()) - 1;
  krylov.H.conservativeResizeLike(Eigen::MatrixXd::Zero(k + 1, k + 1));
  if (k > 0) krylov.H(k, k - 1) = krylov.remainder;
  Owned<Vec> image = copy_of(krylov.base.back().get());
  multiply(monodromy, std::span(&image, 1));
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
  constexpr std::size_t looked_at = 8; // steps between two looks at the leading value
  constexpr double nothing = 1e-13;    // below: rounding
  Krylov krylov;
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

/// What the largest value changes by on the other grids of time, each with an Arnoldi space of its own. Leaves the
/// period recorded on its own grid.
GridErrors change_of_largest(const Monodromy& monodromy, Vec start, PetscInt steps, std::complex<double> largest,
                             long& periods)
{
  const Orbit& orbit = monodromy.orbit;
  GridErrors change(1);
  for (const auto& [grid, part] : other_grids)
  {
    monodromy.flow.record_period(orbit.period, orbit.state, grid);
    const Krylov krylov = arnoldi(monodromy, copy_of(start), steps);
    periods += static_cast<long>(krylov.base.size());
    double ignored = 0;
    const std::vector<DenseEigenpair> pairs = without_shift(monodromy, krylov, ignored);
    if (pairs.empty()) continue;
    const std::size_t nearest = add_changes({largest}, values_of(pairs), part, change).front();
    for (std::vector<double>* bar : {&change.errors, &change.rises})
      bar->front() += part * residual_of(krylov, pairs[nearest]);
  }
  monodromy.flow.record_period(orbit.period, orbit.state, {});
  return change;
}

} // namespace

FloquetAnalysis multipliers_by_arnoldi(const Monodromy& monodromy, Owned<Vec> start, PetscInt steps)
{
  FloquetAnalysis result;
  Multipliers& multipliers = result.multipliers;
  multipliers.method = MultiplierMethod::arnoldi;
  const Orbit& orbit = monodromy.orbit;
  monodromy.flow.record_period(orbit.period, orbit.state, {});
  check(VecAXPY(start, energy_norm(monodromy.flow, start) / energy_norm(monodromy.flow, orbit.rate), orbit.rate));
  const Krylov krylov = arnoldi(monodromy, copy_of(start.get()), steps);
  const std::vector<DenseEigenpair> pairs = without_shift(monodromy, krylov, multipliers.trivial_error);
  multipliers.periods = static_cast<long>(krylov.base.size());
  if (pairs.empty()) return result;
  const GridErrors of_grid = change_of_largest(monodromy, start, steps, pairs.front().lambda, multipliers.periods);
  for (const DenseEigenpair& pair : pairs)
  {
    const double own = std::max(2 * residual_of(krylov, pair), 1e-9); // rounding
    multipliers.values.push_back(pair.lambda);
    multipliers.errors.push_back(own + of_grid.errors.front());
    multipliers.upper.push_back(std::abs(pair.lambda) + own + of_grid.rises.front());
  }
  decide(multipliers,
         {leading_converged(krylov, pairs),
          "the largest multiplier has not converged: a larger -cycle_multipliers would decide"},
         1);
  const auto combined = [&](const Eigen::VectorXd& y)
  {
    Owned<Vec> state = zeros_like(orbit.state);
    for (std::size_t i = 0; i < krylov.base.size(); ++i)
      check(VecAXPY(state, y(static_cast<Eigen::Index>(i)), krylov.base[i]));
    return state;
  };
  result.fastest = fastest_motion(monodromy.flow, pairs.front(), combined);
  return result;
}

} // namespace squeal
