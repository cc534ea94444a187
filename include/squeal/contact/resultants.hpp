#pragma once
/// What the reactions of a contact add up to (src/README.md, section 2.7).
#include "squeal/contact/interface.hpp"

namespace squeal
{

/// Sums over the pairs of one contact.
struct ContactResultant
{
  double normal_force = 0; // [N] sum of r_n
  double closed_share = 0; // [-] of its pairs, those with a normal reaction
  double torque = 0;       // [N m] with which it brakes its rotation: sum of r_t.v_d over the rate; 0 without rotation
};

/// One for each contact of the scene; none on a matrix scene. Not collective: reactions are whole on every rank.
std::vector<ContactResultant> contact_resultants(const Interface& interface, const std::vector<double>& reactions,
                                                 const std::vector<Contact>& contacts);

} // namespace squeal
