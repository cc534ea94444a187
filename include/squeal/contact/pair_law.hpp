#pragma once
/// The friction laws of an interface's pairs: one that they share, and those of contacts that have their own.
#include "squeal/contact/pairs.hpp"
#include "squeal/mesh/contact_pairs.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace squeal
{

/// mu and its derivative in the sliding speed.
struct FrictionCoefficient
{
  double value;      // [-]
  double derivative; // [s/m]
};

/// A law for each pair.
struct PairFriction
{
  FrictionLaw common;               // of pairs whose contact has none of its own
  std::vector<FrictionLaw> own{};   // of contacts
  std::vector<int> number_of_own{}; // of each pair's law in `own`, -1: the common one; empty: all have that
  std::vector<int> contact{};       // of each pair, among which forces are compared; empty: all are of one

  PairFriction() = default;
  PairFriction(const FrictionLaw& law) : common(law) {} // of all pairs

  bool has_own(std::size_t pair) const { return !number_of_own.empty() && number_of_own[pair] >= 0; }

  std::size_t contact_of(std::size_t pair) const
  {
    return contact.empty() ? 0 : static_cast<std::size_t>(contact[pair]);
  }

  const FrictionLaw& of(std::size_t pair) const
  {
    return has_own(pair) ? own[static_cast<std::size_t>(number_of_own[pair])] : common;
  }
};

/// The largest size(pair) of each contact, or a small part of the largest of all: beside it, rounding of the others
/// stays below tolerances. `contact`: of each pair; empty: all are of one.
template <class Size>
std::vector<double> largest_of_contacts(const std::vector<int>& contact, std::size_t pairs, const Size& size)
{
  constexpr double small = 1e-4;
  std::vector<double> largest(1);
  double all = 0;
  for (std::size_t pair = 0; pair < pairs; ++pair)
  {
    const std::size_t own = contact.empty() ? 0 : static_cast<std::size_t>(contact[pair]);
    if (own >= largest.size()) largest.resize(own + 1);
    largest[own] = std::max(largest[own], size(pair));
    all = std::max(all, largest[own]);
  }
  for (double& of_contact : largest) of_contact = std::max(of_contact, small * all);
  return largest;
}

/// With every law changed.
template <class Change> PairFriction changed(PairFriction friction, const Change& change)
{
  change(friction.common);
  for (FrictionLaw& law : friction.own) change(law);
  return friction;
}

/// With the laws of some pairs changed.
template <class Change, class Chosen>
PairFriction changed(PairFriction friction, std::size_t pairs, const Change& change, const Chosen& is_chosen)
{
  const PairFriction others = changed(friction, change);
  const int laws = static_cast<int>(others.own.size());
  friction.own.insert(friction.own.end(), others.own.begin(), others.own.end());
  friction.own.push_back(others.common);
  friction.number_of_own.resize(pairs, -1);
  for (std::size_t i = 0; i < pairs; ++i)
    if (is_chosen(i)) friction.number_of_own[i] = laws + (others.has_own(i) ? others.number_of_own[i] : laws);
  return friction;
}

/// Whether any law of them is so.
template <class Is> bool any_law(const PairFriction& friction, const Is& is)
{
  return is(friction.common) || std::ranges::any_of(friction.own, is);
}

/// Whether a law of them changes with the sliding speed.
inline bool depends_on_speed(const PairFriction& friction)
{
  return any_law(friction, [](const FrictionLaw& law) { return depends_on_speed(law); });
}

/// The laws of the scene's contacts, by their pairs.
inline PairFriction friction_of_pairs(const Scene& scene, const std::vector<ContactPair>& pairs)
{
  PairFriction friction(scene.friction);
  if (scene.contacts.size() > 1)
    for (const ContactPair& pair : pairs) friction.contact.push_back(pair.contact);
  if (std::ranges::none_of(scene.contacts, [](const Contact& contact) { return contact.friction.has_value(); }))
    return friction;
  std::vector<int> number_of_contact;
  for (const Contact& contact : scene.contacts)
  {
    number_of_contact.push_back(contact.friction ? static_cast<int>(friction.own.size()) : -1);
    if (!contact.friction) continue;
    friction.own.push_back(*contact.friction);
    friction.own.back().direction_damping = scene.friction.direction_damping;
  }
  for (const ContactPair& pair : pairs)
    friction.number_of_own.push_back(number_of_contact[static_cast<std::size_t>(pair.contact)]);
  return friction;
}

/// The laws of some of the pairs.
inline PairFriction friction_of_some(PairFriction friction, const std::vector<int>& pairs)
{
  for (std::vector<int>* const numbers : {&friction.number_of_own, &friction.contact})
  {
    if (numbers->empty()) continue;
    std::vector<int> some;
    for (const int pair : pairs) some.push_back((*numbers)[static_cast<std::size_t>(pair)]);
    *numbers = std::move(some);
  }
  return friction;
}

// Signorini-Coulomb contact of one pair (src/README.md, sections 1.3 and 4.5):
//     0 <= w_n _|_ r_n >= 0,   |r_t| <= mu r_n,   w_t = -sigma r_t with sigma >= 0 (zero while |r_t| < mu r_n),
// w_n the gap or its rate, w_t the velocity that friction opposes, mu = mu(|w_t|).
//
// The local problem holds all other pairs: find r with w = A r + q, A the pair's own block of W, symmetric and
// positive semi-definite. It is solved to rounding by the cases of section 4.5. Newton seeks the direction of slip from
// the last one; the circle is scanned when that fails.
//
// Where mu depends on the speed, stick is accepted by mu(0). Slip has the speed v with |w_t| = v at mu(v), which is
// unique while |mu'| r_n A_tt < 1. In a step w_t is s_theta/theta: `law_of_step` takes mu at s_theta. Of two levels of
// mu slip has that of sliding. A pair that slides keeps it until it has turned (`sliding_on`).
//
// In a direction in which neither side can move (a zero row of W), r_t opposes the drive while the pair slides along
// it. It moves nothing there. At rest there, r_t is zero along it.

/// Without the guard of std::hypot against squares out of range, which takes ten times as long: reactions and
/// velocities never have such squares.
inline double length(double x, double y)
{
  return std::sqrt(x * x + y * y);
}

/// A speed over which mu changes [m/s]; 0: it is constant. A pair whose mu changes rests below 1e-5 of it.
inline double speed_scale(const FrictionLaw& law)
{
  if (has_two_levels(law)) return 1e-4; // one at which nothing slides
  return law.decay_speed > 0 || law.factor_at_speed.at.empty() ? law.decay_speed : law.factor_at_speed.at.back();
}

inline bool is_at_rest(const FrictionLaw& law, double speed)
{
  return speed < 1e-5 * speed_scale(law);
}

/// At a sliding speed [m/s].
inline FrictionCoefficient friction_coefficient(const FrictionLaw& law, double speed)
{
  if (!depends_on_speed(law)) return {law.coefficient, 0};
  if (has_two_levels(law)) return {is_at_rest(law, speed) ? law.static_coefficient : law.coefficient, 0};
  if (law.decay_speed == 0)
    return {law.coefficient * factor_at(law.factor_at_speed, speed),
            law.coefficient * slope_at(law.factor_at_speed, speed)};
  const double excess = (law.static_coefficient - law.coefficient) * std::exp(-speed / law.decay_speed);
  return {law.coefficient + excess, -excess / law.decay_speed};
}

/// The derivative of mu(speed) in law.coefficient.
inline double share_of_coefficient(const FrictionLaw& law, double speed)
{
  return law.decay_speed == 0 ? factor_at(law.factor_at_speed, speed) : 1 - std::exp(-speed / law.decay_speed);
}

/// The steepest fall of mu(speed) [s/m]; 0 where mu does not fall, or at once from rest.
inline double steepest_fall(const FrictionLaw& law)
{
  double fall = 0; // at a speed that is given: of the line from there
  for (const double speed : law.factor_at_speed.at)
    fall = std::max(fall, -law.coefficient * slope_at(law.factor_at_speed, speed));
  return law.decay_speed == 0 ? fall : std::max(0., law.static_coefficient - law.coefficient) / law.decay_speed;
}

/// The steepest fall of all of them.
inline double steepest_fall(const PairFriction& friction)
{
  double fall = steepest_fall(friction.common);
  for (const FrictionLaw& law : friction.own) fall = std::max(fall, steepest_fall(law));
  return fall;
}

/// Whether any falls with the speed, if only from rest.
inline bool falls_with_speed(const PairFriction& friction)
{
  return steepest_fall(friction) > 0 ||
         any_law(friction, [](const FrictionLaw& law) { return law.static_coefficient > law.coefficient; });
}

/// The laws as functions of |w_t| where the sliding speed is `part` |w_t|.
inline PairFriction law_of_step(const PairFriction& friction, double part)
{
  return changed(friction,
                 [part](FrictionLaw& law)
                 {
                   law.decay_speed /= part;
                   for (double& speed : law.factor_at_speed.at) speed /= part;
                 });
}

/// mu at the sliding speed of w.
inline double coefficient_at(const FrictionLaw& law, const PairVector& w)
{
  return friction_coefficient(law, length(w[1], w[2])).value;
}

/// The friction r_t = -mu r_n e of a pair that slides with s, e = s/|s|: its derivatives are
///     dr_t = -along dr_n - damping ds,   along = mu e,   damping = mu r_n/|s| (I - e e') + mu' r_n e e'.
struct SlidingFriction
{
  std::array<double, 2> along;                           // [-]
  std::array<std::array<double, 2>, 2> damping;          // [N s/m]
  std::array<std::array<double, 2>, 2> damping_of_speed; // [N s/m] mu' r_n e e' of it
};

/// Zero where s is.
SlidingFriction sliding_friction(const FrictionLaw& law, double r_n, std::span<const double> s);

/// The factor that takes a tangential vector (t1, t2) back onto a disc around zero; 1 inside it.
inline double disc_factor(double t1, double t2, double radius)
{
  const double size = length(t1, t2);
  return size <= radius ? 1 : radius / size;
}

/// The reaction with r_n >= 0 and |r_t| <= mu r_n, mu at the speed of w, that has r's normal and tangential parts as
/// far as allowed.
PairVector admissible(PairVector r, const PairVector& w, const FrictionLaw& law);

/// rho of the natural map [force per velocity].
struct NaturalScale
{
  double normal, tangential;
};

/// 1/A_nn and 1/max A_tt; `otherwise`: a compliance in place of a zero A_nn.
NaturalScale natural_scale(const PairBlock& A, double otherwise);

/// |r - proj(r - rho w)|: zero where the law holds. The disc's radius is mu r_n, since r_n has its own row.
inline double natural_map(const PairVector& r, const PairVector& w, const FrictionLaw& law, const NaturalScale& rho)
{
  const double t1 = r[1] - rho.tangential * w[1], t2 = r[2] - rho.tangential * w[2];
  const double shrink = disc_factor(t1, t2, coefficient_at(law, w) * std::max(0., r[0]));
  const double normal = r[0] - std::max(0., r[0] - rho.normal * w[0]), d1 = r[1] - shrink * t1, d2 = r[2] - shrink * t2;
  return std::sqrt(normal * normal + d1 * d1 + d2 * d2);
}

/// The reaction of a pair's own problem; `last`: its reaction so far, which decides between several slip directions.
PairVector solve_pair(const PairBlock& A, const PairVector& q, int directions, const FrictionLaw& law,
                      const PairVector& last);

/// A r + q
inline PairVector pair_velocity(const PairBlock& A, const PairVector& r, const PairVector& q)
{
  PairVector w = q;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) w[i] += A[i][j] * r[j];
  return w;
}

