#include "squeal/transient/estimate.hpp"

#include "squeal/base/constants.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"

#include <algorithm>
#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <boost/math/tools/minima.hpp>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <cstdint>
#include <limits>

namespace squeal
{

namespace
{

constexpr double infinity = std::numeric_limits<double>::infinity();

// A sliding pair as the mode shakes it, per metre of q and w t = 0 .. 2 pi.
struct PairMotion
{
  std::size_t directions = 1;
  FrictionLaw law;
  double reaction0 = 0;                   // [N] r_n0
  Complex reaction;                       // [N/m] rho at i w
  Complex mode_reaction;                  // [N/m] the mode's own, at lambda
  std::array<Complex, 2> velocity{};      // [1/s] i w B_t phi
  std::array<double, 2> drive{}, along{}; // [m/s] v_d, and its direction e
};

double real_part(Complex z, Complex turn)
{
  return z.real() * turn.real() - z.imag() * turn.imag();
}

// w.(r_t - r_t0) at the instant, over q^2: the small differences are formed before the division.
double power_at(const PairMotion& pair, double q, double angle)
{
  const Complex turn = std::polar(1.0, angle);
  const double change = std::max(real_part(pair.reaction, turn), -pair.reaction0 / q); // of r_n, over q
  double slide[2] = {0, 0}, shake[2] = {0, 0}, speed = 0;
  for (std::size_t i = 0; i < pair.directions; ++i)
  {
    shake[i] = real_part(pair.velocity[i], turn);
    slide[i] = q * shake[i] - pair.drive[i];
    speed = std::hypot(speed, slide[i]);
  }
  if (speed == 0) return 0; // an instant of no measure
  const double mu = friction_coefficient(pair.law, speed).value,
               mu0 = friction_coefficient(pair.law, length(pair.drive)).value;
  double power = 0;
  for (std::size_t i = 0; i < pair.directions; ++i)
  {
    const double heading = -slide[i] / speed;
    power += shake[i] * (mu * (change * heading + pair.reaction0 * (heading - pair.along[i]) / q) +
                         (mu - mu0) * pair.reaction0 * pair.along[i] / q);
  }
  return power;
}

/// The rounding error of the integral: the differences in power_at are of terms of this size.
double rounding(const PairMotion& pair, double q, double length)
{
  const double force = std::abs(pair.reaction) + pair.reaction0 / q;
  const double velocity = std::hypot(std::abs(pair.velocity[0]), std::abs(pair.velocity[1]));
  const double mu = std::max(friction_coefficient(pair.law, 0).value, pair.law.coefficient); // at any speed
  return 100 * std::numeric_limits<double>::epsilon() * mu * force * velocity * length;
}

using Rule = boost::math::quadrature::gauss_kronrod<double, 15>;

// An interval of the integral and the plain rule's value on it.
struct Piece
{
  double from, to, value;
};

// Halves the interval until both halves together agree with the whole. Boost's own bisection does not scale its error
// by the length of an interval, and bisects short ones everywhere.
template <class Power> double bisected(const Power& power, const Piece& whole, double tolerance, int depth)
{
  const double middle = (whole.from + whole.to) / 2;
  const Piece left{whole.from, middle, Rule::integrate(power, whole.from, middle, 0, 0)};
  const Piece right{middle, whole.to, Rule::integrate(power, middle, whole.to, 0, 0)};
  const double sum = left.value + right.value;
  if (depth == 0 || std::abs(sum - whole.value) <= tolerance) return sum;
  return bisected(power, left, tolerance / 2, depth - 1) + bisected(power, right, tolerance / 2, depth - 1);
}

// Integral to an absolute tolerance, but not below rounding, by 7-15 points of Gauss and Kronrod.
double integrate_between(const PairMotion& pair, double q, double from, double to, double tolerance)
{
  constexpr int bisections = 20;
  const auto power = [&](double angle) { return power_at(pair, q, angle); };
  double error = 0;
  const double plain = Rule::integrate(power, from, to, 0, 0, &error);
  if (error <= tolerance) return plain;
  return bisected(power, {from, to, plain}, std::max(tolerance, rounding(pair, q, to - from)), bisections);
}

// Angles in (0, 2 pi) where level + q Re(amplitude e^{i angle}) changes sign.
void add_sign_changes(double level, double q, Complex amplitude, std::vector<double>& angles)
{
  const double size = q * std::abs(amplitude);
  if (size <= std::abs(level)) return;
  const double half = std::acos(-level / size), argument = std::arg(amplitude);
  for (const double angle : {half - argument, -half - argument})
    angles.push_back(angle - two_pi * std::floor(angle / two_pi));
}

Complex along_drive(const PairMotion& pair)
{
  return pair.along[0] * pair.velocity[0] + pair.along[1] * pair.velocity[1];
}

// Mean power over a period, over q^2. Between its kinks, at lift-off and where the sliding reverses, it is smooth.
double mean_power(const PairMotion& pair, double q, double tolerance)
{
  std::vector<double> angles = {0, two_pi};
  add_sign_changes(pair.reaction0, q, pair.reaction, angles);
  add_sign_changes(-std::hypot(pair.drive[0], pair.drive[1]), q, along_drive(pair), angles);
  std::sort(angles.begin(), angles.end());
  double sum = 0;
  for (std::size_t i = 0; i + 1 < angles.size(); ++i)
    if (angles[i + 1] > angles[i]) sum += integrate_between(pair, q, angles[i], angles[i + 1], tolerance);
  return sum / two_pi;
}

// As q -> 0: mu e rho, and what sliding friction damps of the motion.
double linear_power(const PairMotion& pair)
{
  const SlidingFriction friction =
      sliding_friction(pair.law, pair.reaction0, std::span(pair.drive).first(pair.directions));
  double power = 0;
  for (std::size_t k = 0; k < pair.directions; ++k)
  {
    Complex force = friction.along[k] * pair.reaction;
    for (std::size_t l = 0; l < pair.directions; ++l) force -= friction.damping[k][l] * pair.velocity[l];
    power += std::real(std::conj(pair.velocity[k]) * force) / 2;
  }
  return power;
}

std::vector<PairMotion> pair_motions(const SlidingEquilibrium& sliding, const LinearisedSliding& linearised,
                                     const ComplexMode& mode)
{
  const Interface& interface = sliding.interface;
  const Equilibrium& equilibrium = sliding.equilibrium;
  const Complex s(0, mode.lambda.imag()); // the motion assumed neither grows nor decays, and its reactions are those
  const std::vector<Complex> reactions =
      reactions_of(sliding, linearised, ReactionRows::normal, s, mode.real, mode.imaginary);
  const std::vector<double> e = drive_directions(interface), real = relative(interface, mode.real),
                            imaginary = relative(interface, mode.imaginary);
  const int directions = interface.directions;
  std::vector<PairMotion> pairs;
  for (std::size_t i = 0; i < static_cast<std::size_t>(interface.pairs); ++i)
  {
    if (!equilibrium.closed[i]) continue;
    PairMotion pair;
    pair.directions = static_cast<std::size_t>(directions);
    pair.law = interface.friction.of(i);
    pair.reaction0 = PairView(equilibrium.reactions, directions).normal(i);
    pair.reaction = reactions[i];
    pair.mode_reaction = mode.reactions[i];
    for (std::size_t k = 0; k < pair.directions; ++k)
    {
      if (!is_undriven(interface, i)) // it sticks in the mode, and takes no power
        pair.velocity[k] =
            s * Complex(PairView(real, directions).tangential(i)[k], PairView(imaginary, directions).tangential(i)[k]);
      pair.drive[k] = TangentView(interface.drive, directions).of(i)[k];
      pair.along[k] = TangentView(e, directions).of(i)[k];
    }
    pairs.push_back(pair);
  }
  return pairs;
}

// A pair that sticks, with what the mode adds to its reaction per metre of q.
struct StuckPair
{
  double mu = 0;
  PairVector reaction0{};            // [N]
  std::array<Complex, 3> reaction{}; // [N/m]
};

// The least q at which friction reaches its limit at some instant: |a + q b|^2 = mu^2 (n + q m)^2.
double first_slip(const StuckPair& pair)
{
  constexpr int instants = 720;
  double least = infinity;
  for (int i = 0; i < instants; ++i)
  {
    const Complex turn = std::polar(1.0, two_pi * i / instants);
    double A = 0, B = 0, C = 0;
    for (std::size_t k = 0; k < 3; ++k)
    {
      const double sign = k == 0 ? -pair.mu * pair.mu : 1, b = real_part(pair.reaction[k], turn);
      A += sign * b * b;
      B += sign * b * pair.reaction0[k];
      C += sign * pair.reaction0[k] * pair.reaction0[k];
    }
    const double root = B * B - A * C;
    if (root >= 0 && B + std::sqrt(root) > 0) least = std::min(least, std::max(0., -C) / (B + std::sqrt(root)));
  }
  return least;
}

// The pairs that stick at the end of the load path. Collective.
std::vector<StuckPair> stuck_pairs(const SlidingEquilibrium& sliding, const LinearisedSliding& linearised,
                                   const ComplexMode& mode)
{
  const auto& [structure, interface, equilibrium] = sliding;
  std::vector<StuckPair> pairs;
  if (!equilibrium.history || !linearised.contact.friction.get()) return pairs;
  const std::vector<Complex> friction =
      reactions_of(sliding, linearised, ReactionRows::tangential, mode.lambda, mode.real, mode.imaginary);
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
  {
    if (!is_undriven(interface, i) || equilibrium.history->statuses[i] != ContactStatus::stick) continue;
    StuckPair& pair = pairs.emplace_back();
    pair.mu = friction_coefficient(interface.friction.of(i), 0).value;
    pair.reaction0 = PairView(equilibrium.reactions, interface.directions).vector(i);
    pair.reaction[0] = mode.reactions[i];
    const auto directions = static_cast<std::size_t>(interface.directions);
    std::copy_n(friction.begin() + to_int(i * directions), directions, pair.reaction.begin() + 1);
  }
  return pairs;
}

// (Re(phi).A Re(phi) + Im(phi).A Im(phi))
double quadratic_form(Mat A, const ComplexMode& mode)
{
  return dot(mode.real, product(A, mode.real)) + dot(mode.imaginary, product(A, mode.imaginary));
}

// The phase at which the smallest reaction at t = 0, min over pairs of r_n0 + q Re(rho e^{i phase}), is largest. The
// start is on the mode itself, and so is rho.
double best_phase(const std::vector<PairMotion>& pairs, double q)
{
  const auto smallest = [&](double phase)
  {
    double least = infinity;
    for (const PairMotion& pair : pairs)
      least = std::min(least, pair.reaction0 + q * real_part(pair.mode_reaction, std::polar(1.0, phase)));
    return least;
  };
  constexpr int count = 720;
  double best = 0, highest = smallest(0);
  for (int i = 1; i < count; ++i)
  {
    const double phase = two_pi * i / count, height = smallest(phase);
    if (height <= highest + 1e-6 * std::abs(highest)) continue; // of equals, as a symmetric brake has, the first
    best = phase;
    highest = height;
  }
  const double from = best - two_pi / count, to = best + two_pi / count;
  constexpr int bits = std::numeric_limits<double>::digits;
  return boost::math::tools::brent_find_minima([&](double phase) { return -smallest(phase); }, from, to, bits).first;
}

// The least q of six decades at which the interface stops giving more than the damping takes.
template <class Rate> void find_balance(Estimate& result, const Rate& rate, double first_event)
{
  constexpr int per_decade = 10, decades_below = 2, decades_above = 4;
  for (int i = -decades_below * per_decade; i <= decades_above * per_decade; ++i)
  {
    result.curve_amplitude.push_back(first_event * std::pow(10., static_cast<double>(i) / per_decade));
    result.curve_rate.push_back(rate(result.curve_amplitude.back()));
  }
  const double damping = result.damping_rate;
  std::size_t above = 0; // first sample where damping has won after friction did
  for (std::size_t i = 1; i < result.curve_rate.size() && above == 0; ++i)
    if (result.curve_rate[i - 1] > damping && result.curve_rate[i] <= damping) above = i;
  if (above == 0)
  {
    result.outcome = {OutcomeKind::no_balance,
                      result.curve_rate.back() > damping ? "friction gives more than damping takes at any amplitude"
                                                         : "damping takes more than friction gives at any amplitude",
                      0, 0};
    return;
  }
  const double larger = std::max(damping, std::abs(result.friction_rate_linear));
  result.outcome.kind = OutcomeKind::balance;
  constexpr double small = 1e-13; // of `excess`, whose own rounding is near
  const auto excess = [&](double log_q)
  {
    const double value = (rate(std::exp(log_q)) - damping) / larger;
    result.outcome.residual = std::abs(value);
    return result.outcome.residual <= small ? 0 : value;
  };
  std::uintmax_t evaluations = 100;
  const auto bracket = boost::math::tools::toms748_solve(
      excess, std::log(result.curve_amplitude[above - 1]), std::log(result.curve_amplitude[above]),
      (result.curve_rate[above - 1] - damping) / larger, (result.curve_rate[above] - damping) / larger,
      boost::math::tools::eps_tolerance<double>(), evaluations);
  const double log_q = (bracket.first + bracket.second) / 2;
  excess(log_q);
  result.outcome.iterations = static_cast<int>(evaluations);
  result.amplitude = std::exp(log_q);
}

double first_amplitude(double level, double size)
{
  return size > 0 ? level / size : infinity;
}

} // namespace

Estimate estimate_amplitude(const SlidingEquilibrium& sliding, const LinearisedSliding& linearised,
                            const ComplexMode& mode)
{
  const Structure& structure = sliding.structure;
  Estimate result;
  const double omega = mode.lambda.imag();
  if (omega == 0)
  {
    result.outcome = {OutcomeKind::skipped, "the mode grows without vibrating", 0, 0};
    return result;
  }
  const std::vector<PairMotion> pairs = pair_motions(sliding, linearised, mode);
  const double energy = omega * omega * quadratic_form(structure.M, mode) / 2; // E/q^2
  result.damping_rate = omega * omega * quadratic_form(structure.C, mode) / 2 / energy;
  double linear = 0, scale = 0;
  result.lift_off_amplitude = result.reversal_amplitude = result.slip_amplitude = infinity;
  for (const StuckPair& pair : stuck_pairs(sliding, linearised, mode))
    result.slip_amplitude = std::min(result.slip_amplitude, first_slip(pair));
  for (const PairMotion& pair : pairs)
  {
    linear += linear_power(pair);
    scale += std::abs(linear_power(pair));
    result.lift_off_amplitude =
        std::min(result.lift_off_amplitude, first_amplitude(pair.reaction0, std::abs(pair.mode_reaction)));
    result.reversal_amplitude =
        std::min(result.reversal_amplitude,
                 first_amplitude(std::hypot(pair.drive[0], pair.drive[1]), std::abs(along_drive(pair))));
  }
  result.friction_rate_linear = linear / energy;
  const double first = first_event(result);
  const double limit = limiting_event(result);
  if (first == infinity || first <= 0)
  {
    result.outcome = {OutcomeKind::no_balance, "nothing saturates the interface force", 0, 0};
    result.start_amplitude = lift_off_multiple * limit;
    return result;
  }
  // Each pair's share of an absolute tolerance; the rule's finer half is far better than the difference it is held to.
  const double tolerance = 1e-9 * std::max(scale, energy * result.damping_rate) / static_cast<double>(pairs.size());
  MPI_Comm comm = comm_of(structure.K);
  const auto rank = static_cast<std::size_t>(rank_of(comm)), ranks = static_cast<std::size_t>(ranks_of(comm));
  const auto rate = [&](double q)
  {
    double power = 0;
    for (std::size_t i = rank; i < pairs.size(); i += ranks) power += mean_power(pairs[i], q, tolerance);
    MPI_Allreduce(MPI_IN_PLACE, &power, 1, MPI_DOUBLE, MPI_SUM, comm);
    return power / energy;
  };
  find_balance(result, rate, first);
  result.mean_energy = energy * result.amplitude * result.amplitude;
  const double q = result.outcome.kind == OutcomeKind::balance ? result.amplitude : limit;
  if (q < infinity) result.phase = best_phase(pairs, q);
  result.start_amplitude = result.outcome.kind == OutcomeKind::balance ? result.amplitude : lift_off_multiple * limit;
  return result;
}

double first_event(const Estimate& estimate)
{
  return std::min(estimate.lift_off_amplitude, estimate.reversal_amplitude);
}

double limiting_event(const Estimate& estimate)
{
  return std::isfinite(estimate.lift_off_amplitude) ? estimate.lift_off_amplitude : estimate.reversal_amplitude;
}

std::optional<State> estimated_motion(const Equilibrium& equilibrium, const ComplexMode& mode, const Estimate& estimate)
{
  const double amplitude = estimate.start_amplitude;
  if (!(amplitude > 0) || !std::isfinite(amplitude) || mode.lambda.imag() == 0) return std::nullopt;
  State motion = mode_state(equilibrium, mode, amplitude, estimate.phase);
  check(VecAXPY(motion.u, -1, equilibrium.u));
  return motion;
}

void add_motion(const State& motion, double factor, State& state)
{
  check(VecAXPY(state.u, factor, motion.u));
  check(VecAXPY(state.v, factor, motion.v));
}

State mode_state(const Equilibrium& equilibrium, const ComplexMode& mode, double amplitude, double phase)
{
  const Complex shape = amplitude * std::polar(1.0, phase), speed = mode.lambda * shape;
  State state;
  state.u = copy_of(equilibrium.u);
  state.v = zeros_like(equilibrium.u);
  check(VecAXPY(state.u, shape.real(), mode.real));
  check(VecAXPY(state.u, -shape.imag(), mode.imaginary));
  check(VecAXPY(state.v, speed.real(), mode.real));
  check(VecAXPY(state.v, -speed.imag(), mode.imaginary));
  state.reactions = equilibrium.reactions;
  return state;
}

} // namespace squeal
