#pragma once
/// The limit cycle of the reduced model: its active pairs, its free motion, its shooting (src/README.md, section 7.7).
#include "reduced_flow.hpp"
#include "squeal/cycle/fidelity.hpp"

namespace squeal
{

/// The search for the cycle of the reduced model, as far as it has come.
struct ReducedSearch
{
  CycleProblem& problem; // gains the model, which recorded contact may change for another one
  const CycleOptions& options;
  Fidelity& fidelity;   // gains periods, errors and the account of the model
  double tolerance = 0; // on the residual of the reduced model's cycles
  RealModes real{};     // of the basis
  std::vector<int> active{};
  std::shared_ptr<const ReducedModel> made{};
  MonodromyCorrection correction{}; // where the first shooting began; it preconditions all

  const ReducedModel& model() const { return *made; }
};

struct ReducedCycle
{
  bool converged = false;
  Owned<Vec> motion;   // (du, v) of the full model
  double period = 0;   // [s]
  double energy = 0;   // [J] mean fluctuating
  double residual = 0; // NaN: of a motion that fell to rest
};

/// The reduced model's first cycle, from the problem's start, with as many active pairs as its motion needs. It runs
/// free until it is periodic. Where it outgrows the amplitude that its pairs were chosen for they are chosen anew.
/// Returns why there is none, or nothing.
std::string find_first_reduced_cycle(ReducedSearch& search, ReducedCycle& cycle);

/// The reduced model's cycle at twice as many steps a period.
ReducedCycle cycle_at_twice_the_steps(ReducedSearch& search, const ReducedCycle& cycle);

} // namespace squeal
