#pragma once
/// Branches of periodic orbits of a family of flows, by pseudo-arclength (src/README.md, section 9.1):
///     Phi_T(x; p) - x = 0,   <f, dx> = 0,   <t, dz> = 0,   z = (x, T, p).
/// f is the flow's direction, t the direction of the last step. Steps are measured in the scaled unknowns, x over the
/// fluctuation, T over itself, p over its range. The family is all that is known of a model.
///
/// Caveat: a branch is followed from the orbit given, in both directions. Branches that do not meet it are not seen.
#include "squeal/shooting/multipliers.hpp"

#include <string>

namespace squeal
{

/// The measures of a closed orbit besides its multipliers. Counts are over one period.
struct PointMeasures
{
  double mean_energy = 0, mean_fluctuating_energy = 0; // [J]
  std::vector<double> peak_to_peak;                    // [m] per probe
  double open_pairs_mean = 0;
  int open_steps = 0;             // of pairs that open and close
  int lift_offs = 0;              // uninterrupted times that these pairs are open
  int stick_steps = 0;            // of all pairs
  bool slips_nonlinearly = false; // mu depends on the speed
};

/// Flows that depend on a number. The states and the energy product are those of all its values.
struct FlowFamily
{
  Flow flow; // of the value set last; it must have its tangent
  std::function<void(double parameter)> set_parameter;
  /// The state of rest at the value set last; null where there is none.
  std::function<Owned<Vec>()> rest;
  /// column = dPhi_period(start)/dparameter at the value set last.
  std::function<void(double period, Vec start, Vec column)> parameter_column;
  std::function<PointMeasures(const Orbit& orbit)> measure{}; // at the value set last; may be empty
  Preconditioner preconditioner{};
  std::function<void()> renew_preconditioner{}; // makes it that of the period recorded last; empty: there is but one
};

/// A closed orbit of the branch, and the value that it belongs to.
struct BranchPoint
{
  Orbit orbit;
  double parameter = 0;
  int corrections = 0; // that it took
  Multipliers multipliers{};
  PointMeasures measures{};
};

/// The events along a branch.
enum class BranchEventKind
{
  hopf,            // the sliding equilibrium gains or loses an unstable mode
  first_lift_off,  // below it no pair opens
  fold,            // the parameter turns round
  period_doubling, // a multiplier passes -1
  neimark_sacker,  // a complex pair passes the unit circle
  grazing,         // a pair opens once more, or once less, a period
  first_stick,     // beyond it pairs stick
};

template <> inline constexpr std::array words_of<BranchEventKind> = {
    "Hopf", "first lift-off", "fold", "period doubling", "Neimark-Sacker", "grazing", "first stick"};

/// An event and where it is.
struct BranchEvent
{
  BranchEventKind kind = BranchEventKind::fold;
  double parameter = 0;
  double error = 0;  // of the parameter: half of the interval that holds it, or the change of the last estimate
  double period = 0; // [s]
  double mean_fluctuating_energy = 0; // [J] of the orbit there; 0 at a Hopf point
  int change = 0;                     // of the number of unstable modes, multipliers, openings or sticking steps
};

/// Why a side of a branch ended.
enum class BranchEnding
{
  not_followed,  // the start is at this bound
  bound,         // the parameter reached its bound
  linear_motion, // no pair opens or sticks any more, and mu is constant: the family is vertical from there to its Hopf
                 // point
  small_amplitude,  // the orbit shrank to a point: Hopf
  step_too_small,   // no orbit closes within the smallest step
  number_of_points, // as many points as are allowed
};

template <> inline constexpr std::array words_of<BranchEnding> = {
    "not followed", "bound", "linear motion", "small amplitude", "step too small", "number of points"};

/// The ends of a branch towards smaller and larger values, as it leaves the start.
struct BranchSides
{
  BranchEnding backward = BranchEnding::not_followed, forward = BranchEnding::not_followed;
};

/// Points and events of a branch, and how its sides ended.
struct Branch
{
  std::vector<BranchPoint> points; // along the branch
  std::vector<BranchEvent> events; // along the branch
  BranchSides ends;
  long periods = 0, columns = 0; // integrated; of the tangent, those of the multipliers included
};

/// How far, how finely and how accurately a branch is followed.
struct ContinuationSettings
{
  double least = 0, greatest = 0; // of the parameter
  int points = 30;                // that would span the range if the parameter alone changed
  double tolerance = 0;           // on the full-space residual
  int steps = 0;                  // of the flow's grid of time a period; 0: it has none
};

/// The branch through the orbit of the value `parameter` that closes near this one; without points where none does.
/// Collective. Error: as of the family.
Branch trace_branch(const FlowFamily& family, const ContinuationSettings& settings, const ShootingOptions& options,
                    const Orbit& start, double parameter);

} // namespace squeal
