// ranks: 1
// What starts lead to: means, trends and which motions are the same, on series with known answers.
#include "squeal/attractors/attractors.hpp"
#include "squeal/base/constants.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;

namespace
{

std::vector<double> series(int count, const std::function<double(int)>& value)
{
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(value(i));
  return values;
}

std::vector<double> crossings(double frequency)
{
  return series(200, [frequency](int i) { return (i + 0.5) / frequency; });
}

ReachedMotion motion(ReachedKind kind, double energy, double frequency, std::size_t start)
{
  return {kind, {energy, 1e-3 * energy}, {frequency, 0}, {start}};
}

} // namespace

TEST_CASE("means over a motion's own period do not beat, over the mode's they do")
{
  constexpr double own = 60.7; // samples
  const std::vector<double> energies = series(6400, [](int i) { return 1 + 0.8 * std::cos(2 * two_pi * i / own); });
  const auto spread = [](const std::vector<double>& means)
  { return *std::max_element(means.begin(), means.end()) - *std::min_element(means.begin(), means.end()); };
  const std::vector<double> means = means_over(energies, own);
  CHECK(means.size() == 105);
  CHECK(spread(means) < 5e-3); // of second order in the samples, held between two by the first of them
  CHECK(spread(means_over(energies, 64)) > 0.05);
}

TEST_CASE("a decay towards a constant is unsettled while its trend shows, and steady after")
{
  const auto decay = [](int i) { return 1 + std::exp(-i / 20.); };
  CHECK(reached_by(series(60, decay), crossings(50), 1e-4).kind == ReachedKind::unsettled);
  const ReachedMotion late = reached_by(series(400, decay), crossings(50), 1e-4);
  CHECK(late.kind == ReachedKind::steady);
  CHECK(std::abs(late.energy.value - 1) <= late.energy.error); // the window holds exp(-10) of the decay
  CHECK(late.frequency.value == doctest::Approx(50));
  const ReachedMotion early = reached_by(series(10, decay), crossings(50), 1e-4); // too short for batches
  CHECK(early.kind == ReachedKind::unsettled);
  CHECK(early.energy.value < decay(5));
  CHECK(early.energy.value > decay(9));
  CHECK(early.energy.error == doctest::Approx(decay(5) - decay(9)));
}

TEST_CASE("a swinging approach to a cycle is unsettled, a steady swing is not")
{
  const auto swinging = [](double left)
  { return [left](int i) { return 1 + 0.3 * std::pow(left, i) * std::cos(two_pi * i / 3.7); }; };
  CHECK(reached_by(series(250, swinging(0.99)), crossings(50), 1e-4).kind != ReachedKind::varying);
  const auto late = [](int i) { return i < 125 ? 3 : 1 + std::pow(0.95, i - 125) * std::cos(two_pi * i / 90); };
  CHECK(reached_by(series(250, late), crossings(50), 1e-4).kind == ReachedKind::unsettled);
  const auto steady = [](int i) { return 1 + 0.5 * std::cos(two_pi * i / 53.1); };
  CHECK(reached_by(series(400, steady), crossings(50), 1e-4).kind == ReachedKind::varying);
}

TEST_CASE("a motion that dies out is at rest, one that wanders without a trend is varying")
{
  CHECK(reached_by(series(200, [](int i) { return std::exp(-i / 10.); }), crossings(50), 1e-4).kind ==
        ReachedKind::rest);
  // 8 slow beats in the window, out of step with its ten parts
  const auto beat = [](int i) { return 1 + 0.5 * std::sin(two_pi * i / 25.3); };
  const ReachedMotion wandering = reached_by(series(400, beat), crossings(50), 1e-4);
  CHECK(wandering.kind == ReachedKind::varying);
  CHECK(std::abs(wandering.energy.value - 1) <= wandering.energy.error);
}

TEST_CASE("motions are joined by energy and frequency, the one with most starts first")
{
  std::vector<ReachedMotion> motions;
  motions.push_back(motion(ReachedKind::steady, 1, 100, 0));
  motions.push_back(motion(ReachedKind::steady, 2, 100, 1));
  motions.push_back(motion(ReachedKind::steady, 2.01, 100.05, 2));
  motions.push_back(motion(ReachedKind::steady, 2, 101, 3));
  motions.push_back(motion(ReachedKind::varying, 2, 100, 4));
  const std::vector<ReachedMotion> list = joined(std::move(motions));
  REQUIRE(list.size() == 4);
  CHECK(list.front().starts == std::vector<std::size_t>{1, 2});
}

TEST_CASE("a motion is the cycle whose period its coordinate crosses zero in once or several times")
{
  CHECK(is_cycle(motion(ReachedKind::steady, 2, 100, 0), {2.01, 0}, {100.05, 0}));
  CHECK(is_cycle(motion(ReachedKind::steady, 2, 200, 0), {2.01, 0}, {100.05, 0}));
  CHECK(!is_cycle(motion(ReachedKind::steady, 2, 150, 0), {2, 0}, {100, 0}));
  CHECK(!is_cycle(motion(ReachedKind::steady, 2, 50, 0), {2, 0}, {100, 0}));         // of twice the period
  CHECK(is_cycle(motion(ReachedKind::steady, 2, 100, 0), {2.1, 0.1}, {100.3, 0.3})); // by the cycle's own bars
  CHECK(!is_cycle(motion(ReachedKind::steady, 1, 100, 0), {2, 0}, {100, 0}));
}
