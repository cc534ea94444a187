#include "squeal/contact/pair_law.hpp"

#include <algorithm>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <optional>

namespace squeal
{

namespace
{

constexpr double round_off = 1e-13; // a few hundred units in the last place of the terms summed

/// A r = -q by elimination of r_n; a tangential direction that cannot move gets no reaction, and no stick if it slides.
std::optional<PairVector> stick(const PairBlock& A, const PairVector& q)
{
  const double a = A[0][0], b1 = A[0][1] / a, b2 = A[0][2] / a;
  const double s11 = A[1][1] - b1 * A[0][1], s22 = A[2][2] - b2 * A[0][2], s12 = A[1][2] - b1 * A[0][2];
  const double c1 = q[1] - b1 * q[0], c2 = q[2] - b2 * q[0];
  const double trace = s11 + s22, determinant = s11 * s22 - s12 * s12;
  PairVector r{};
  if (determinant > round_off * trace * trace)
  {
    r[1] = -(s22 * c1 - s12 * c2) / determinant;
    r[2] = -(s11 * c2 - s12 * c1) / determinant;
  }
  else if (trace > round_off * (a + A[1][1] + A[2][2]))
  {
    // rank one, S = v v': r_t = -(v.c) v / |v|^4
    const double v1 = s11 >= s22 ? s11 : s12, v2 = s11 >= s22 ? s12 : s22;
    const double factor = -(v1 * c1 + v2 * c2) / (trace * (v1 * v1 + v2 * v2));
    r[1] = factor * v1;
    r[2] = factor * v2;
  }
  r[0] = -(q[0] + A[0][1] * r[1] + A[0][2] * r[2]) / a;
  const PairVector w = pair_velocity(A, r, q);
  const double scale = std::abs(q[0]) + std::abs(q[1]) + std::abs(q[2]);
  if (length(w[1], w[2]) > 10 * round_off * scale) return std::nullopt;
  return r;
}

/// Slip along the unit vector d: z is w_t times the positive denominator of r_n.
struct Slip
{
  double denominator, z1, z2;
};

Slip slip_along(const PairBlock& A, const PairVector& q, double mu, double d1, double d2)
{
  const double denominator = A[0][0] + mu * (A[0][1] * d1 + A[0][2] * d2);
  return {denominator, q[1] * denominator - q[0] * (A[0][1] + mu * (A[1][1] * d1 + A[1][2] * d2)),
          q[2] * denominator - q[0] * (A[0][2] + mu * (A[1][2] * d1 + A[2][2] * d2))};
}

PairVector slip_reaction(const PairVector& q, double mu, double denominator, double d1, double d2)
{
  const double r_n = -q[0] / denominator;
  return {r_n, mu * r_n * d1, mu * r_n * d2};
}

PairVector slip_in_plane(const PairBlock& A, const PairVector& q, double mu, const PairVector& last)
{
  // of both senses, the one that opposes the sliding best: at the edge of stick neither does beyond round-off
  const double first = last[1] < 0 ? -1. : 1.;
  double chosen = 0, denominator = A[0][0], least = 0;
  for (const double d : {first, -first})
  {
    const Slip slip = slip_along(A, q, mu, d, 0);
    const double along = d * slip.z1;
    if (slip.denominator <= 0 || (chosen != 0 && along >= least)) continue;
    chosen = d;
    denominator = slip.denominator;
    least = along;
    if (along <= 0) break;
  }
  return slip_reaction(q, mu, denominator, chosen, 0);
}

/// d x w_t as a function of the angle of d, and its derivative.
struct SlipAngle
{
  const PairBlock& A;
  const PairVector& q;
  double mu, tolerance;

  double cross(double angle, double& derivative) const
  {
    const double d1 = std::cos(angle), d2 = std::sin(angle);
    const Slip slip = slip_along(A, q, mu, d1, d2);
    const double turn = mu * (-A[0][1] * d2 + A[0][2] * d1);
    const double y1 = q[1] * turn - q[0] * mu * (-A[1][1] * d2 + A[1][2] * d1);
    const double y2 = q[2] * turn - q[0] * mu * (-A[1][2] * d2 + A[2][2] * d1);
    derivative = -(d1 * slip.z1 + d2 * slip.z2) - d2 * y1 + d1 * y2;
    return -d2 * slip.z1 + d1 * slip.z2;
  }

