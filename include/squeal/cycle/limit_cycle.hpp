#pragma once
/// How a cycle is sought, and how the reduced model serves.
#include "squeal/cycle/period_map.hpp"
#include "squeal/shooting/multipliers.hpp"
#include "squeal/shooting/shooting.hpp"

#include <optional>

namespace squeal
{

/// Choices of the cycle.
struct CycleOptions
{
  ShootingOptions shooting;
  PetscInt samples = 32; // displacements kept over the last period
  PetscInt reduced_modes =
      100000; // complex modes of a reduced model at most, the nearest in frequency to the followed one
};

// The brake's limit cycle by shooting at its period map (src/README.md, section 6). States are compared in the energy
// norm sqrt(u'K u + v'M v) only. All functions are collective. Those that integrate throw Interrupted where the run is
// asked to end.

/// What one factorisation of the step costs.
struct StepCosts
{
  double factor_seconds = 0, condensed_seconds = 0;
};

/// outcome: as of shooting (shooting/shooting.hpp); "skipped", "refused" or "off" where nothing was integrated.
struct LimitCycle
{
  Outcome outcome;
  int steps_per_period = 0;
  double tolerance = 0; // that the residual met; 0: the accuracy was judged instead
  double theta = 0.5;
  Orbit orbit;             // the cycle, or the best candidate met
  Convergence convergence; // its periods include the measured one
  Multipliers multipliers;
  MeasuredPeriod measured; // from the orbit's state
  Orbit free;              // the end of the free motion that the search went on from; null where there was none
  StepCosts costs;         // of the last theta step made
  bool cut_short = false;  // the run was asked to end in the search for multipliers, or for finer steps
  std::vector<OffsetSpread> spreads{}; // over the offsets that joints hold; where the whole tangent is cheap
};

struct ReducedModel;

/// An orbit near a cycle, of a search that was ended before.
struct ResumedOrbit
{
  State state;
  double period = 0; // [s]
};

/// The brake about its sliding equilibrium, and what is asked of its cycle.
struct CycleProblem
{
  SlidingEquilibrium sliding;
  const LinearisedSliding& linearised;
  const std::vector<ComplexMode>& modes; // all in the band
  UnstableModes unstable;                // those that it starts from; the cycle follows the first
  CycleSettings settings;
  const StepOptions& step;
  const ModesOptions& modes_options; // of real modes beyond the band
  Mat probes = nullptr;
  const State* given = nullptr;          // where CycleStartKind::transient and ::file start
  double given_period = 0;               // [s] of the cycle that is given; 0: none is, and the mode's is taken
  int given_rounds = 1;                  // as many as that period may be of the cycle
  const ResumedOrbit* resumed = nullptr; // where shooting at the full model goes on, whatever it started from
  const ReducedModel* reduced = nullptr; // whose cycle it starts from
};

/// The problem of another brake, at its equilibrium.
CycleProblem at_equilibrium(const CycleProblem& problem, const SlidingEquilibrium& sliding);

/// The problem with other settings.
CycleProblem with_settings(CycleProblem problem, const CycleSettings& settings);

/// Those of the unstable modes that are not followed, at their estimated amplitudes, about the equilibrium.
std::vector<State> other_unstable_motions(const CycleProblem& problem);

/// The state that the scene asks the search to start from. It is the modes at their estimated amplitudes, the followed
/// one at an amplitude, or the state given. Nothing where there is no amplitude to start from.
std::optional<State> cycle_start(const CycleProblem& problem);

/// The amplitude of the followed mode whose fluctuating energy is the state's. [m]
double equivalent_amplitude(const CycleProblem& problem, const State& state);

/// The cycle from the scene's start.
LimitCycle find_cycle_from_start(const CycleProblem& problem, const CycleOptions& options);

/// The cycle from the resumed orbit.
LimitCycle find_cycle_from_resumed(const CycleProblem& problem, const CycleOptions& options,
                                   const Preconditioner* preconditioner);

/// The cycle from any start, after a number of free periods. `preconditioner`: null: that of the last of these.
LimitCycle find_cycle_from(const CycleProblem& problem, const CycleOptions& options, const ShootingStart& start,
                           const Preconditioner* preconditioner, int free_periods);

// The checkpoint of a search for a cycle: the orbit that it has reached. A restarted search begins there, and finds
// the same cycle to its tolerance.

/// The orbit of the run that is gone on with; nothing where there is none. Collective.
std::optional<ResumedOrbit> kept_cycle(const Structure& structure);

/// Keeps the orbit from this start. Collective.
void keep_cycle(const Structure& structure, Vec start, double period);

/// Wraps the flow, which keeps the last orbit near a cycle that it integrates, when a checkpoint is due.
void keep_cycles_of(Flow& flow, const Structure& structure);

} // namespace squeal
