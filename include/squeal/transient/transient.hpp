#pragma once
/// The transient: theta steps from a start state, and what is recorded of them (src/README.md, sections 4.9, 4.12).
#include "squeal/base/checkpoint.hpp"
#include "squeal/modes/modes.hpp"
#include "squeal/transient/estimate.hpp"
#include "squeal/transient/theta_step.hpp"

#include <functional>

namespace squeal
{

/// Called after every step.
using Monitor = std::function<void(const State&, const StepReport&, const StepWork&)>;

/// History of a run, one entry a step, at the end of the step; powers are the step's work over h.
struct History
{
  std::vector<double> time;                                     // [s]
  std::vector<double> energy, fluctuating_energy;               // [J]; fluctuating: with u - u0
  std::vector<double> damping_power, contact_power, load_power; // [W]
  std::vector<double> drive_power;                              // [W] v_d . r_t; less contact_power it is heat
  std::vector<double> normal_force;                             // [N] sum of r_n
  std::vector<int> open, stick, slip;
  std::vector<std::vector<double>> probes; // [probe][step] [m]
  std::vector<double> joint_work;          // [J] of the undriven pairs of each contact, over all steps
};

/// Calls visit(name, unit, series of each history...) for each series but those of the probes.
template <class Visit, class... Histories> void for_each_series(const Visit& visit, Histories&... histories)
{
  visit("time", "s", histories.time...);
  visit("energy", "J", histories.energy...);
  visit("fluctuating_energy", "J", histories.fluctuating_energy...);
  visit("damping_power", "W", histories.damping_power...);
  visit("contact_power", "W", histories.contact_power...);
  visit("load_power", "W", histories.load_power...);
  visit("drive_power", "W", histories.drive_power...);
  visit("normal_force", "N", histories.normal_force...);
  visit("open", "pairs", histories.open...);
  visit("stick", "pairs", histories.stick...);
  visit("slip", "pairs", histories.slip...);
}

/// The counts of a march.
struct MarchSummary
{
  long steps = 0; // fewer than asked when the energy stopped being finite, or the run is asked to end
  bool interrupted = false;
  long unconverged = 0;
  double first_unconverged = 0; // [s]
  double contact_residual_max = 0;
  double fall_of_friction_max = 0; // as of StepReport
  double energy_defect_max = 0;    // over the energy of its step, or its works where they are larger
  double contact_iterations_mean = 0;
};

/// The record of a march: `history` gains energies, powers, counts and the rows of `probes` (null: none) of each step.
struct Recorder
{
  Mat probes = nullptr;
  History& history;
  Monitor monitor;                 // may be empty
  std::span<StepRecord> records{}; // of each step, for its tangent; may be empty
  Description checkpoint{};        // of what a checkpoint holds beside the march; empty: none is kept
  const Ramps* ramps = nullptr;    // null: load, drive and friction are the scene's own
};

/// Takes `steps` steps from `state`, which becomes the end, and records them. Collective.
MarchSummary march(const ThetaStep& step, const SlidingEquilibrium& sliding, long steps, State& state,
                   const Recorder& recorder);

/// outcome: "completed", "interrupted", "refused" (step_guards.hpp: theta and h would show a wrong growth), "not
/// converged" (contact, or an energy that is no longer finite). residual: the largest contact residual; iterations:
/// contact iterations in all.
struct Trajectory : MarchSummary
{
  Outcome outcome;
  double theta = 0;               // [-]
  double step_size = 0;           // [s]
  double periods = 0;             // [-] of the followed mode
  double growth_rate_fit = 0;     // [1/s] of the followed mode's amplitude before the first event; NaN: too short
  std::complex<double> predicted; // [1/s] discrete eigenvalue of the followed mode; NaN: none is followed
  double seconds_per_step = 0;
  double factor_seconds = 0, condensed_seconds = 0; // of its ThetaStep
  State end;
  History history;
};

/// With the steps and the step size that the periods of the mode mean, if they are not given. Not collective.
TransientSettings planned(TransientSettings settings, const ComplexMode& mode);

/// The state that the scene starts from: a file, the followed mode at an amplitude, or all unstable modes at their
/// estimates. An amplitude of 0 means a tenth of first lift-off. Collective. Error: as of read_state.
State transient_start(const SlidingEquilibrium& sliding, const UnstableModes& unstable,
                      const TransientSettings& settings);

/// Integrates from `start`; `mode` is the followed mode (null: no growth is fitted, and the settings must give steps
/// and step_size). Collective. A step that would show a wrong growth has the outcome "refused".
Trajectory integrate(const SlidingEquilibrium& sliding, const ComplexMode* mode, const TransientSettings& settings,
                     const StepOptions& options, State start, Mat probes);

// Growth of one mode during a transient (src/README.md, section 4.12).
//
// In persistent sliding the step is linear and leaves the mode's plane invariant: (u - u0, v) = Re(q (phi, lambda
// phi)). There q grows by exp(lambda_h h) a step, lambda_h the discrete eigenvalue. |q| is found by projection in the
// energy inner product. Unlike the energy it has no ripple at 2 omega, so its logarithm is a straight line in time.
// Functions that take matrices or vectors are collective.

/// The modulus of q in time, and what its projection needs.
struct ModeAmplitude
{
  const ComplexMode* mode = nullptr;
  Owned<Vec> v_real, v_imaginary;        // lambda phi
  double K_real = 0, K_imaginary = 0;    // phi' K u0
  double rr = 0, ri = 0, ii = 0;         // Gram matrix of Re and Im of (phi, lambda phi) in the energy inner product
  std::vector<double> time, log_modulus; // [s], of q
};

/// Begins to observe a mode, which it borrows.
ModeAmplitude follow(const Structure& structure, const Equilibrium& equilibrium, const ComplexMode& mode);

/// Notes |q| of a state given by its products K u and M v.
void observe(ModeAmplitude& amplitude, double time, Vec Ku, Vec Mv);

/// Least-squares slope of ln|q| over the whole periods observed [1/s]; NaN when there is not one.
double growth_rate(const ModeAmplitude& amplitude, double period);

} // namespace squeal
