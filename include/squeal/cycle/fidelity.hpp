#pragma once
/// The cycle on no larger a model than the accuracy asked for needs (src/README.md, section 7.8).
///
/// The reduced model (reduction/reduced_model.hpp) runs free from the estimate until its motion is periodic. Where it
/// outgrows the amplitude that its active pairs were chosen for, they are chosen again. Then it is shot at. Its cycle
/// is the start on the full model.
///
/// With "reduced" a period of the full model gives the reduced cycle's error, a cycle at twice as many steps the
/// step's. With "auto" what the scene gives is kept. Where it leaves the steps open, the full model's cycle is found at
/// few, and its verdict is given there. Two further numbers of steps give the error of the step and the number that the
/// accuracy needs. The start is the estimate on the full model where the reduced model would not be small or has no
/// cycle. So it is where several modes are unstable. The reduced model decides how soon this ends, not where.
#include "squeal/cycle/limit_cycle.hpp"

namespace squeal
{

/// Where the scene leaves them open: the steps a period at which "auto" begins, the tolerance on the full-space
/// residual.
inline constexpr int first_steps = 64;
inline constexpr double plain_tolerance = 1e-5;

/// Twice as many steps a period, and again, while they are refused and few enough to try.
template <class Refused> int permitted_steps(int steps, const Refused& is_refused)
{
  constexpr int most = 4096;
  while (steps < most && is_refused(steps)) steps *= 2;
  return steps;
}

/// The model asked for, and how accurate its cycle shall be.
struct FidelityRequest
{
  CycleModel model = CycleModel::full;
  double accuracy = 0;           // [-] of frequency and energy
  int begin_steps = first_steps; // a period at which "auto" begins where the scene leaves them open
};

/// The model that a cycle was found on, with its errors, which are relative; energy: the mean fluctuating one.
struct Fidelity
{
  CycleModel asked = CycleModel::full, used = CycleModel::full; // used: full or reduced
  std::string reason;                                           // in a sentence
  double accuracy = 0;                                          // asked for
  int size = 0, modes = 0, attachment_shapes = 0;
  int left_out_shapes = 0;                     // attachments beyond the cap
  double lost_compliance = 0;                  // mean part of the active pairs' own compliance that is theirs
  int active_pairs = 0, sliding_pairs = 0;     // sliding: eliminated; the rest stays open
  int steps_per_period = 0, verdict_steps = 0; // of the cycle; where its stability was judged
  bool chooses_steps = false;                  // until the accuracy is met; else the scene gives them
  double contact_tolerance = 0;
  long reduced_periods = 0, full_periods = 0;
  /// Errors of the model: the change by all further corrections. NaN: not known.
  double frequency_error = std::numeric_limits<double>::quiet_NaN(), energy_error = frequency_error;
  double step_frequency_error = frequency_error, step_energy_error = frequency_error; // of the step size
};

/// A cycle and how it was found.
struct FittedCycle
{
  LimitCycle cycle;
  Fidelity fidelity;
  std::optional<Outcome> on_reduced{}; // of an attempt by way of the reduced model that left it to the full one
};

/// Finds the cycle: by way of the reduced model's where that was asked for or may do. Else on the full model from the
/// problem's start. Collective. A search that fails has its outcome and reason. Error: a reduced model that was asked
/// for cannot be made.
FittedCycle find_fitted_cycle(const CycleProblem& given, const FidelityRequest& request, const CycleOptions& options);

} // namespace squeal
