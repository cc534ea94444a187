#pragma once
/// The modified theta-method on the reduced model (src/README.md, section 7.4), in few dense products. The ranks of a
/// map follow one motion together, from rank 0's start, and share what a new step size needs. Functions that take a map
/// that may change are collective among them.
#include "squeal/contact/solver.hpp"
#include "squeal/reduction/reduced_model.hpp"
#include "squeal/transient/theta_step.hpp"

#include <functional>
#include <span>

namespace squeal
{

/// The active pairs at the end of a step, and what the next one starts from.
struct ReducedContact
{
  Eigen::VectorXd r;                       // [N] a contact vector, as all vectors here
  Eigen::VectorXd w{};                     // [m/s] W r + b
  Eigen::VectorXd Wr{};                    // [m/s] empty: to be formed, as G q and G v of the state
  Eigen::VectorXd r_before{}, Wr_before{}; // of the step before; empty: none
  Eigen::VectorXd position{}, velocity{};  // [m, m/s] G q, G v
  std::vector<double> past{};              // [m/s] w_t - s+, as interface.hpp says
  PairFriction friction{};                 // of the step
};

/// The period map of the reduced model by theta steps (src/README.md, section 4), with matrices for each step size:
/// (v, q) -> v_free, r -> v+ - v_free, W r.
struct ReducedMap
{
  const ReducedModel& model;
  int steps = 0;
  double theta = 0.5;
  MPI_Comm comm = MPI_COMM_SELF;    // of the ranks that follow the motion
  double h = 0;                     // [s] of the matrices below
  Eigen::MatrixXd from_state{};     // v_free = from_state (v, q) + from_load
  Eigen::VectorXd from_load{};      // h A^-1 f
  Eigen::MatrixXd from_reactions{}; // h A^-1 H
  Eigen::MatrixXd W{};              // G h A^-1 H
  std::vector<PairBlock> own{};     // the symmetric part of each pair's own block of W
  Eigen::VectorXd reactions{};      // [N] every period's warm start
  ContactSettings contact{};
  long unconverged = 0;
};

/// The gap law of an active pair, rigid ones included.
CompliantGap gap_law(const ReducedMap& map, std::size_t pair);

/// The matrices of the period's step size, unless they are those already. Throws Error where a motion has neither mass
/// nor stiffness.
void prepare(ReducedMap& map, double period);

/// One step. Returns whether contact converged.
bool advance(const ReducedMap& map, ReducedState& state, ReducedContact& contact);

/// Gives all ranks rank 0's state. Collective.
void share_state(ReducedState& state, MPI_Comm comm);

/// N steps of the period; `watch` after each.
ReducedState integrate(ReducedMap& map, double period, ReducedState state,
                       const std::function<void(const ReducedState&)>& watch);

/// The state at the end of a period, and dPhi/dT there.
struct PeriodEnd
{
  ReducedState end, rate;
};

/// The end of a period of this length and its derivative in the length, bit by bit the same on the map's ranks.
PeriodEnd end_of_period(ReducedMap& map, double period, ReducedState state);

// The derivative of the reduced period map (src/README.md, sections 4.13 and 7.5). Functions that take a map are
// collective among its ranks.

/// The contact of each step of a period.
std::vector<StepRecord> record_contacts(ReducedMap& map, double period, ReducedState state);

/// The contacts of the full model's recorded steps, as the reduced model sees them.
std::vector<StepRecord> recorded_contacts(const ReducedModel& model, int directions,
                                          std::span<const StepRecord> records);

/// Columns of changes of the start, (q, v), to those of the period's end: the product of the steps' own tangents on the
/// recorded contact. Each rank does its share of the columns.
Eigen::MatrixXd apply_tangent(ReducedMap& map, double period, std::span<const StepRecord> contacts,
                              const Eigen::MatrixXd& columns);

/// Columns x to (dPhi/dx)'x.
Eigen::MatrixXd apply_adjoint(ReducedMap& map, double period, std::span<const StepRecord> contacts,
                              const Eigen::MatrixXd& columns);

/// The derivative of a period's end (q, v) in the coordinates q and v of the slow shapes.
Eigen::MatrixXd monodromy(ReducedMap& map, double period, std::span<const StepRecord> contacts);

// The contact problem of one reduced step (src/README.md, section 7.4).

/// The reactions after a step whose contact velocities are b without them; `contact` is of the step before. The
/// residual is that of section 4.6. Returns whether it converged.
bool solve_contact(const ReducedMap& map, const Eigen::VectorXd& b, ReducedContact& contact);

} // namespace squeal
