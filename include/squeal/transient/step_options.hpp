#pragma once
/// Which variant of the theta step is marched (src/README.md, section 4.2), of the transient and of the cycle.
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/contact/interface.hpp"
#include "squeal/contact/solver.hpp"

namespace squeal
{

/// displacement: contact on u + h (1-theta) v, as the step has it. velocity (Moreau-Jean): where gap + B_n ut <= 0, 0
/// <= B_n v+ _|_ r_n >= 0, elsewhere r = 0; the gap then drifts by O(h).
enum class ContactLaw
{
  displacement,
  velocity,
};

inline constexpr std::array contact_law_words = {"displacement", "velocity"};

inline Words words_of(ContactLaw)
{
  return contact_law_words;
}

/// What friction opposes: s_theta, or s+.
enum class Opposed
{
  theta,
  end,
};

inline constexpr std::array opposed_words = {"theta", "end"};

inline Words words_of(Opposed)
{
  return opposed_words;
}

/// Options -transient_... of the step.
struct StepOptions
{
  ContactLaw law = ContactLaw::displacement;
  Opposed opposed = Opposed::theta;
  ContactSettings contact{};
  OperatorStorage storage = OperatorStorage::automatic; // of W
  bool refuse = true;                                   // what step_guards.hpp refuses
  FactorOptions factor{};                               // listed by itself
};

OptionList options_of(StepOptions& options);

/// Throws Error where pairs with a compliance meet the velocity law, which has none.
void check_step_law(const StepOptions& options, const Interface& interface);

} // namespace squeal
