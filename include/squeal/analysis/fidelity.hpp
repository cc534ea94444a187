#pragma once
/// The cycle with no more model than the wish needs (method, section 7).
///
/// The reduced model's cycle y (analysis/reduced.hpp) is tried on the full model for one period: x = u0 + shapes y,
/// d = Phi(x) - x. What that period saw and the reduced model did not is put back,
///     Phi_r(y') + c = y',   c = R d - (Phi_r(y) - y),   R: coordinates in the shapes,
/// which is shooting on the reduced model again, and what lies outside the shapes moves by its own defect. This is the
/// full model's fixed point, so how far one such correction moves frequency and energy is the error of x, and
/// corrections repeated (accelerated: Anderson 1965) converge to the full cycle, one full period each.
///
/// "reduced": one period of the full model tells the error. "auto": corrections until the wish is met; the number of
/// steps a period from the reduced model's own cycle at twice as many; what the full period shows to open,
/// close or stick among the pairs taken as sliding becomes active; where corrections do not contract, where the reduced
/// model would not be small, or where several modes are unstable, the full model takes over.
#include "squeal/analysis/cycle.hpp"

namespace squeal
{

/// What was used, what was left out, and how that is known. Errors are relative; energy: the mean fluctuating one.
struct Fidelity
{
  std::string asked = "full", used = "full"; // full, reduced; asked: auto as well
  std::string reason;                        // in a sentence
  double accuracy = 0;                       // the wish
  int size = 0, modes = 0, attachment_shapes = 0;
  int active_pairs = 0, sliding_pairs = 0; // sliding: eliminated; the rest stays open
  int steps_per_period = 0;
  double contact_tolerance = 0;
  long reduced_periods = 0, full_periods = 0;
  double frequency_error = 0, energy_error = 0;           // of the model: what the last correction moved
  double step_frequency_error = 0, step_energy_error = 0; // of the step size
  double reduction_seconds = 0, reduced_seconds = 0, full_seconds = 0;
};

struct FittedCycle
{
  LimitCycle cycle;
  Fidelity fidelity;
};

/// Options, prefix -reduced_: margin, modes, threshold, free_periods, corrections.
FittedCycle find_fitted_cycle(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                              const Modes& modes, const Estimate& estimate, const CycleSettings& settings,
                              const std::string& fidelity, double accuracy, Mat probes);

} // namespace squeal
