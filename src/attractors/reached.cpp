#include "squeal/attractors/reached.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace squeal
{

namespace
{

bool agree(const MeanValue& a, const MeanValue& b, double relative)
{
  return std::abs(a.value - b.value) <= a.error + b.error + relative * std::max(std::abs(a.value), std::abs(b.value));
}

bool same(const ReachedMotion& a, const ReachedMotion& b)
{
  if (a.kind != b.kind) return false;
  return a.kind == ReachedKind::rest || agree(a, b);
}

} // namespace

MeanValue frequency_of(const std::vector<double>& crossings)
{
  const std::size_t count = crossings.size();
  if (count < 8) return {};
  const auto between = [&](std::size_t first, std::size_t last)
  { return static_cast<double>(last - first) / (crossings[last] - crossings[first]); };
  const std::size_t half = count / 2, quarter = (half + count - 1) / 2;
  return {between(half, count - 1), std::abs(between(half, quarter) - between(quarter, count - 1))};
}

bool agree(const ReachedMotion& a, const ReachedMotion& b)
{
  return agree(a.energy, b.energy, 0.01) && agree(a.frequency, b.frequency, 1e-3);
}

bool is_cycle(const ReachedMotion& motion, const MeanValue& energy, const MeanValue& frequency)
{
  const double times = std::max(1., std::round(motion.frequency.value / frequency.value));
  return agree(motion, {motion.kind, energy, {times * frequency.value, times * frequency.error}, {}});
}

ReachedMotion reached_by(const std::vector<double>& energies, const std::vector<double>& crossings, double rest)
{
  constexpr double within = 0.005; // of the mean
  ReachedMotion reached;
  if (energies.empty()) return reached;
  const auto half = std::span(energies).last((energies.size() + 1) / 2);
  reached.energy = batch_mean(half);
  reached.frequency = frequency_of(crossings);
  if (energies.size() < 20)
  {
    const auto [least, most] = std::ranges::minmax(half);
    reached.energy.error = most - least;
    return reached;
  }
  const MeanValue decay = decay_of_spread(half);
  const double to_a_half = std::log(2.) / static_cast<double>(half.size()); // within the window
  const bool is_steady = reached.energy.error < within * reached.energy.value;
  if (energies.back() < rest)
    reached = {ReachedKind::rest, reached.energy, {}, {}};
  else if (is_stationary(half) && (is_steady || decay.value <= std::max(decay.error, to_a_half)))
    reached.kind = is_steady ? ReachedKind::steady : ReachedKind::varying;
  return reached;
}

std::vector<ReachedMotion> joined(std::vector<ReachedMotion> motions)
{
  std::vector<ReachedMotion> list;
  for (ReachedMotion& motion : motions)
  {
    const auto known =
        std::find_if(list.begin(), list.end(), [&](const ReachedMotion& other) { return same(motion, other); });
    if (known == list.end())
      list.push_back(std::move(motion));
    else
      known->starts.insert(known->starts.end(), motion.starts.begin(), motion.starts.end());
  }
  std::stable_sort(list.begin(), list.end(),
                   [](const ReachedMotion& a, const ReachedMotion& b) { return a.starts.size() > b.starts.size(); });
  return list;
}

} // namespace squeal
