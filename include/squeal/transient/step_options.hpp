#pragma once
/// How steps are made, of the transient and of the cycle.
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/contact/solver.hpp"

namespace squeal
{

/// Options -transient_... of the step.
struct StepOptions
{
  ContactSettings contact{};
  bool refuse = true;     // what step_guards.hpp refuses
  FactorOptions factor{}; // those of ProgramOptions
};

} // namespace squeal
