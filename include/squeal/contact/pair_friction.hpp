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

/// Whether a law of them changes with the sliding speed.
inline bool depends_on_speed(const PairFriction& friction)
{
  return depends_on_speed(friction.common) ||
         std::ranges::any_of(friction.own, [](const FrictionLaw& law) { return depends_on_speed(law); });
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

} // namespace squeal
