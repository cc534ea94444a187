#pragma once
/// How steps are made, of the transient and of the cycle.
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/algebra/sparse_matrices.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/contact/contact_operator.hpp"
#include "squeal/contact/solver.hpp"
#include "squeal/equilibrium/state.hpp"
#include "squeal/modes/modes.hpp"

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace squeal
{

/// Options -transient_... of the step.
struct StepOptions
{
  ContactSettings contact{};
  bool refuse = true;     // what step_guards.hpp refuses
  FactorOptions factor{}; // those of ProgramOptions
};

// Records of steps for their tangents (src/README.md, section 4.13). `advance` fills one where it is given.

class LinearContact;

/// The record of one step; that of a reduced model has the contact of its active pairs alone.
struct StepRecord
{
  // the same on every rank
  std::vector<double> reactions;        // [N] r+
  std::vector<double> contact_velocity; // [m/s] w = W r+ + b
  std::vector<char> opposes_theta;      // chi of each pair: 1 where friction opposes s_theta (section 4.3)

  mutable std::shared_ptr<const LinearContact> linear{}; // kept by rank 0 for the columns to come, where there is room
};

// A step of the modified theta-method with exact contact (src/README.md, sections 4.1 to 4.3):
//     A v+ = [M - h(1-theta) C - h^2 theta(1-theta) K] v - h K u + h F + h B'r+,   A = M + h theta C + h^2 theta^2 K,
//     0 <= gap + B_n ut + h B_n v+  _|_  r_n+ >= 0,   ut = u + h(1-theta) v,   r_t+ in the Coulomb disc.
// Reactions are implicit, an impulse h r+ of the whole step; theta = 1/2 adds no damping of its own.
//
// Friction opposes s_theta = theta s+ + (1-theta) s, the velocity that its work is done with. A step is then of second
// order in sliding where friction turns, too, and friction never gives energy. Where that would stop a pair or turn it
// back it opposes s+ instead, since s_theta = 0 is not rest. (The paper's s+ everywhere is of first order where
// friction turns.) Functions that take a structure are collective.

/// Everything that depends on h: factored A and W = h B A^-1 B', so that contact solves w = W r + b for r in N.
/// Built once per h.
struct ThetaStep
{
  double h = 0, theta = 0.5;              // [s], [-]
  std::optional<PairedMatrices> matrices; // M and K, unless they are dense
  Factor factor;                          // of A bordered by B
  ContactOperator W;                      // on rank 0, or shared by all
  ContactSettings contact;
  double factor_seconds = 0, condensed_seconds = 0; // to factor A with the corner that W is, to prepare W
};

/// A of a step h [s]. [kg] Collective.
Owned<Mat> step_matrix(const Structure& structure, double h, double theta);

/// Error: h not above 0, theta not in (0, 1].
ThetaStep make_theta_step(const Structure& structure, const Interface& interface, double h, double theta,
                          const StepOptions& options);

/// M v_k and K u_k of (v, u) into a pair of spans, each matrix read once.
void multiply_mass_and_stiffness(const ThetaStep& step, const Structure& structure,
                                 const std::array<std::span<const Vec>, 2>& of,
                                 const std::array<std::span<const Vec>, 2>& to);

/// Where undriven pairs began to stick: B_t ut of theirs [m], as a contact vector. A pair that sticks is led back
/// there, so that what solvers leave does not add up to drift.
struct StickAnchors
{
  std::vector<double> at;    // empty: no pair has stuck
  std::vector<char> is_held; // by pairs
};

/// The products of a state that a step starts from and leaves behind for the next one, and its work vectors. A step
/// takes two multiplications and one solve. Belongs to one state and one ThetaStep.
struct StepWork
{
  Owned<Vec> Mv, Av, Ku;                // of the state at hand
  Owned<Vec> Mv_next, Av_next, Ku_next; // of the one being computed
  Owned<Vec> v_next, v_theta, dv, f;    // f: h B'r
  ContactMemory memory;                 // of the reactions, where W is
  double energy = 0;                    // [J]
  StepRecord* record = nullptr;         // of the next step, borrowed; null: none is wanted
  StickAnchors anchors{};
};

/// Factors in one step on the scene's load, drive velocities and friction coefficients.
struct StepFactors
{
  double load = 1;                       // mean over the step, by theta
  double drive_start = 1, drive_end = 1; // at the ends of the step
  double friction_before = 1;            // in the step before, by which its pairs stuck
  double friction = 1;                   // in this step
};

/// The factors of a step that starts at `time` [s] (src/README.md, section 4.15).
StepFactors step_factors(const Ramps& ramps, const ThetaStep& step, double time);

/// Vectors of several motions that one step advances together.
struct SteppedMotions
{
  std::vector<Vec> v;      // of the start
  std::vector<Vec> v_next; // of the end, found by the solve
  std::vector<Vec> Av;     // A v_free on entry, A v+ after the solve
};

/// Solves a step, or its tangent, with - h G v_theta on the right (src/README.md, section 4.17): passes of `solve` with
/// G v_theta of the pass before. Error: they do not converge.
void solve_with_gyroscopic_part(const ThetaStep& step, Mat G, const SteppedMotions& motions,
                                const std::function<void()>& solve);

/// Must be called again after the state was changed by anything but `advance`.
StepWork begin_steps(const ThetaStep& step, const Structure& structure, const Interface& interface, State& state);

/// The report of one step: the terms of the energy identity
///     E+ - E = (1/2 - theta)(dv'M dv + du'K du) - damping_work + contact_work + load_work   (+ defect),
/// and the contact.
struct StepReport
{
  double energy = 0;                 // [J] v'Mv/2 + u'Ku/2 at the end
  double damping_work = 0;           // [J] h v_theta' C v_theta, >= 0
  double contact_work = 0;           // [J] v_theta' B'(impulses)
  double load_work = 0;              // [J] h v_theta' F
  double drive_work = 0;             // [J] h v_d . r_t, what the rotors' drive gives; less contact_work it is heat
  double energy_defect = 0;          // [J] of the energy identity
  int open = 0, stick = 0, slip = 0; // pairs
  int contact_iterations = 0;
  double contact_residual = 0; // natural map, relative
  bool contact_converged = true;
  double fall_of_friction = 0;    // largest |mu'| r_n W_t of a pair, at rest: at 1 the step may have several solutions
  std::vector<double> joint_work; // [J] of the undriven pairs of each contact; empty: there are none
};

/// One step in place.
StepReport advance(const ThetaStep& step, const Structure& structure, const Interface& interface, StepWork& work,
                   State& state, const StepFactors& factors = {});

/// The observers of a march: records to be filled, factors at a time [s], whether it goes on after a step. The last two
/// may be empty.
struct StepWatch
{
  std::span<StepRecord> records{};
  std::function<StepFactors(double time)> factors{};
  std::function<bool(const StepReport&, const StepWork&)> goes_on{};
};

/// The one loop over time of the full model: at most `steps` steps in place. Collective.
StepWork take_steps(const ThetaStep& step, const Structure& structure, const Interface& interface, State& state,
                    long steps, const StepWatch& watch);

// The exact tangent of theta steps along a recorded motion (src/README.md, section 4.13).
//
// Statuses, friction directions and reactions are those of the record, so that a step is a linear map without contact
// iterations. Columns share each reading of the factor, of M, K and of W.
//
// Caveat: the step is piecewise smooth. The tangent does not see a change of the start that changes a status.

/// A change of the state, and its cause besides the change of the start.
struct TangentColumn
{
  Owned<Vec> u, v;     // du [m], dv [m/s]
  double friction = 0; // change of the friction law's coefficient in every step
};

/// From changes at the start of the recorded steps to those at their end, in place. Collective.
void advance_tangents(const ThetaStep& step, const Structure& structure, const Interface& interface,
                      std::span<const StepRecord> records, std::span<TangentColumn> columns);

// Events of contact inside steps (src/README.md, section 4.14).
//
// A motion beside the recorded one meets an event at another time, and leaves it on another flow. The tangent of the
// steps lacks that where an event's own step has statuses that the motion after it has not.

/// An impact of a pair, or a turn of its sliding. c passes zero there: the gap, or the velocity along the direction of
/// sliding.
struct StepEvent
{
  std::size_t pair = 0;
  long first = 0, end = 0; // its first step, and the one after its last
  bool is_impact = false;
  std::vector<double> weights{};   // c of the pair's rows of B u or B v
  double ahead = 0;                // the event's c is c + ahead (c - the one of the step before)
  double rate = 0;                 // of c at the event, a second
  TangentColumn before{}, after{}; // the flow x' at both ends
};

/// The events of a closed orbit in their order, without those that come too close to another one. `states`: before each
/// step, and the last one; from there the orbit goes on at its start. Collective.
std::vector<StepEvent> events_inside_steps(const ThetaStep& step, const Interface& interface,
                                           std::span<const StepRecord> records, std::span<const TangentColumn> states);

/// As the other one, with what events of these records do. Those at the very start or end are left out. Collective.
void advance_tangents(const ThetaStep& step, const Structure& structure, const Interface& interface,
                      std::span<const StepRecord> records, std::span<const StepEvent> events,
                      std::span<TangentColumn> columns);

// Refusals of a theta and a step size h that would show a wrong growth (src/README.md, sections 4.10, 4.11).
// StepOptions::refuse lifts all. A theta < 1/2 also amplifies every stable mode with -Re(lambda) < (1/2 - theta) h
// |lambda|^2, up to the highest one of the mesh. No run is refused for it: the march says so, and ends where its energy
// is no longer finite. Where friction falls steeply with the speed W holds h, so that enough steps lead to one
// solution.

/// ln[(1 + (1-theta) lambda h)/(1 - theta lambda h)]/h [1/s]. lambda in [1/s], h in [s]. Not collective.
std::complex<double> discrete_eigenvalue(std::complex<double> lambda, double theta, double h);

/// Why a run with this theta and h is refused, in a sentence with the remedy; empty if it is not. `mode`: the followed
/// one, or null. Not collective.
std::string step_refusal(const ComplexMode* mode, double theta, double h, const StepOptions& options);

/// The largest eigenvalue of |mu'| diag(r_n) W_tt with the steepest fall of mu; 0 where mu does not fall. A step has
/// one solution while it is below 1. Collective.
double fall_of_friction(const ThetaStep& step, const Interface& interface, const std::vector<double>& reactions);

/// Why a run is refused whose step may have several solutions, with the steps that have one; empty if it is not.
/// Factors A where mu falls. `increase`: largest factor in time on mu r_n. Collective.
std::string friction_refusal(const SlidingEquilibrium& sliding, const ComplexMode* mode, double theta, double h,
                             const StepOptions& options, double increase);

} // namespace squeal
