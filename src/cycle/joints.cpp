#include "squeal/cycle/joints.hpp"
#include "squeal/contact/contact_operator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace squeal
{

namespace
{

/// A pair on its way: where it is, how fast, and what it has slipped.
struct PairOnWay
{
  std::array<double, 2> at{}, speed{}; // B_t u [m], B_t v [m/s]
  std::array<double, 2> least{}, greatest{}, sum{}, net{};
  double path = 0; // [m] of its slip
  bool closed = true;
};

/// Moves a pair on by a step: with w_t = s+ + past and u+ = u + h (theta v+ + (1 - theta) v).
void move_on(PairOnWay& pair, const ThetaStep& step, std::span<const double> drive, std::span<const double> w,
             bool opposes_theta)
{
  const double h = step.h, theta = step.theta, past = opposes_theta ? (1 - theta) / theta : 0;
  double way = 0;
  for (std::size_t k = 0; k < w.size(); ++k)
  {
    const double next = w[k] - past * (pair.speed[k] - drive[k]) + drive[k],
                 moved = h * (theta * next + (1 - theta) * pair.speed[k]);
    pair.speed[k] = next;
    pair.at[k] += moved;
    pair.sum[k] += pair.at[k];
    pair.net[k] += moved;
    way += moved * moved;
    pair.least[k] = std::min(pair.least[k], pair.at[k]);
    pair.greatest[k] = std::max(pair.greatest[k], pair.at[k]);
  }
  pair.path += std::sqrt(way);
}

/// The slip of an undriven pair that slips one way alone, else 0.
double one_way(const PairOnWay& pair)
{
  constexpr double most = 0.5; // of its path
  const double net = length(pair.net[0], pair.net[1]);
  return pair.closed && net > most * pair.path ? net : 0;
}

} // namespace

std::vector<char> held_pairs(const Interface& interface, std::span<const StepRecord> records)
{
  std::vector<char> held(interface.gap.size(), 0);
  for (std::size_t i = 0; i < held.size(); ++i) held[i] = is_undriven(interface, i);
  for (const StepRecord& record : records)
  {
    const std::vector<ContactStatus> status = contact_status(interface, record.reactions, record.contact_velocity);
    for (std::size_t i = 0; i < held.size(); ++i) held[i] = held[i] && status[i] == ContactStatus::stick;
  }
  return held;
}

JointMotion joint_motion(const Interface& interface, const ThetaStep& step, std::span<const StepRecord> records,
                         const std::vector<double>& Bu, const std::vector<double>& Bv)
{
  const int directions = interface.directions;
  const auto count = static_cast<std::size_t>(interface.pairs);
  const TangentView drive(interface.drive, directions);
  std::vector<PairOnWay> pairs(count);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t k = 0; k < drive.of(i).size(); ++k)
    {
      pairs[i].at[k] = pairs[i].least[k] = pairs[i].greatest[k] = PairView(Bu, directions).tangential(i)[k];
      pairs[i].speed[k] = PairView(Bv, directions).tangential(i)[k];
    }
  for (const StepRecord& record : records)
  {
    const PairView w(record.contact_velocity, directions);
    const std::vector<ContactStatus> status = contact_status(interface, record.reactions, record.contact_velocity);
    for (std::size_t i = 0; i < count; ++i)
    {
      move_on(pairs[i], step, drive.of(i), w.tangential(i), record.opposes_theta[i] != 0);
      pairs[i].closed = pairs[i].closed && status[i] != ContactStatus::open;
    }
  }
  JointMotion motion{held_pairs(interface, records), std::vector<double>(interface.size(), 0.)};
  for (std::size_t i = 0; i < count; ++i)
  {
    const PairOnWay& pair = pairs[i];
    const std::span<double> offset = PairView<double>(motion.offsets, directions).tangential(i);
    for (std::size_t k = 0; k < offset.size(); ++k)
    {
      offset[k] = pair.sum[k] / static_cast<double>(records.size());
      motion.slip.swing = std::max(motion.slip.swing, pair.greatest[k] - pair.least[k]);
    }
    if (motion.held[i])
      motion.slip.held += directions;
    else if (is_undriven(interface, i))
      motion.slip.slip = std::max(motion.slip.slip, one_way(pair));
  }
  return motion;
}

