#include "squeal/equilibrium/path_walk.hpp"

#include "squeal/base/error.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::VectorXd;

constexpr double least_part = 0x1p-20; // of a step: where a limit is known to
constexpr double accurate = 1e-3;      // change of reactions by twice the increments
constexpr int most_parts = 64;         // of a step

/// The place on the path: a step, and a part of it from its start.
struct Place
{
  std::size_t step;
  double part;
};

VectorXd load_at(const PathProblem& problem, const Place& place)
{
  const VectorXd& end = problem.ends[place.step].q;
  if (place.step == 0) return place.part * end;
  return (1 - place.part) * problem.ends[place.step - 1].q + place.part * end;
}

StickSlipFriction friction_at(const PathProblem& problem, const Place& place)
{
  const double end = problem.ends[place.step].driven_friction,
               start = place.step == 0 ? end : problem.ends[place.step - 1].driven_friction;
  StickSlipFriction friction = problem.friction;
  const TangentView<const double> e(friction.e, problem.of.directions);
  for (std::size_t pair = 0; pair < friction.mu.size(); ++pair)
    if (length(e.of(pair)) > 0) friction.mu[pair] *= (1 - place.part) * start + place.part * end;
  return friction;
}

/// The state without load: gaps as they are, no forces, no slip.
PathWalk unloaded(const PathProblem& problem)
{
  PathWalk walk;
  const Index rows = problem.of.N.rows();
  walk.state = {VectorXd::Zero(rows), VectorXd::Zero(rows)};
  walk.offset = VectorXd::Zero(rows);
  const PairView<double> offset(walk.offset, problem.of.directions);
  for (std::size_t pair = 0; pair < problem.gap.size(); ++pair) offset.normal(pair) = problem.gap[pair];
  walk.state.w = walk.offset;
  walk.friction = friction_at(problem, {0, 0});
  return walk;
}

/// Rows from the last increment's state on: slips become anchors.
VectorXd next_offset(const PathWalk& walk, int directions)
{
  VectorXd offset = walk.offset;
  const PairView<double> view(offset, directions);
  const PairView<const double> slip(walk.state.w, directions);
  if (walk.increments == 0) return offset;
  for (std::size_t pair = 0; pair < view.pairs(); ++pair)
    for (std::size_t k = 0; k < view.tangential(pair).size(); ++k) view.tangential(pair)[k] -= slip.tangential(pair)[k];
  return offset;
}

/// Takes the walk to a place in one increment. Returns whether there is a solution; else the walk is as it was.
bool advance_to(const PathProblem& problem, const Place& place, PathWalk& walk)
{
  const StickSlipOperator& of = problem.of;
  const VectorXd offset = next_offset(walk, of.directions), q = load_at(problem, place) + of.N * offset;
  const StickSlipFriction friction = friction_at(problem, place);
  StickSlipState guess = walk.state; // without slip
  const PairView<double> slip(guess.w, of.directions);
  for (std::size_t pair = 0; pair < slip.pairs(); ++pair) std::ranges::fill(slip.tangential(pair), 0.);
  StickSlipSolution found = solve_stick_slip(of, friction, q, guess);
  walk.iterations += found.iterations;
  if (!found.converged) return false;
  if (walk.increments > 0)
  {
    const VectorXd moved = (found.state.w - offset) - (walk.state.w - walk.offset);
    walk.largest_move = std::max(walk.largest_move, moved.lpNorm<Eigen::Infinity>());
  }
  walk.state = std::move(found.state);
  walk.offset = offset;
  walk.q = q;
  walk.friction = friction;
  walk.step = place.step;
  walk.part = place.part;
  ++walk.increments;
  return true;
}

/// The whole path with each step in so many parts, which are halved where there is no solution.
PathWalk walk_in_parts(const PathProblem& problem, int parts)
{
  PathWalk walk = unloaded(problem);
  for (std::size_t step = 0; step < problem.ends.size(); ++step)
  {
    double at = 0, part = 1. / parts;
    while (at < 1)
    {
      const double next = std::min(1., at + part);
      if (advance_to(problem, {step, 1 - next < least_part ? 1. : next}, walk))
      {
        at = walk.part;
        part = std::min(2 * part, 1. / parts);
        continue;
      }
      part /= 2;
      if (part >= least_part) continue;
      walk.step = step;
      walk.part = at;
      return walk;
    }
  }
  walk.completed = true;
  return walk;
}

/// The largest change of a reaction, over the largest of its contact; `least`: that counts as one [N].
double change_between(const StickSlipOperator& of, const VectorXd& a, const VectorXd& b, double least)
{
  const PairView<const double> first(a, of.directions), second(b, of.directions);
  std::vector<double> largest, change;
  for (std::size_t pair = 0; pair < first.pairs(); ++pair)
  {
    const auto contact = static_cast<std::size_t>(of.contact[pair]);
    largest.resize(std::max(largest.size(), contact + 1));
    change.resize(largest.size());
    for (std::size_t k = 0; k < first.of(pair).size(); ++k)
    {
      largest[contact] = std::max(largest[contact], std::abs(second.of(pair)[k]));
      change[contact] = std::max(change[contact], std::abs(second.of(pair)[k] - first.of(pair)[k]));
    }
  }
  double worst = 0;
  for (std::size_t i = 0; i < change.size(); ++i)
    if (change[i] > 0) worst = std::max(worst, change[i] / std::max(largest[i], least));
  return worst;
}

/// One step in proportion, from gaps that are all closed.
bool has_no_scale(const PathProblem& problem)
{
  return problem.ends.size() == 1 && std::ranges::all_of(problem.gap, [](double gap) { return gap == 0; });
}

/// The sentence of a walk that ended early.
std::string end_of(const PathProblem& problem, const PathWalk& walk)
{
  return format("there is no continuation beyond %.7g of step '%s'", walk.part, problem.ends[walk.step].name.c_str());
}

} // namespace

PathWalk hold_at(const PathProblem& problem, const StickSlipState& from)
{
  PathWalk walk = unloaded(problem);
  walk.state.r = from.r;
  walk.state.w.setZero();
  walk.offset += from.w;
  walk.completed = advance_to(problem, {problem.ends.size() - 1, 1}, walk);
  if (!walk.completed) walk.reason = "there is no rest with the undriven pairs where they are";
  return walk;
}

PathWalk walk_path(const PathProblem& problem)
{
  PathWalk walk = walk_in_parts(problem, 1);
  for (int parts = 2; walk.completed && !has_no_scale(problem); parts *= 2)
  {
    PathWalk finer = walk_in_parts(problem, parts);
    constexpr double rounding = 1e-9;
    const double least = rounding * problem.of.motion(finer.q);
    finer.change = change_between(problem.of, walk.state.r, finer.state.r, least / problem.of.compliance);
    const bool shrinks = finer.largest_move <= std::max(0.75 * walk.largest_move, least),
               jumps = finer.largest_move > std::max(0.9 * walk.largest_move, least);
    walk = std::move(finer);
    if (parts > 2 && walk.change <= accurate && shrinks) break;
    if (parts < most_parts) continue;
    if (jumps && walk.completed)
    {
      walk.completed = false;
      walk.reason = "the state jumps on the way, however short the increments: its equilibrium ends, and what follows "
                    "is reached by a motion";
    }
    break;
  }
  if (!walk.completed && walk.reason.empty()) walk.reason = end_of(problem, walk);
  return walk;
}

} // namespace squeal
