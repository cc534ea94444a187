#pragma once
/// Stages after the equilibrium, on a small model, as the program chains them.
#include "small_models.hpp"
#include "squeal/transient/estimate.hpp"

namespace squeal::test
{

inline Modes modes_of(const SmallModel& model, const Equilibrium& equilibrium, const ModesSettings& settings,
                      const ModesOptions& options)
{
  const SlidingEquilibrium sliding{model.structure, model.interface, equilibrium};
  return find_modes(sliding, linearise(sliding), settings, options);
}

inline RealModes real_modes_of(const SmallModel& model, const Equilibrium& equilibrium, double band,
                               const ModesOptions& options)
{
  return find_real_modes_below(linearise({model.structure, model.interface, equilibrium}), band, options);
}

inline Estimate estimate_of(const SmallModel& model, const Equilibrium& equilibrium, const ComplexMode& mode)
{
  const SlidingEquilibrium sliding{model.structure, model.interface, equilibrium};
  return estimate_amplitude(sliding, linearise(sliding), mode);
}

} // namespace squeal::test
