#include "squeal/equilibrium/path_walk.hpp"

#include "load_path.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ranges>
#include <utility>

namespace squeal
{

namespace
{

constexpr double least_part = 0x1p-20; // of a step: where a limit is known to
constexpr int first_parts = 8;         // of a stretch: coarser ones lose the statuses

/// A step is walked in stretches, the first to this part of it; each ends at four times the last one's end.
constexpr double first_stretch = 0x1p-6;

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

/// The way that an increment ended: `far` with a row that moves further than it may.
enum class Advance
{
  done,
  far,
  no_solution,
};

/// Takes the walk to a place by one increment of so much of the step, in which no row moves by more than `most` [m].
/// The walk is as it was unless this is done.
Advance advance_to(const PathProblem& problem, const Place& place, double size, double most, PathWalk& walk)
{
  const StickSlipOperator& of = problem.of;
  const VectorXd offset = next_offset(walk, of.directions), q = load_at(problem, place) + of.N * offset;
  const StickSlipFriction friction = friction_at(problem, place);
  StickSlipState start = walk.state; // without slip
  const PairView<double> slip(start.w, of.directions);
  for (std::size_t pair = 0; pair < slip.pairs(); ++pair) std::ranges::fill(slip.tangential(pair), 0.);
  StickSlipState guess = start;
  if (walk.rate.r.size() > 0) guess = {start.r + size * walk.rate.r, start.w + size * walk.rate.w};
  constexpr double rounding = 1e-9; // of reactions: where the rate leads to none, it tells no statuses
  if (guess.r.lpNorm<Eigen::Infinity>() <= rounding * start.r.lpNorm<Eigen::Infinity>()) guess = start;
  StickSlipSolution found = solve_stick_slip(of, friction, q, guess, walk.factors);
  walk.iterations += found.iterations;
  if (!found.converged) return Advance::no_solution;
  if (walk.increments > 0)
  {
    const VectorXd moved = (found.state.w - offset) - (walk.state.w - walk.offset);
    const double move = moved.lpNorm<Eigen::Infinity>();
    if (move > most) return Advance::far;
    walk.largest_move = std::max(walk.largest_move, move);
  }
  walk.rate = {(found.state.r - start.r) / size, (found.state.w - start.w) / size};
  walk.state = std::move(found.state);
  walk.offset = offset;
  walk.q = q;
  walk.friction = friction;
  walk.step = place.step;
  walk.part = place.part;
  ++walk.increments;
  return Advance::done;
}

/// A motion of the rows that counts as one beside this load [m].
double least_move(const VectorXd& q)
{
  constexpr double rounding = 1e-9;
  return rounding * q.lpNorm<Eigen::Infinity>();
}

/// The sentence of a walk that ends at a part of a step.
std::string end_of(const PathProblem& problem, const PathWalk& walk, Advance last)
{
  const char* text = last == Advance::far
                         ? "the state jumps at %.7g of step '%s', however short the increments: its equilibrium ends, "
                           "and what follows is reached by a motion"
                         : "there is no continuation beyond %.7g of step '%s'";
  return format(text, walk.part, problem.ends[walk.step].name.c_str());
}

/// Walks the whole path with each stretch in so many parts. A part is halved where it has no solution. It is halved,
/// too, where rows move as far as in the walk `before`: a shorter increment must move them less.
PathWalk walk_in_parts(const PathProblem& problem, int parts, const PathWalk& before)
{
  const double most = before.completed ? std::max(0.75 * before.largest_move, least_move(before.q))
                                       : std::numeric_limits<double>::infinity();
  PathWalk walk = unloaded(problem);
  walk.factors = before.factors;
  for (std::size_t step = 0; step < problem.ends.size(); ++step)
  {
    walk.rate = step < before.first_rates.size() ? before.first_rates[step] : StickSlipState{};
    double at = 0, begin = 0, share = 1;
    for (double end = first_stretch; at < 1;)
    {
      const double part = share * (end - begin) / parts, next = end - at - part < least_part ? end : at + part;
      const Advance last = advance_to(problem, {step, next}, next - at, most, walk);
      if (last == Advance::done)
      {
        if (at == 0) walk.first_rates.push_back(walk.rate);
        at = next;
        share = std::min(2 * share, 1.);
        if (at == end) begin = std::exchange(end, 4 * end);
        continue;
      }
      share /= 2;
      walk.rate = {};
      if (part / 2 >= least_part) continue;
      walk.step = step;
      walk.part = at;
      walk.reason = end_of(problem, walk, last);
      return walk;
    }
  }
  walk.completed = true;
  return walk;
}

/// The largest change of a reaction, over the largest of its contact; `least`: that counts as one [N].
double change_between(const StickSlipOperator& of, const VectorXd& a, const VectorXd& b, double least)
{
  const auto largest_in = [&](const VectorXd& r)
  {
    const auto size = [&](std::size_t pair)
    {
      const auto reaction = PairView<const double>(r, of.directions).of(pair);
      return std::ranges::max(reaction | std::views::transform([](double x) { return std::abs(x); }));
    };
    return largest_of_contacts(of.contact, of.contact.size(), size);
  };
  const std::vector<double> largest = largest_in(b), change = largest_in(b - a);
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

} // namespace

PathWalk hold_at(const PathProblem& problem, const StickSlipState& from)
{
  PathWalk walk = unloaded(problem);
  walk.state.r = from.r;
  walk.state.w.setZero();
  walk.offset += from.w;
  walk.completed = advance_to(problem, {problem.ends.size() - 1, 1}, 1, std::numeric_limits<double>::infinity(),
                              walk) == Advance::done;
  if (!walk.completed) walk.reason = "there is no rest with the undriven pairs where they are";
  return walk;
}

PathWalk rest_of(const PathProblem& problem, const std::vector<char>& expected)
{
  PathWalk walk = unloaded(problem);
  walk.q = load_at(problem, {0, 1}) + problem.of.N * walk.offset;
  walk.state.w.setZero(); // all closed
  for (Index i = 0; expected.size() == problem.gap.size() && i < walk.q.size(); ++i)
    if (!expected[static_cast<std::size_t>(i)]) walk.state.w[i] = walk.q.lpNorm<Eigen::Infinity>();
  const auto rests = [&] {
    return advance_to(problem, {0, 1}, 1, std::numeric_limits<double>::infinity(), walk) == Advance::done;
  };
  const auto rests_from = [&](const std::optional<StickSlipState>& start)
  {
    if (start) walk.state = *start;
    return start && rests();
  };
  walk.completed = rests() || rests_from(rest_by_path(problem.of, walk.q));
  if (walk.completed) return walk;
  const auto found = rest_of_few(problem.of, walk.q);
  walk.completed = rests_from(found);
  walk.impossible =
      !found && (all_sets_are_cheap(static_cast<double>(walk.q.size())) || has_no_solution(problem.of, walk.q));
  return walk;
}

PathWalk walk_path(const PathProblem& problem)
{
  if (has_no_scale(problem))
  {
    PathWalk walk = unloaded(problem);
    walk.completed = advance_to(problem, {0, 1}, 1, std::numeric_limits<double>::infinity(), walk) == Advance::done;
    if (walk.completed) return walk;
  }
  PathWalk walk = walk_in_parts(problem, first_parts, {});
  if (!walk.completed) return walk;
  PathWalk finer = walk_in_parts(problem, 2 * first_parts, walk);
  finer.iterations += walk.iterations;
  if (finer.completed)
    finer.change = change_between(problem.of, walk.state.r, finer.state.r, least_move(finer.q) / problem.of.compliance);
  return finer;
}

} // namespace squeal
