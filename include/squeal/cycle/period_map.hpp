#pragma once
/// The brake's period map Phi_T in N theta steps of h = T/N (src/README.md, sections 4 and 6.2).
///
/// The derivative in the period is (x_(N+1) - x_(N-1))/2h. That is exact for theta = 1/2 and a linear structure, stiff
/// modes included.
///
/// A map that keeps its step integrates a period T near N h with the h at hand. It goes on from N h to T along that
/// derivative, as long as what this neglects is small (section 6.2). A and W are then those of the period before. It
/// solves contact no better than the period before calls for, too. All functions are collective. Those that integrate
/// throw Interrupted where the run is asked to end.
#include "squeal/cycle/joints.hpp"
#include "squeal/transient/theta_step.hpp"
#include "squeal/transient/transient.hpp"

namespace squeal
{

/// The step of the last period that was integrated with its rate, or asked for exactly, and how far it reaches.
struct KeptStep
{
  double h = 0;         // [s]; 0: none
  double curvature = 0; // [1/s2] |d2v/dT2|/|v| at the end
  double moved = 0;     // |v(T) - v(0)|/|v(0)|
};

/// Keeps A and W of the last step size.
struct PeriodMap
{
  SlidingEquilibrium sliding; // what measurements refer to
  StepOptions options;
  int steps = 0;
  double theta = 0.5;
  ThetaStep step{};
  std::vector<double> reactions{};   // warm start: at the end of the last period integrated with its rate
  long unconverged = 0;              // steps whose contact did not converge
  std::vector<StepRecord> records{}; // of the period recorded last, with the step at hand
  Owned<Vec> recorded_start{};       // of that period, if its steps are the flow's own
  double recorded_step = 0;          // [s]
  std::vector<StepEvent> events{};   // inside the recorded steps, where they are asked for
  bool keeps_step = false;           // where factors and passes of contact cost more than what is neglected
  KeptStep kept{};
  JointMotion joints{}; // of the period integrated last; where there are undriven pairs
  OwnRest rest{};       // at the offsets of that period
};

inline constexpr int enough_steps = 128; // a period: with as many at most, what finer ones change is in the bars

/// Makes A and W those of h = T/N, unless they are already.
void set_period(PeriodMap& map, double period);

/// Moves a state on by part of a step: Hermite's interpolation between the ends of the step.
void move_by_part(const PeriodMap& map, double part, State& state);

/// Records the contact of each step of a period.
void record_period(PeriodMap& map, double period, Vec start, const TimeGrid& grid);

/// Notes what undriven pairs did in the period recorded last from this start, and moves the rest to it.
void note_joints(PeriodMap& map, Vec start);

/// The map as a flow for shooting, with its exact tangent and the offsets of undriven pairs. Borrows the map.
Flow flow_of(PeriodMap& map);

// One period of the brake, recorded, and what is measured on it (src/README.md, section 6.10).

/// The measures of one period.
struct MeasuredPeriod
{
  State start;                                         // with the reactions there
  double mean_energy = 0, mean_fluctuating_energy = 0; // [J] fluctuating: with u - u0
  double open_pairs_mean = 0;
  int open_pairs_max = 0, stick_pairs_max = 0;
  std::vector<double> peak_to_peak; // [m] per probe
  History history;
  JointUse joints{};
  std::vector<Owned<Vec>> displacements;            // [m] samples of u, evenly spread over the period
  std::vector<std::vector<ContactStatus>> statuses; // [step][pair]
};

/// The record of a period that is asked for.
struct Recording
{
  Mat probes = nullptr; // a row for each probe, or null
  PetscInt samples = 0; // of the displacements
};

/// Integrates a period from the state `start`. Collective. Where the run is asked to end it throws Interrupted.
MeasuredPeriod measure_period(PeriodMap& map, const Recording& recording, double period, Vec start);

} // namespace squeal
