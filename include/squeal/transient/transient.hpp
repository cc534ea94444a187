#pragma once
/// Exact-contact transient by the modified theta-method (src/README.md, section 4):
///     A v+ = [M - h(1-theta) C - h^2 theta(1-theta) K] v - h K u + h F + h B'r+,   A = M + h theta C + h^2 theta^2 K,
///     0 <= gap + B_n ut + h B_n v+  _|_  r_n+ >= 0,   ut = u + h(1-theta) v,   r_t+ in the Coulomb disc.
/// Reactions are implicit, an impulse h r+ of the whole step; theta = 1/2 adds no damping of its own.
///
/// Friction opposes s_theta = theta s+ + (1-theta) s, the velocity that its work is done with: a step is then of second
/// order in sliding where friction turns, too, and friction never gives energy. Where that would stop a pair or turn
/// it back it opposes s+ instead, since s_theta = 0 is not rest. (The paper's s+ everywhere is of first order where
/// friction turns.)
#include "squeal/algebra/paired_matrices.hpp"
#include "squeal/contact/condensed.hpp"
#include "squeal/contact/solver.hpp"
#include "squeal/transient/estimate.hpp"
#include "squeal/transient/step_guards.hpp"
#include "squeal/transient/step_options.hpp"
#include "squeal/transient/step_record.hpp"

#include <functional>
#include <span>

namespace squeal
{

/// Everything that depends on h: factored A and W = h B A^-1 B', so that contact solves w = W r + b for r in N.
/// Built once per h.
struct ThetaStep
{
  double h = 0, theta = 0.5;              // [s], [-]
  std::optional<PairedMatrices> matrices; // M and K; not on several ranks
  Factor factor;                          // of A bordered by B
  ContactOperator W;                      // on rank 0
  ContactLaw law = ContactLaw::displacement;
  Opposed opposed = Opposed::theta;
  ContactSettings contact;
  double factor_seconds = 0, condensed_seconds = 0; // to factor A with the corner that W is, to prepare W
};

/// A
Owned<Mat> step_matrix(const Structure& structure, double h, double theta);

/// Error: h not above 0, theta not in (0, 1].
ThetaStep make_theta_step(const Structure& structure, const Interface& interface, double h, double theta,
                          const StepOptions& options);

/// M v_k and K u_k of (v, u) into a pair of spans, each matrix read once.
void multiply_mass_and_stiffness(const ThetaStep& step, const Structure& structure,
                                 const std::array<std::span<const Vec>, 2>& of,
                                 const std::array<std::span<const Vec>, 2>& to);

/// The products of a state that a step starts from and leaves behind for the next one (two multiplications and one
/// solve a step), and its work vectors. Belongs to one state and one ThetaStep.
struct StepWork
{
  Owned<Vec> Mv, Av, Ku;                // of the state at hand
  Owned<Vec> Mv_next, Av_next, Ku_next; // of the one being computed
  Owned<Vec> v_next, v_theta, dv, f;    // f: h B'r
  ContactMemory memory;                 // of the reactions, on rank 0
  double energy = 0;                    // [J]
  StepRecord* record = nullptr;         // of the next step, borrowed; null: none is wanted
};

/// Must be called again after the state was changed by anything but `advance`.
StepWork begin_steps(const ThetaStep& step, const Structure& structure, const Interface& interface, State& state);

/// What one step tells: the terms of the energy identity
///     E+ - E = (1/2 - theta)(dv'M dv + du'K du) - damping_work + contact_work + load_work   (+ defect),
/// and the contact.
struct StepReport
{
  double energy = 0;                 // [J] v'Mv/2 + u'Ku/2 at the end
  double damping_work = 0;           // [J] h v_theta' C v_theta, >= 0
  double contact_work = 0;           // [J] v_theta' B'(impulses)
  double load_work = 0;              // [J] h v_theta' F
  double energy_defect = 0;          // [J] of the energy identity
  int open = 0, stick = 0, slip = 0; // pairs
  int contact_iterations = 0;
  double contact_residual = 0; // natural map, relative
  bool contact_converged = true;
};

/// One step in place of several trajectories: each reading of the factor and of W serves them all.
std::vector<StepReport> advance(const ThetaStep& step, const Structure& structure, const Interface& interface,
                                std::span<StepWork> works, std::span<State> states);

/// Of one.
StepReport advance(const ThetaStep& step, const Structure& structure, const Interface& interface, StepWork& work,
                   State& state);

/// Called after every step.
using Monitor = std::function<void(const State&, const StepReport&, const StepWork&)>;

/// History of a run, one entry a step, at the end of the step; powers are the step's work over h.
struct History
{
  std::vector<double> time;                                     // [s]
  std::vector<double> energy, fluctuating_energy;               // [J]; fluctuating: with u - u0
  std::vector<double> damping_power, contact_power, load_power; // [W]
  std::vector<double> normal_force;                             // [N] sum of r_n
  std::vector<int> open, stick, slip;
  std::vector<std::vector<double>> probes; // [probe][step] [m]
};

/// What `march` counted.
struct MarchSummary
{
  long steps = 0; // fewer than asked when the energy stopped being finite
  long unconverged = 0;
  double first_unconverged = 0; // [s]
  double contact_residual_max = 0;
  double energy_defect_max = 0; // over the energy of its step, or its works where they are larger
  double contact_iterations_mean = 0;
};

/// What is kept of a march: `history` gains energies, powers, counts and the rows of `probes` (null: none) of each
/// step.
struct Recorder
{
  Mat probes = nullptr;
  History& history;
  Monitor monitor; // may be empty
};

/// `steps` steps in place, recorded.
MarchSummary march(const ThetaStep& step, const SlidingEquilibrium& sliding, long steps, State& state,
                   const Recorder& recorder);

/// outcome: "completed", "refused" (step_guards.hpp: theta and h would tell a lie), "not converged" (contact, or an
/// energy that is no longer finite). residual: the largest contact residual; iterations: contact iterations in all.
struct Trajectory
{
  Outcome outcome;
  ContactLaw law = ContactLaw::displacement;
  double theta = 0, step_size = 0, periods = 0;
  long steps = 0;
  double growth_rate_fit = 0;     // [1/s] of the followed mode's amplitude before the first event; NaN: too short
  std::complex<double> predicted; // [1/s] discrete eigenvalue of the followed mode; NaN: none is followed
  double energy_defect_max = 0;   // of the energy, largest over the steps
  double seconds_per_step = 0, contact_iterations_mean = 0;
  double factor_seconds = 0, condensed_seconds = 0; // of its ThetaStep
  State end;
  History history;
};

/// With the steps and the step size that the periods of the mode mean, if they are not given.
TransientSettings planned(TransientSettings settings, const ComplexMode& mode);

/// The state that the scene starts from: a file, the followed mode at an amplitude (0: a tenth of first lift-off), or
/// all unstable modes at their estimates.
State transient_start(const SlidingEquilibrium& sliding, const UnstableModes& unstable,
                      const TransientSettings& settings);

/// Integrates from `start`; `mode` is the followed mode (null: no growth is fitted, and the settings must give steps
/// and step_size).
Trajectory integrate(const SlidingEquilibrium& sliding, const ComplexMode* mode, const TransientSettings& settings,
                     const StepOptions& options, State start, Mat probes);

} // namespace squeal
