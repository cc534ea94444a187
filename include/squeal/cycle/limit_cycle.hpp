#pragma once
/// How a cycle is sought, and how the reduced model serves.
#include "squeal/cycle/period_map.hpp"
#include "squeal/shooting/multipliers.hpp"
#include "squeal/shooting/shooting.hpp"

#include <optional>

#include <memory>
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

/// The time of one factorisation of the step.
struct StepCosts
{
  double factor_seconds = 0, condensed_seconds = 0;
};

/// The result of shooting, and what is measured on it. outcome: "skipped", "refused" or "off" as well, where nothing
/// was integrated. orbit: the cycle, or the best candidate met. convergence: its periods include the measured one.
struct LimitCycle : ShootingResult
{
  int steps_per_period = 0;
  double tolerance = 0; // that the residual met; 0: the accuracy was judged instead
  double theta = 0.5;
  MeasuredPeriod measured{};           // from the orbit's state
  StepCosts costs{};                   // of the last theta step made
  std::vector<OffsetSpread> spreads{}; // over the offsets that joints hold; where the whole tangent is cheap
};

struct ReducedModel;

/// A state that a search starts from.
struct GivenStart
{
  State state;
  double period = 0;    // [s] of the cycle that it nearly is, without free periods; 0: none, and the mode's is taken
  int rounds = 1;       // as many as the period may be of the cycle
  bool resumed = false; // the orbit that a run that is gone on with had reached
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
  const GivenStart* start = nullptr;             // null: there is no amplitude to start from
  std::shared_ptr<const ReducedModel> reduced{}; // gains that of recorded contact
};

/// The problem of another brake, at its equilibrium.
CycleProblem at_equilibrium(const CycleProblem& problem, const SlidingEquilibrium& sliding);

/// The state at which the unstable modes are at their estimated amplitudes; with CycleStartKind::mode the followed one
/// alone at the scene's. Nothing where there is no amplitude.
std::optional<State> state_on_modes(const SlidingEquilibrium& sliding, const UnstableModes& unstable,
                                    const CycleSettings& settings);

/// The amplitude of the followed mode whose fluctuating energy is the state's. [m]
double equivalent_amplitude(const CycleProblem& problem, const State& state);

/// The cycle of the full model from the problem's start.
LimitCycle find_cycle_from_start(CycleProblem& problem, const CycleOptions& options);

/// The cycle of the full model from any start.
LimitCycle find_cycle_from(CycleProblem& problem, const CycleOptions& options, const ShootingStart& start,
                           const ShootingSettings& settings);

// The checkpoint of a search for a cycle: the orbit that it has reached. A restarted search begins there, and finds
// the same cycle to its tolerance.

/// The orbit of the run that is gone on with; nothing where there is none. Collective.
std::optional<GivenStart> kept_cycle(const Structure& structure);

/// Keeps the orbit from this start. Collective.
void keep_cycle(const Structure& structure, Vec start, double period);

/// Wraps the flow, which keeps the last orbit near a cycle that it integrates, when a checkpoint is due.
void keep_cycles_of(Flow& flow, const Structure& structure);

} // namespace squeal
