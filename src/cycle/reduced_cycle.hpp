#pragma once
/// The limit cycle of the reduced model: its active pairs, its free motion, its shooting (src/README.md, section 7.7).
#include "reduced_flow.hpp"
#include "squeal/cycle/fidelity.hpp"

namespace squeal
{

/// The search for a cycle by way of the reduced model, as far as it has come.
struct ReducedSearch
{
  const CycleProblem& problem;
  const CycleOptions& options;
  Fidelity fidelity;    // gains periods, errors and the account of the model
  int steps = 0;        // a period
  double tolerance = 0; // on the residual of the reduced model's cycles
  RealModes real{};     // of the basis
  std::vector<int> active{};
  ReducedModel model{};
  EnergyMatrices energy{};
  MonodromyCorrection correction{}; // preconditions the reduced model's shooting and the full one's
};

struct ReducedCycle
{
  bool converged = false;
  ReducedState state;
  double period = 0;   // [s]
  double energy = 0;   // [J] mean fluctuating
  double residual = 0; // NaN: of a motion that fell to rest
};

/// The reduced model's first cycle, from the estimate, with as many active pairs as its motion needs. It runs free
/// until it is periodic. Where it outgrows the amplitude that its pairs were chosen for they are chosen anew. Returns
/// why there is none, or nothing.
std::string find_first_reduced_cycle(ReducedSearch& search, ReducedCycle& cycle);

/// The cycle of the reduced model near `start`, with another number of steps a period. The same on every rank.
ReducedCycle find_reduced_cycle(ReducedSearch& search, const ReducedCycle& start, int steps);

/// The reduced model's cycle at twice as many steps gives the step's errors. Further ones are unknown, NaN.
void estimate_reduced_step_errors(ReducedSearch& search, const ReducedCycle& cycle);

/// A motion of the reduced model as a state (du, v) of the full one, about the equilibrium.
Owned<Vec> full_motion(const ReducedSearch& search, const ReducedState& state);

} // namespace squeal
