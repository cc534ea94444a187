#pragma once
/// The shapes of a motion in time (src/README.md, section 7.10). Velocities v at equal steps are kept as
///     v = V q + what is left out,   V'M V = 1,   q = V'M v,   so that the kinetic energy of V q is q'q/2.
/// V grows by what it misses of a sample. At the end it is turned to the principal axes of the samples, and those of
/// little energy are left out.
#include "squeal/algebra/multivector.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/cycle/fidelity.hpp"
#include "squeal/cycle/limit_cycle.hpp"
#include "squeal/settled/motion.hpp"

#include <vector>

namespace squeal
{

/// Samples of a velocity on few shapes.
struct MotionShapes
{
  MultiVector V;                                // [kg^-1/2]
  std::vector<std::vector<double>> coordinates; // [shape][sample] q [m/s kg^1/2]
  std::vector<double> squares;                  // v'Mv of each sample [J]
  double largest = 0;                           // of those, whose V is to be met [J]
  double left_out = 0;                          // part of the kinetic energy that the shapes miss
};

// The settled motion of the brake where no cycle attracts (src/README.md, section 7.10).

/// outcome: "settled"; "not converged" where the motion never became stationary or its kind is undecided; "skipped"
/// where a cycle answers.
struct SettledMotion
{
  Outcome outcome;
  int steps_per_period = 0; // the nearest number
  ExaminedMotion examined;
  MeanValue fluctuating_energy, energy; // [J]
  double step_error = 0; // [J] what the mean of the fluctuating energy changes by with half as many steps a period
  double least_energy = 0, greatest_energy = 0;       // [J] of the means of the fluctuating energy over single periods
  MeanValue damping_power, contact_power, load_power; // [W]
  MeanValue open_fraction, stick_fraction, slip_fraction;
  std::vector<MeanValue> peak_to_peak; // [m] within a period, of each probe
  State end;                           // of the last period
  History history;                     // of all windows
  MotionShapes shapes;                 // of all windows, the strongest of those that were stationary
  int sampled_steps = 1;               // between two samples of the shapes
};

/// Whether half as many steps a period change the energy by a fifth or amplitudes by a tenth. The grid of time may then
/// have a part in the kind of motion. Not collective.
bool depends_on_steps(const SettledMotion& motion);

/// Makes a kind that was decided undecided between itself and what finer steps would show, with what was seen of them.
/// Not collective.
void leave_to_finer_steps(SettledMotion& motion, const std::string& seen = {});

/// Where the motion answers, the outcome of the search for a cycle becomes "settled". Not collective.
void take_as_answer(const SettledMotion& motion, Outcome& of_cycle);

/// Integrates on from the end of the search's free motion. Collective. A run that is asked to end throws Interrupted.
SettledMotion find_settled_motion(const CycleProblem& problem, const LimitCycle& cycle, SettledOptions options);

// The motion that was found from a point, and how it was sought.

/// One attempt to find what vibrates.
struct Attempt
{
  std::string name;
  int steps_per_period = 0; // with which it began
  Outcome outcome;          // why it ended
};

/// The mode that the search for a cycle follows.
struct FollowedMode
{
  std::size_t index = 0;            // among the modes
  std::optional<Estimate> estimate; // where a given start chose it
};

/// Complete once it is returned; no stage changes it.
struct Motion
{
  LimitCycle cycle;
  Fidelity fidelity;     // of the cycle: the model that it was found on, and its errors
  SettledMotion settled; // where no cycle attracts
  FollowedMode followed;
  std::vector<Attempt> attempts; // in order
};

} // namespace squeal