/// w - A r: q of the local problem, what the other pairs leave.
inline PairVector velocity_without(const PairBlock& A, const PairVector& r, const PairVector& w)
{
  return pair_velocity(A, {-r[0], -r[1], -r[2]}, w);
}

/// The reaction that iterations start with where `r` gives w = A r + q: admissible, and of two levels of mu stick
/// before slip.
inline PairVector first_reaction(const PairBlock& A, const PairVector& r, const PairVector& w, int directions,
                                 const FrictionLaw& law)
{
  return has_two_levels(law) ? solve_pair(A, velocity_without(A, r, w), directions, law, r) : admissible(r, w, law);
}

/// The status of a pair.
enum class ContactStatus : char
{
  open,
  stick,
  slip,
};

/// A closed pair sticks where its friction stays inside the Coulomb disc of rest by more than 1e-8 of the largest
/// normal reaction of its contact. Where mu depends on the speed, friction of slip may be inside that disc too. A pair
/// then sticks only if its friction is inside the disc of its sliding speed w_t as well. That speed must be below 1e-5
/// of the speed over which the law changes.
ContactStatus contact_status(const PairVector& r, const PairVector& w, const FrictionLaw& law, double largest);

/// `w`: contact velocities, which are read where mu depends on the speed; may be empty elsewhere.
std::vector<ContactStatus> contact_status(PairView<const double> reactions, PairView<const double> w,
                                          const PairFriction& friction);

/// The normal law of a step for a pair with a compliance c > 0 (src/README.md, section 4.16):
/// w_n = by_gap g + by_rate B_n v + B_n v+ + by_reaction r_n.
struct CompliantGap
{
  double by_gap = 0;      // [1/s]
  double by_rate = 0;     // [-]
  double by_reaction = 0; // [m/(N s)]
};

inline CompliantGap compliant_gap(double c, double theta, double h)
{
  return {1 / (theta * theta * h), (1 - theta) / theta, c / (theta * theta * h)};
}

// Scales of contact residuals (src/README.md, section 4.6). Arithmetic of one rank.

/// The force that a pair's natural map is compared with [N]: the largest reaction, of its contact or of all. Smaller is
/// the force that gives the pair the largest free velocity `speed`; it then counts. A light pair beside heavy ones is
/// then not passed over.
inline double force_scale(const NaturalScale& rho, double speed, double largest_reaction)
{
  const double own = speed * std::min(rho.normal, rho.tangential);
  return own == 0 ? largest_reaction : largest_reaction == 0 ? own : std::min(own, largest_reaction);
}

} // namespace squeal
