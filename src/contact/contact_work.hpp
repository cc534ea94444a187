#pragma once
/// The state that the contact solvers share: one problem while it is being solved.
#include "squeal/contact/pair_law.hpp"
#include "squeal/contact/solver.hpp"

namespace squeal
{

using Scales = std::vector<double>; // of forces, one a contact [N]

struct ContactWork
{
  const ContactOperator& W;
  const PairFriction& friction;
  const std::vector<double>& b;
  std::vector<double>& r;
  std::vector<double> Wr; // at the last product with W
  double speed = 0;       // the largest free velocity
  int reads = 0;          // products with W
  ContactResult result{};

  /// `largest`: reaction of each contact.
  double scale_of(std::size_t pair, const Scales& largest) const
  {
    return force_scale(W.scale(pair), speed, largest[friction.contact_of(pair)]);
  }

  PairVector reaction(std::size_t pair) const { return PairView(r, W.directions()).vector(pair); }

  /// W r + b
  PairVector velocity(std::size_t pair) const
  {
    const PairVector free = PairView(b, W.directions()).vector(pair),
                     change = PairView(Wr, W.directions()).vector(pair);
    return {free[0] + change[0], free[1] + change[1], free[2] + change[2]};
  }
};

/// The largest reaction of each contact.
Scales largest_reactions(const ContactWork& work);

/// By how much the law of a pair with the velocity w is missed, over the scale of its forces; `largest`: reaction of
/// each contact. Infinite where a number is not finite.
double defect_of(const ContactWork& work, std::size_t pair, const PairVector& w, const Scales& largest);

/// The largest defect of all pairs.
double residual_of(const ContactWork& work);

/// Forms W r. Collective of the ranks that share W.
void form_product(ContactWork& work);

/// Block Gauss-Seidel (src/README.md, section 4.7). W r must be fresh, and is in the end. Collective of the ranks that
/// share W.
void gauss_seidel(ContactWork& work, const ContactSettings& settings);

} // namespace squeal
