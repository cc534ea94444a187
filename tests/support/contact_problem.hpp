#pragma once
/// One contact problem without a past.
#include "squeal/contact/solver.hpp"

namespace squeal::test
{

inline ContactResult solve_contact(const ContactOperator& W, const std::vector<double>& b, const FrictionLaw& friction,
                                   const ContactSettings& settings, std::vector<double>& r)
{
  ContactMemory nothing;
  const ContactProblem problem{b, r, nothing};
  return solve_contacts(W, friction, settings, std::span(&problem, 1))[0];
}

} // namespace squeal::test