  std::optional<PairVector> reaction(double angle) const
  {
    const double d1 = std::cos(angle), d2 = std::sin(angle);
    const Slip slip = slip_along(A, q, mu, d1, d2);
    if (slip.denominator <= 0 || d1 * slip.z1 + d2 * slip.z2 > tolerance) return std::nullopt;
    return slip_reaction(q, mu, slip.denominator, d1, d2);
  }

  std::optional<PairVector> newton(double angle) const
  {
    for (int iteration = 0; iteration < 12; ++iteration)
    {
      double derivative = 0;
      const double value = cross(angle, derivative);
      const double change = derivative != 0 ? -value / derivative : 0;
      angle += std::clamp(change, -0.5, 0.5);
      if (std::abs(change) < 1e-9)
      {
        // quadratic convergence: the last step was below the root of round-off
        double slope = 0;
        if (std::abs(cross(angle, slope)) <= tolerance) return reaction(angle);
        return std::nullopt;
      }
    }
    return std::nullopt;
  }

  /// The solution whose slip direction is nearest to `start`, among all on the circle.
  std::optional<PairVector> scan(double start) const
  {
    constexpr int intervals = 64;
    std::optional<PairVector> best;
    double nearest = -2;
    for (int i = 0; i < intervals; ++i)
    {
      double unused = 0, low = start + 2 * M_PI * i / intervals, high = start + 2 * M_PI * (i + 1) / intervals;
      const bool positive = cross(low, unused) > 0;
      if (positive == (cross(high, unused) > 0)) continue;
      for (int halving = 0; halving < 60; ++halving)
      {
        const double middle = (low + high) / 2;
        ((cross(middle, unused) > 0) == positive ? low : high) = middle;
      }
      const auto found = reaction(low);
      const double closeness = std::cos(low - start);
      if (!found || closeness < nearest) continue;
      best = found;
      nearest = closeness;
    }
    return best;
  }
};

PairVector slip_in_space(const PairBlock& A, const PairVector& q, double mu, const PairVector& last)
{
  const double size = length(q[1], q[2]) * (A[0][0] + mu * length(A[0][1], A[0][2])) +
                      std::abs(q[0]) * (length(A[0][1], A[0][2]) + mu * (A[1][1] + A[2][2]));
  const SlipAngle slip{A, q, mu, round_off * size};
  double start = std::atan2(last[2], last[1]);
  if (last[1] == 0 && last[2] == 0)
  {
    const PairVector sliding = pair_velocity(A, {-q[0] / A[0][0], 0, 0}, q); // without friction
    start = std::atan2(-sliding[2], -sliding[1]);
  }
  if (const auto found = slip.newton(start)) return *found;
  if (const auto found = slip.scan(start)) return *found;
  return last; // the residual says that this pair is not solved
}

PairVector slip_at(const PairBlock& A, const PairVector& q, int directions, double mu, const PairVector& last)
{
  return directions == 1 ? slip_in_plane(A, q, mu, last) : slip_in_space(A, q, mu, last);
}

/// Whether friction suffices for the reaction of stick.
bool holds(const PairVector& r, double mu)
{
  return r[0] >= 0 && length(r[1], r[2]) <= mu * r[0];
}

/// Slip at the speed v that its own mu(v) leaves, between rest, where mu is too small to stick, and the greatest speed
/// of constant friction.
PairVector slip_at_own_speed(const PairBlock& A, const PairVector& q, int directions, const FrictionLaw& law,
                             const PairVector& last)
{
  const auto stuck = stick(A, q);
  PairVector r{};
  const auto speed_of = [&](double mu) // of constant friction, under which the pair may stick
  {
    if (stuck && holds(*stuck, mu))
    {
      r = *stuck;
      return 0.;
    }
    r = slip_at(A, q, directions, mu, last);
    const PairVector w = pair_velocity(A, r, q);
    return length(w[1], w[2]);
  };
  const auto excess = [&](double v) { return speed_of(friction_coefficient(law, v).value) - v; };
  const double at_low = excess(0);
  if (at_low <= 0) return r;
  double high = std::max(at_low, speed_of(friction_coefficient(law, HUGE_VAL).value)), at_high = excess(high);
  for (int doubling = 0; at_high > 0 && doubling < 60; ++doubling) high *= 2, at_high = excess(high);
  if (!(at_high < 0)) return r;
  const auto rounded = [&](double v) // zero where the excess is at the rounding of v
  {
    const double value = excess(v);
    return std::abs(value) <= 1e-15 * v ? 0 : value;
  };
  std::uintmax_t evaluations = 100;
  const auto [below, above] = boost::math::tools::toms748_solve(
      rounded, 0., high, at_low, at_high, boost::math::tools::eps_tolerance<double>(), evaluations);
  excess((below + above) / 2); // sets r
  return r;
}

} // namespace

SlidingFriction sliding_friction(const FrictionLaw& law, double r_n, std::span<const double> s)
{
  SlidingFriction result{};
  const double speed = length(s);
  if (speed == 0) return result;
  const FrictionCoefficient mu = friction_coefficient(law, speed);
  for (std::size_t k = 0; k < s.size(); ++k)
  {
    result.along[k] = mu.value * s[k] / speed;
    for (std::size_t l = 0; l < s.size(); ++l)
    {
      const double parallel = s[k] * s[l] / (speed * speed);
      result.damping_of_speed[k][l] = r_n * mu.derivative * parallel;
      result.damping[k][l] = r_n * mu.value / speed * ((k == l ? 1 : 0) - parallel) + result.damping_of_speed[k][l];
    }
  }
  return result;
}

PairVector admissible(PairVector r, const PairVector& w, const FrictionLaw& law)
{
  r[0] = std::max(0., r[0]);
  const double shrink = disc_factor(r[1], r[2], coefficient_at(law, w) * r[0]);
  r[1] *= shrink;
  r[2] *= shrink;
  return r;
}

NaturalScale natural_scale(const PairBlock& A, double otherwise)
{
  // a pair that cannot move takes the scale of the others, so that a gap it cannot close is not passed over
  const double normal = A[0][0] > 0 ? A[0][0] : otherwise, tangential = std::max(A[1][1], A[2][2]);
  const double rho_n = normal > 0 ? 1 / normal : 1;
  return {rho_n, tangential > 0 ? 1 / tangential : rho_n};
}

PairVector solve_pair(const PairBlock& A, const PairVector& q, int directions, const FrictionLaw& law,
                      const PairVector& last)
{
  if (q[0] >= 0 || A[0][0] <= 0) return {};
  const double mu = friction_coefficient(law, 0).value; // of stick
  if (mu == 0 && law.coefficient == 0) return {-q[0] / A[0][0], 0, 0};
  if (const auto r = stick(A, q); r && holds(*r, mu)) return *r;
  if (has_two_levels(law)) return slip_at(A, q, directions, law.coefficient, last);
  return depends_on_speed(law) ? slip_at_own_speed(A, q, directions, law, last) : slip_at(A, q, directions, mu, last);
}

ContactStatus contact_status(const PairVector& r, const PairVector& w, const FrictionLaw& law, double largest)
{
  if (r[0] <= 0) return ContactStatus::open;
  const double speed = length(w[1], w[2]), at_rest = friction_coefficient(law, 0).value;
  // a pair that has just begun to slide has the friction of its speed, however slow it is
  const double limit = std::min(at_rest, friction_coefficient(law, speed).value) * r[0];
  if (limit - length(r[1], r[2]) <= 1e-8 * largest) return ContactStatus::slip;
  return !depends_on_speed(law) || is_at_rest(law, speed) ? ContactStatus::stick : ContactStatus::slip;
}

std::vector<ContactStatus> contact_status(PairView<const double> reactions, PairView<const double> w,
                                          const PairFriction& friction)
{
  const std::vector<double> largest = largest_of_contacts(friction.contact, reactions.pairs(),
                                                          [&](std::size_t pair) { return reactions.normal(pair); });
  std::vector<ContactStatus> status;
  for (std::size_t pair = 0; pair < reactions.pairs(); ++pair)
  {
    const FrictionLaw& law = friction.of(pair);
    status.push_back(contact_status(reactions.vector(pair), depends_on_speed(law) ? w.vector(pair) : PairVector{}, law,
                                    largest[friction.contact_of(pair)]));
  }
  return status;
}

} // namespace squeal
