#pragma once
/// The periodic-orbit problem (src/README.md, section 6.1): find a state x and a period T with
///     F(x, T) = Phi_T(x) - x = 0,   <f, dx> = 0,
/// where f is the flow's direction. A correction dx along the orbit would only move the time origin.
///
/// "Orbit" is a candidate of the solver, whether it closes or not. Functions on orbits are collective.
#include "squeal/base/progress.hpp"
#include "squeal/base/words.hpp"
#include "squeal/shooting/flow.hpp"

#include <array>
#include <limits>
#include <optional>
#include <vector>

namespace squeal
{

/// A candidate and what one evaluation of the flow says about it.
struct Orbit
{
  Owned<Vec> state;
  double period = 0;      // [s]
  Owned<Vec> defect;      // Phi_T(x) - x
  Owned<Vec> rate;        // dPhi_T/dT
  double fluctuation = 0; // |x - rest| in the energy norm
  double residual = 0;    // |defect| / fluctuation
  Owned<Vec> rest{};      // at its own offsets; null: the problem's equilibrium
  OffsetMotion offsets{};
};

/// A deep copy.
Orbit copy_of(const Orbit& orbit);

/// Relative changes of an orbit.
struct RelativeChange
{
  double frequency = 0, energy = 0;
};

/// The problem of a closed orbit. A stage borrows it and never changes it.
struct OrbitProblem
{
  const Flow& flow;
  const Preconditioner& preconditioner;
  Owned<Vec> equilibrium{};     // the state of rest (u0, 0)
  double first_period = 0;      // [s] T may differ from it by a factor of two
  double tolerance = 0;         // on the residual
  double least_fluctuation = 0; // an orbit with less is falling onto the equilibrium
  double target_error = 0;      // above 0: converged as soon as all further steps would change no more
};

/// The stages of the solver, as the records of convergence name them.
enum class ShootingStage
{
  free_periods, // integration without correction
  subspace,     // Newton on the coordinates of a few given shapes
  multisecant,
};

template <> inline constexpr std::array words_of<ShootingStage> = {"free", "reduced", "multisecant"};

/// One line of the history of convergence.
struct NewtonRecord
{
  ShootingStage stage = ShootingStage::free_periods;
  PetscInt unknowns = 0;
  long periods = 0;  // integrated so far
  double period = 0; // [s]
  double residual_projected = 0, residual_full = 0;
};

/// The steps and periods that the solver has done.
struct Convergence
{
  std::vector<NewtonRecord> records;
  int iterations = 0; // Newton and secant steps
  long periods = 0;   // integrated: every evaluation of the flow, columns of the subspace's Newton included
  double residual_projected = std::numeric_limits<double>::quiet_NaN(); // where the subspace was left; NaN: not tried
};

/// The convergence so far, and where each new record is shown.
struct ConvergenceLog
{
  Progress& progress;
  Convergence convergence{};
  std::optional<double> done{}; // of the progress's total, where the number of periods does not tell
  std::vector<double> slips{};  // [m] one way in each free period
};

/// Why a stage stopped.
enum class StageEnding
{
  converged,
  stalled,
  collapsed,         // onto the equilibrium
  period_left_range, // of a factor of two about the first one
  slips,             // an offset one way, as long as it was followed
};

/// The best orbit that a stage met, and why it stopped.
struct StageResult
{
  Orbit orbit;
  StageEnding ending = StageEnding::stalled;
  RelativeChange remaining{}; // where a target error ended it: estimate of what all further steps would change
};

/// One evaluation of the flow. Error: as of the flow.
Orbit evaluate(const OrbitProblem& problem, ConvergenceLog& log, Vec state, double period);

/// Adds a record. `unknowns`: of the stage's system; 0 where nothing is solved for. The projected residual is NaN in
/// the full space.
void record(ConvergenceLog& log, ShootingStage stage, const Orbit& orbit, PetscInt unknowns,
            double residual_projected = std::numeric_limits<double>::quiet_NaN());

/// Whether T is within a factor of two of the first period.
bool admissible_period(const OrbitProblem& problem, double period);

/// Whether the orbit is falling onto the equilibrium.
bool collapsing(const OrbitProblem& problem, const Orbit& orbit);

/// Whether an offset moves one way in a period by more than the tolerance, and 1e-6, of the swing; without a tolerance
/// by more than 1e-5. A correction would end it where no motion does.
bool slips_one_way(const OrbitProblem& problem, const Orbit& orbit);

/// x - rest
Owned<Vec> fluctuation_of(const OrbitProblem& problem, const Orbit& orbit);

// Integration without correction (src/README.md, section 6.3): the flow itself brings the motion nearer to an orbit
// that attracts.

/// The residual without its part along the flow: how far the motion misses its start at the nearest recurrence.
double return_residual(const OrbitProblem& problem, const Orbit& orbit);

/// When free integration ends.
struct FreeIntegration
{
  int periods = 0;          // at most
  double near_periodic = 0; // return residual at which it ends before; 0: never
  int at_most = 0;          // periods where an offset still slips one way
  double refactored = 0.02; // least correction over the period that is worth a factor at once; shooting's are smaller
  double outgrown = std::numeric_limits<double>::infinity(); // fluctuation above which it ends before
};

/// Free periods from the state, then the evaluation of the end with the period of the best recurrence.
Orbit integrate_free_periods(const OrbitProblem& problem, ConvergenceLog& log, Vec state, double period,
                             const FreeIntegration& asked);

} // namespace squeal
