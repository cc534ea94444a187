#pragma once
/// The friction laws of an interface's pairs: one that they share, and those of contacts that have their own.
#include "squeal/mesh/contact_pairs.hpp"

#include <algorithm>

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

  PairFriction() = default;
  PairFriction(const FrictionLaw& law) : common(law) {} // of all pairs

  bool has_own(std::size_t pair) const { return !number_of_own.empty() && number_of_own[pair] >= 0; }

  const FrictionLaw& of(std::size_t pair) const
  {
    return has_own(pair) ? own[static_cast<std::size_t>(number_of_own[pair])] : common;
  }
};

/// With every law changed.
template <class Change> PairFriction changed(PairFriction friction, const Change& change)
{
  change(friction.common);
  for (FrictionLaw& law : friction.own) change(law);
  return friction;
}

/// Whether a law of them changes with the sliding speed.
inline bool depends_on_speed(const PairFriction& friction)
{
  return friction.common.decay_speed > 0 ||
         std::ranges::any_of(friction.own, [](const FrictionLaw& law) { return law.decay_speed > 0; });
}

/// The laws of the scene's contacts, by their pairs.
inline PairFriction friction_of_pairs(const Scene& scene, const std::vector<ContactPair>& pairs)
{
  PairFriction friction(scene.friction);
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
  if (friction.number_of_own.empty()) return friction;
  std::vector<int> numbers;
  for (const int pair : pairs) numbers.push_back(friction.number_of_own[static_cast<std::size_t>(pair)]);
  friction.number_of_own = std::move(numbers);
  return friction;
}

} // namespace squeal
