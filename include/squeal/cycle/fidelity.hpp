#pragma once
/// The cycle on no larger a model than the accuracy asked for needs (src/README.md, section 7).
///
/// The reduced model (reduction/reduced_model.hpp) runs free from the estimate until its motion is periodic, its active
/// pairs chosen again where it outgrows the amplitude they were chosen for, and is shot at. Its cycle x_r is the start
/// on the full model, its derivative the preconditioner: P^-1 (Phi(x) - x) is what remains to be corrected, less and
/// less of it by secants, one period of the full model each. What a step would change frequency and energy by is the
/// error of x: twice that, or half of the step before, since their signs alternate.
///
/// "reduced": a period of the full model gives the reduced cycle's error, a cycle at twice as many steps the step's.
/// "auto": the full model's cycle to the accuracy, at few steps a period and at twice as many. Both, and the scheme's
/// order, give the number of steps that the accuracy needs and the cycle to be expected there, which one or two periods
/// correct. Three such cycles give the order. Where that does not converge, where the reduced model would not be small,
/// or where several modes are unstable, the full model is shot at instead. The active pairs and the reduced model's
/// errors decide how soon this ends, not where.
#include "squeal/cycle/limit_cycle.hpp"

namespace squeal
{

/// The model asked for, and how accurate its cycle shall be.
struct FidelityRequest
{
  CycleModel model = CycleModel::full;
  double accuracy = 0; // [-] of frequency and energy
};

/// What was used, what was left out, and how that is known. Errors are relative; energy: the mean fluctuating one.
struct Fidelity
{
  CycleModel asked = CycleModel::full, used = CycleModel::full; // used: full or reduced
  std::string reason;                                           // in a sentence
  double accuracy = 0;                                          // asked for
  int size = 0, modes = 0, attachment_shapes = 0;
  int active_pairs = 0, sliding_pairs = 0; // sliding: eliminated; the rest stays open
  int steps_per_period = 0;
  double contact_tolerance = 0;
  long reduced_periods = 0, full_periods = 0;
  double frequency_error = 0, energy_error = 0;           // of the model: what all further corrections would change
  double step_frequency_error = 0, step_energy_error = 0; // of the step size
  double reduction_seconds = 0, reduced_seconds = 0, full_seconds = 0;
};

struct FittedCycle
{
  LimitCycle cycle;
  Fidelity fidelity;
};

FittedCycle find_fitted_cycle(const CycleProblem& problem, const FidelityRequest& request, const CycleOptions& options);

} // namespace squeal
