#pragma once
/// One period of the brake, recorded, and what is measured on it (src/README.md, section 6.10).
#include "squeal/cycle/period_map.hpp"

namespace squeal
{

/// What is measured on one period.
struct MeasuredPeriod
{
  State start, end;                                    // with the reactions there
  double mean_energy = 0, mean_fluctuating_energy = 0; // [J] fluctuating: with u - u0
  double open_pairs_mean = 0;
  int open_pairs_max = 0, stick_pairs_max = 0;
  std::vector<double> peak_to_peak; // [m] per probe
  History history;
  JointUse joints{};
  std::vector<Owned<Vec>> displacements;            // [m] samples of u, evenly spread over the period
  std::vector<std::vector<ContactStatus>> statuses; // [step][pair]
};

/// What is kept of a period.
struct Recording
{
  Mat probes = nullptr; // a row for each probe, or null
  PetscInt samples = 0; // of the displacements
};

/// Integrates a period from the state `start`. `rate`: dPhi/dperiod at its end, or null. Collective. Where the run is
/// asked to end it throws Interrupted.
MeasuredPeriod measure_period(PeriodMap& map, const Recording& recording, double period, Vec start, Vec rate);

} // namespace squeal
