#pragma once
/// The limit cycle by shooting (method, section 6): Phi_T(x0) = x0 for the period T and the initial state.
///
/// The solver sees a flow only, so that any model with a period map can be shot at: the brake's exact-contact theta
/// step, or a smooth oscillator in a test.
#include "squeal/analysis/transient.hpp"

namespace squeal
{

/// Flow of an autonomous system over one period, in fixed N steps, on states (u, v).
struct Flow
{
  /// end = Phi_period(start); returns the derivative of the end state in the period through `rate` (u', v' at the end).
  std::function<void(double period, const State& start, State& end, State& rate)> integrate;
  /// Energy norm squared of a state difference (du, dv): du'K du + dv'M dv; products for the inner product.
  Mat M = nullptr, K = nullptr;
};

struct NewtonRecord
{
  std::string stage; // "free", "reduced", "grown base", "multisecant", "newton-krylov"
  int unknowns = 0;
  long periods = 0;  // integrated so far
  double period = 0; // [s]
  double residual_projected = 0, residual_full = 0;
};

/// outcome: "converged", "collapsed to equilibrium", "not converged", "not periodic", "skipped".
/// residual: the full-space one, |Phi_T(x0) - x0| / |x0 - equilibrium| in the energy norm.
struct LimitCycle
{
  Outcome outcome;
  double period = 0; // [s]
  int steps_per_period = 0;
  double residual_projected = 0, residual_full = 0;
  int newton_iterations = 0;
  long periods_integrated = 0;
  State start;
  std::vector<NewtonRecord> records;
  // over the last period
  double mean_energy = 0, mean_fluctuating_energy = 0; // [J]
  double open_pairs_mean = 0;
  int open_pairs_max = 0, stick_pairs_max = 0;
  std::vector<double> peak_to_peak;                 // per probe [m]
  History history;                                  // of one period
  std::vector<Owned<Vec>> displacements;            // samples of u over the period, for fields.h5
  std::vector<std::vector<ContactStatus>> statuses; // [step][pair]
};

} // namespace squeal
