#pragma once
/// The verdict on a closed orbit: its multipliers, and what a motion beside it does (src/README.md, section 6.9).
/// Functions that take a problem are collective.
#include "squeal/base/outcome.hpp"
#include "squeal/shooting/multipliers.hpp"

namespace squeal
{

/// Whether motions settle on an orbit, and how that is known.
struct Verdict
{
  FloquetAnalysis floquet{};
  bool doubted = false;   // the tangent says that it repels; a motion beside it neither leaves nor comes nearer
  bool cut_short = false; // the run was asked to end meanwhile

  bool repels() const { return floquet.multipliers.stability == Stability::unstable; }
};

/// Seeks the multipliers of an orbit, and holds them against motions beside it. Where the run is asked to end
/// meanwhile, the verdict is cut short. Error: as of the flow.
Verdict judge(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log, const Orbit& orbit);

/// A state displaced from the orbit by a part of its fluctuation along its fastest motion. `part`: positive towards
/// less energy.
Owned<Vec> state_beside(const OrbitProblem& problem, const Orbit& orbit, Vec fastest, double part);

/// Decides an open verdict. It is "unstable" where a motion was seen to grow beyond its own bar. It is "stable" where
/// one was seen to decay and only one multiplier's bar held 1. A verdict "stable" is undecided where no motion was seen
/// to decay, and "unstable" where none was seen to grow. Where contact only just opens, closes or sticks, no motion
/// stays where the tangent holds. Not collective.
void decide_by_growth(const std::vector<SeenGrowth>& seen, Multipliers& multipliers);

/// An orbit that repels is no answer; with other unstable modes the motion need not be periodic at all. Not collective.
void refuse_repelling(const Verdict& verdict, std::size_t other_unstable, Outcome& outcome);

// Shooting (src/README.md, section 6): the periodic orbit Phi_T(x) = x of any flow, from a start near it.
//
// The order of the stages: free periods, the paper's subspace, the full-space finish. Then the multipliers say whether
// motions settle on the orbit found.

/// Where shooting starts, and what its subspace is made of.
struct ShootingStart
{
  Vec equilibrium = nullptr; // u0 [m]
  Vec u = nullptr, v = nullptr;
  double period = 0;              // [s]
  std::vector<Vec> shapes{};      // the paper's phi_r, phi_i, phi_e, of displacements and velocities alike; or none
  std::size_t other_unstable = 0; // unstable modes that an orbit may leave unexcited
  double first_event = HUGE_VAL;  // energy norm where a nonlinearity begins to limit growth
  bool is_cycle = false;          // that of a cheaper model, or on which a motion has settled
  int rounds = 1;                 // of a cycle: as many as the period may be of it
};

/// The settings of one solve.
struct ShootingSettings
{
  double tolerance = 0; // on the full-space residual
  int free_periods = 0;
  double target_error = 0;     // above 0: of frequency and energy; it ends the iteration as well
  bool goes_on = true;         // where the first attempt finds no orbit that attracts
  const char* title = "cycle"; // of the progress
  Convergence before{};        // of a search that this one goes on with
};

/// outcome: "converged", "collapsed to equilibrium", "not converged", "not periodic" (T left [T0/2, 2 T0], or there are
/// other unstable modes and every orbit found repels), "unstable cycle" (it repels: no motion settles there).
/// residual: |Phi_T(x) - x| / |x - equilibrium| in the energy norm.
struct ShootingResult
{
  Outcome outcome;
  Orbit orbit; // the solution, or the best candidate met
  Orbit free;  // the end of the free motion, evaluated over one more period; null where it is not finite
  Convergence convergence;
  Multipliers multipliers;
  bool cut_short = false;                    // the run was asked to end in the search for multipliers
  StageEnding ending = StageEnding::stalled; // of the attempt that gave the orbit
  RelativeChange remaining{};                // estimate of what all further steps would change in a solution
};

/// The problem of finding an orbit near the start. Borrows flow and preconditioner. Collective.
OrbitProblem problem_of(const Flow& flow, const Preconditioner& preconditioner, const ShootingStart& start,
                        double tolerance);

/// Finds an orbit from the start: free periods, the subspace, a finish in the full space, multipliers. The outcome says
/// how the search ended; where no orbit attracts, `free` is the end of the free motion. Collective. Error: as of the
/// flow.
ShootingResult shoot(const Flow& flow, const Preconditioner& preconditioner, const ShootingStart& start,
                     const ShootingSettings& settings, const ShootingOptions& options);

/// Makes the options of the solver on the subspace (-cycle_snes_...) known to PETSc even where it never runs.
/// Collective.
void declare_solver_options(MPI_Comm comm);

} // namespace squeal
