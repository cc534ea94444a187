#include "monodromy.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

void multiply(const Monodromy& monodromy, std::span<const Owned<Vec>> states)
{
  monodromy.flow.apply_tangent(std::vector<Vec>(states.begin(), states.end()));
  if (monodromy.after_product) monodromy.after_product(states.size());
}

FastestMotion fastest_motion(const Flow& flow, const DenseEigenpair& pair,
                             const std::function<Owned<Vec>(const Eigen::VectorXd&)>& state)
{
  Eigen::Index largest = 0;
  pair.y.cwiseAbs().maxCoeff(&largest);
  const Eigen::VectorXcd y = pair.y * (std::conj(pair.y(largest)) / std::abs(pair.y(largest)));
  FastestMotion motion{state(y.real()), {}};
  if (pair.lambda.imag() != 0)
  {
    motion.imaginary = state(y.imag());
    const double a = energy_product(flow, motion.real, motion.real),
                 b = energy_product(flow, motion.imaginary, motion.imaginary),
                 c = energy_product(flow, motion.real, motion.imaginary);
    // |Re(e^{i p} y)|^2 = (a + b)/2 + (a - b)/2 cos 2p - c sin 2p
    const double phase = std::atan2(-c, (a - b) / 2) / 2;
    const Owned<Vec> real = copy_of(motion.real.get());
    check(VecAXPBY(motion.real, -std::sin(phase), std::cos(phase), motion.imaginary));
    check(VecAXPBY(motion.imaginary, std::sin(phase), std::cos(phase), real));
    check(VecScale(motion.imaginary, 1 / energy_norm(flow, motion.real)));
  }
  normalise(flow, motion.real);
  return motion;
}

std::size_t find_shift(const std::vector<DenseEigenpair>& pairs, const Eigen::VectorXd& flow)
{
  std::size_t place = 0;
  double best = -1;
  for (std::size_t i = 0; i < pairs.size(); ++i)
  {
    const double likeness = std::abs(pairs[i].y.dot(flow.normalized())) - 10 * std::abs(pairs[i].lambda - 1.);
    if (i > 0 && likeness <= best) continue;
    best = likeness;
    place = i;
  }
  return place;
}

std::vector<std::size_t> add_changes(const std::vector<std::complex<double>>& values,
                                     const std::vector<std::complex<double>>& others, double part, GridErrors& grid)
{
  std::vector<std::size_t> places = nearest_places(values, others);
  for (std::size_t i = 0; i < values.size(); ++i)
  {
    const std::complex<double> other = others[places[i]];
    grid.errors[i] += part * std::abs(other - values[i]);
    grid.rises[i] += part * std::max(0., std::abs(other) - std::abs(values[i]));
  }
  return places;
}

Crossing crossing_of(std::complex<double> multiplier)
{
  if (multiplier.imag() != 0) return Crossing::neimark_sacker;
  return multiplier.real() < 0 ? Crossing::period_doubling : Crossing::fold;
}

double moved_by_grid(const Multipliers& multipliers, std::complex<double> value)
{
  return value.imag() == 0 && value.real() > 0 ? multipliers.trivial_error : 0;
}

void decide(Multipliers& multipliers, const Completeness& coverage)
{
  multipliers.complete = coverage.complete;
  multipliers.stability = coverage.complete ? Stability::stable : Stability::undecided;
  multipliers.would_decide = coverage.complete ? "" : coverage.would_decide;
  for (std::size_t i = 0; i < multipliers.values.size(); ++i)
  {
    const std::complex<double> value = multipliers.values[i];
    const double size = std::abs(value), error = multipliers.errors[i];
    if (size - error > 1)
    {
      multipliers.stability = Stability::unstable;
      multipliers.crossing = crossing_of(value);
      multipliers.would_decide.clear();
      return;
    }
    if (multipliers.upper_bound(i) < 1 || multipliers.stability == Stability::undecided) continue;
    multipliers.stability = Stability::undecided;
    multipliers.would_decide =
        format("a multiplier of %.6f with an error of %.1e reaches across 1: a smaller tolerance "
               "or more steps a period would decide",
               size, error);
  }
}

} // namespace squeal
