#pragma once
/// The way along a load path on the rows of the pairs, increment by increment (src/README.md, section 2.9). It has
/// statuses, locked-in friction, and its end where no equilibrium is beyond. Arithmetic of one rank.
#include "squeal/contact/stick_slip.hpp"

#include <optional>
#include <string>

namespace squeal
{

/// A step of the path, by what acts at its end.
struct PathEnd
{
  std::string name;
  Eigen::VectorXd q;          // [m] motion of the rows by the load alone
  double driven_friction = 1; // [-] on the coefficients of driven pairs
};

/// A path from the state without load.
struct PathProblem
{
  const StickSlipOperator& of;
  double kappa = 0;           // [N/m] of the springs across all rows: N = 1 - kappa D
  std::vector<double> gap;    // [m] per pair
  StickSlipFriction friction; // at the factor 1
  std::vector<PathEnd> ends;
};

/// Where a walk came to.
struct PathWalk
{
  bool completed = false;
  bool impossible = false;      // it is proved that driven pairs have no solution
  std::string reason;           // why not
  StickSlipState state;         // at the end of the last increment
  Eigen::VectorXd offset;       // [m] of the rows in it: gaps, and minus the anchors of friction
  Eigen::VectorXd q;            // [m] by the load, with the offset
  StickSlipFriction friction{}; // in it
  std::size_t step = 0;         // that the walk is in
  double part = 0;              // [-] of it
  int increments = 0, iterations = 0;
  StickSlipState rate{}; // of the state, by the part of the step: slips from nothing; empty: not known
  std::vector<StickSlipState> first_rates{};      // that of each step's first increment
  std::shared_ptr<const StatusFactors> factors{}; // of the last system
  double change = 0;       // [-] of reactions, over the largest of their contact, from half as many increments
  double largest_move = 0; // [m] of a row in one increment, the first of the path aside
};

/// Walks along the path. An increment starts from the state that the last one's rate leads to. Increments grow from the
/// start of a step on, where a new load turns slips. A second walk with twice as many tells their error. A load in
/// proportion from closed gaps takes one: the problem has no scale.
PathWalk walk_path(const PathProblem& problem);

/// The state under the whole load with its pairs stuck where they are. It is one increment from reactions r and slips
/// w that are minus the offsets of undriven pairs.
PathWalk hold_at(const PathProblem& problem, const StickSlipState& from);

/// The state under the whole load of driven pairs alone, whose friction is in M: one increment, from those pairs closed
/// that are expected. Without a solution `q` is the problem's all the same.
PathWalk rest_of(const PathProblem& problem, const std::vector<char>& expected);

/// Whether it is proved that no w >= 0 and r >= 0 of driven pairs fulfil N w = q + M r, by Farkas in at most some
/// hundred exchanges.
bool has_no_solution(const StickSlipOperator& of, const Eigen::VectorXd& q);

/// Whether one solution is sure: N is 1, and the symmetric part of M is positive definite.
bool has_one_solution(const StickSlipOperator& of);

/// The motion of the rows that the load drives and no forces of closed pairs within their friction resist. Where there
/// is one, no equilibrium exists, whatever the path. `q`: by the load alone.
std::optional<Eigen::VectorXd> unresisted_motion(const PathProblem& problem, const StickSlipFriction& friction,
                                                 const Eigen::VectorXd& q);

} // namespace squeal