void take_out_tangents(const Interface& interface, const std::vector<char>& pairs, Vec x)
{
  std::vector<char> taken(interface.size(), 0);
  const PairView<char> rows(taken, interface.directions);
  for (std::size_t i = 0; i < pairs.size(); ++i) std::ranges::fill(rows.tangential(i), pairs[i]);
  std::vector<double> forces = forces_on_rows(interface, taken, x);
  for (double& force : forces) force = -force;
  add_reactions(interface, forces, x);
}

JointUse joint_use(const Interface& interface, std::span<const StepRecord> records)
{
  constexpr double edge = 1 - 1e-3;
  JointUse use;
  std::vector<double> largest; // of each undriven pair
  for (const StepRecord& record : records)
  {
    const PairView r(record.reactions, interface.directions);
    const std::vector<ContactStatus> statuses = contact_status(interface, record.reactions, record.contact_velocity);
    std::size_t joint = 0, row = 0;
    for (std::size_t i = 0; i < statuses.size(); ++i)
    {
      if (!is_undriven(interface, i)) continue;
      const double limit = friction_coefficient(interface.friction.of(i), 0).value * r.normal(i);
      largest.resize(std::max(largest.size(), joint + 1));
      use.slipped.resize(largest.size());
      use.least.resize(std::max(use.least.size(), row + r.tangential(i).size()), HUGE_VAL);
      use.greatest.resize(use.least.size(), -HUGE_VAL);
      for (const double friction : r.tangential(i))
      {
        const double part = limit > 0 ? friction / limit : 0;
        use.least[row] = std::min(use.least[row], part);
        use.greatest[row] = std::max(use.greatest[row], part);
        ++row;
      }
      if (limit > 0) largest[joint] = std::max(largest[joint], length(r.tangential(i)) / limit);
      use.slipped[joint] = use.slipped[joint] || statuses[i] != ContactStatus::stick;
      ++joint;
    }
  }
  for (std::size_t joint = 0; joint < largest.size(); ++joint)
  {
    ++(use.slipped[joint] ? use.slipping : use.held);
    use.at_edge += !use.slipped[joint] && largest[joint] >= edge;
    use.largest = std::max(use.largest, largest[joint]);
  }
  return use;
}

void OwnRest::follow(const SlidingEquilibrium& path, const FactorOptions& factor, const JointMotion& motion)
{
  constexpr double near = 1e-4; // of the swing
  double moved = offsets_.empty() ? HUGE_VAL : 0;
  for (std::size_t i = 0; i < offsets_.size(); ++i)
    if (is_undriven(path.interface, PairRows<std::size_t>(path.interface.directions).pair_of(i)))
      moved = std::max(moved, std::abs(motion.offsets[i] - offsets_[i]));
  if (!(moved > near * motion.slip.swing)) return;
  Equilibrium rest = at(path, factor, motion.offsets);
  offsets_ = motion.offsets;
  if (rest.outcome.kind == OutcomeKind::converged) rest_ = std::move(rest);
}

Equilibrium OwnRest::at(const SlidingEquilibrium& path, const FactorOptions& factor, const std::vector<double>& offsets)
{
  if (!rests_) rests_ = std::make_unique<Equilibria>(EquilibriumOptions{factor});
  return rests_->at_offsets(path, offsets);
}

SlidingEquilibrium OwnRest::about(const SlidingEquilibrium& path) const
{
  return {path.structure, path.interface, rest_ ? *rest_ : path.equilibrium};
}

} // namespace squeal
