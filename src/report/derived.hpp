#pragma once
/// What the report derives from results and the scene: sums of forces, the step's own error, chatter, names.
#include "squeal/report/report.hpp"

#include <limits>

namespace squeal
{

/// Over the closed pairs [N]; zeros when none is.
struct NormalForces
{
  int closed = 0;
  double sum = 0, least = 0, greatest = 0;
};

NormalForces normal_forces(const Equilibrium& equilibrium);

/// What theta and the step do to the followed mode by the theory of the scheme, relative; NaN where none oscillates.
struct StepBias
{
  double growth = std::numeric_limits<double>::quiet_NaN();
  double frequency = std::numeric_limits<double>::quiet_NaN();
};

StepBias transient_bias(const Report& report);
StepBias cycle_bias(const Report& report);

/// A number of the scene with its name and unit, where it has them: "contact.1.gap (pad on disc) [m]".
std::string number_text(const Scene& scene, const std::string& key);

/// The part of the normal force that alternates from step to step: rms of its second difference / 4, over its mean.
double chatter(const History& history);

} // namespace squeal
