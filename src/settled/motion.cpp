#include "squeal/settled/motion.hpp"

#include "squeal/base/progress.hpp"
#include "squeal/base/statistics.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// The verdict where two exponents are zero: a torus, or a motion that winds down to a cycle.
MotionVerdict judge_torus(std::span<const double> energies, const BaseFrequencies& base, double wanders)
{
  const MeanValue decay = decay_of_spread(energies);
  const double length = static_cast<double>(energies.size());
  if (base.second == 0)
    return {
        MotionKind::undecided, "quasi-periodic and weakly irregular",
        "neither the probe that swings most nor the normal force shows a second frequency: a [[probe]] elsewhere, or "
        "more periods"};
  constexpr double width = 4; // of a line under the Hann window, points of the spectrum
  if (std::abs(base.second - std::round(base.second / base.first) * base.first) * length < width * base.first)
    return {MotionKind::undecided, "quasi-periodic and a cycle", "the lines are not apart: more periods would decide"};
  if (base.explained < 0.8 && !(wanders < 0.1)) // NaN does not tell
    return {MotionKind::undecided, "quasi-periodic and weakly irregular",
            format("%.0f %% of the side bands are at combinations of two frequencies: more periods would decide",
                   100 * base.explained)};
  // Had the modulation decayed to a half, the window would show it.
  const double slowest = std::log(2.) / length;
  if (decay.value - decay.error <= 0 && decay.value + decay.error < slowest)
    return {MotionKind::quasi_periodic, "", ""};
  return {MotionKind::undecided, "quasi-periodic and a slow decay to a cycle",
          format("the modulation decays by %.1e +- %.1e a period: %.0f periods more would decide", decay.value,
                 decay.error, 3 / std::max({decay.value, decay.error, 1e-6}))};
}

/// The verdict where an exponent is above zero, or several are zero and energies have a broad spectrum. A mean's bar
/// comes from batches; a series shorter than some 50 correlation times has no independent ones (Sokal 1997).
MotionVerdict judge_irregular(std::span<const double> energies)
{
  constexpr double enough = 50; // correlation times
  const double needed = enough * correlation_time(energies);
  if (static_cast<double>(energies.size()) >= needed) return {MotionKind::irregular, "", ""};
  return {MotionKind::undecided, "an irregular motion and one that still changes",
          format("its energy wanders slowly, and means may be off by more than their bars: %.2g periods would decide",
                 needed)};
}

/// Whether the energies of periods of so many rounds are one value and do not part from it. The bound is that asked of
/// a cycle's energy by default (accuracy). Two frequencies of a torus are near one of the fractions up to q by chance,
/// which are as many as q^2.
bool steady(std::span<const double> energies, int rounds)
{
  const MeanValue decay = decay_of_spread(energies);
  const double within = 1e-3 / std::pow(std::max(rounds, 1), 2);
  return standard_deviation(energies) < within * mean(energies) && decay.value + decay.error >= 0;
}

/// Whether the two largest exponents are apart by their bars: a wide bar holds zero and much else.
bool parted(const std::vector<MeanValue>& exponents, double together)
{
  if (exponents.size() < 2) return true;
  const MeanValue &first = exponents[0], &second = exponents[1];
  return first.value - together * first.error > second.value + together * second.error;
}

double swing(std::span<const double> series)
{
  const auto [least, greatest] = std::ranges::minmax(series);
  return greatest - least;
}

/// Swings within successive periods of so many samples, a broken number.
std::vector<double> swings_over(std::span<const double> samples, double length)
{
  std::vector<double> swings;
  for (double end = length; end <= static_cast<double>(samples.size()); end += length)
  {
    const auto first = static_cast<std::size_t>(end - length), last = static_cast<std::size_t>(end);
    swings.push_back(swing(samples.subspan(first, last - first)));
  }
  return swings;
}

/// The series of the spectrum: what swings most from a sample on.
const std::vector<double>& follow(const MotionSeries& series, std::size_t first, ExaminedMotion& motion)
{
  const auto largest = std::ranges::max_element(
      series.moving, {}, [&](const std::vector<double>& one) { return swing(std::span(one).subspan(first)); });
  motion.followed = largest == series.moving.end() ? -1 : static_cast<int>(largest - series.moving.begin());
  return motion.followed < 0 ? series.beside : *largest;
}

/// The period of the lines; the window where the steps, or what was seen of them, are too few for it.
double own_period(const BaseFrequencies& base, double window, double step, double seen)
{
  constexpr double fewest_steps = 8, fewest_periods = 16;
  const double period = period_of(base);
  return period >= fewest_steps * step && fewest_periods * period <= seen ? period : window;
}

/// All that is said of the motion so far. What comes before it was stationary is left out by windows first, so that
/// its lines are not of motions that decay.
void examine(const TangentBundle& bundle, double window, const MotionSeries& series, ExaminedMotion& motion)
{
  const std::size_t samples = series.averaged.front().size(), windows = motion.windows, of_window = samples / windows;
  const double step = window / static_cast<double>(of_window);
  const auto left_out = [](std::size_t discarded, std::size_t all) { return discarded < all ? discarded : all / 2; };
  const std::size_t early =
      values_before_stationary(means_over(series.averaged.front(), static_cast<double>(of_window)));
  const std::size_t first_sample = left_out(early, windows) * of_window;
  const auto spectrum = [&](const std::vector<double>& of)
  { return spectrum_of(std::span(of).subspan(first_sample), step); };
  motion.spectrum = spectrum(follow(series, first_sample, motion));
  motion.base = base_frequencies(motion.spectrum);
  motion.period = own_period(motion.base, window, step, static_cast<double>(samples - first_sample) * step);
  if (motion.base.second == 0 && motion.followed >= 0 && !series.beside.empty())
    motion.base = base_frequencies(spectrum(series.beside), motion.base.first);

  const double length = motion.period / step;
  motion.channels.clear();
  for (const auto& one : series.averaged) motion.channels.push_back(means_over(one, length));
  for (const auto& one : series.moving) motion.channels.push_back(swings_over(one, length));
  const std::span<const double> energies = motion.channels.front();
  motion.discarded = values_before_stationary(energies);
  const std::size_t first = left_out(motion.discarded, motion.periods());
  motion.means.clear();
  for (const auto& channel : motion.channels) motion.means.push_back(batch_mean(std::span(channel).subspan(first)));
  const double windows_of_period = motion.period / window;
  const auto first_window = static_cast<std::size_t>(static_cast<double>(first) * windows_of_period);
  if (bundle.growth.empty() || bundle.growth.front().size() == windows) // else they are known
    motion.exponents = exponents_of(bundle, std::max(first_window, windows / 4), windows_of_period);
  motion.verdict = judge_motion(motion.exponents, energies.subspan(first), motion.base);
  const bool cycle = motion.verdict.kind == MotionKind::periodic && motion.base.closes_after == 0;
  if (cycle) motion.base.second = motion.base.explained = 0; // by the exponents: that line is rounding, or dies out
}

} // namespace

/// Whether exponents are above zero. Bars of 95 % each: 1.4 times as wide they hold for four exponents at once.
constexpr double together = 1.4;

bool any_grows(const std::vector<MeanValue>& exponents)
{
  return std::ranges::any_of(exponents, [](const MeanValue& one) { return one.value > together * one.error; });
}

MotionVerdict judge_motion(const std::vector<MeanValue>& exponents, std::span<const double> energies,
                           const BaseFrequencies& base)
{
  const std::string more = "more periods would decide";
  if (!is_stationary(energies))
    return {MotionKind::undecided, "a motion that still changes and one that wanders slowly", more};
  if (exponents.empty()) return {MotionKind::undecided, "all kinds, without Lyapunov exponents", more};
  const auto zero = std::count_if(exponents.begin(), exponents.end(),
                                  [](const MeanValue& one) { return std::abs(one.value) <= together * one.error; });
  if (any_grows(exponents)) return judge_irregular(energies);
  const bool one_frequency = base.second == 0 || base.closes_after > 0;
  // Slow motions that die out have exponents within their bars of zero, too. A torus of hardly coupled parts has as
  // steady energies: the second frequency tells.
  if ((zero == 1 && (base.second == 0 || parted(exponents, together))) ||
      (zero > 0 && steady(energies, base.closes_after) && one_frequency))
    return {MotionKind::periodic, "", ""};
  if (zero == 1) return {MotionKind::undecided, "a cycle and an irregular motion: the exponents' bars overlap", more};
  if (zero == 0) return {MotionKind::undecided, "a cycle and rest: no exponent is zero within its bar", more};
  const double wanders = wandering(energies);
  if (wanders > 0.8) return judge_irregular(energies);
  if (zero == 2) return judge_torus(energies, base, wanders);
  return {MotionKind::undecided, "quasi-periodic with more than two frequencies and weakly irregular",
          format("%ld exponents are zero within their bars: ", static_cast<long>(zero)) + more};
}

ExaminedMotion examine_motion(const Flow& flow, const ObservedMotion& observed, Vec state,
                              const SettledOptions& options)
{
  ExaminedMotion motion;
  TangentBundle bundle = make_bundle(flow, state, options.exponents);
  Progress progress(comm_of(displacement(state)), "settled", static_cast<double>(options.periods));
  const auto most = static_cast<std::size_t>(options.periods);
  std::size_t target = std::min<std::size_t>(128, most);
  bool grows = false; // once an exponent is known to be above zero, means alone are open
  for (;; target = std::min(2 * target, most))
  {
    while (motion.windows < target)
    {
      const double energy = observed.advance(state);
      if (!grows) follow_period(flow, bundle);
      progress.update(static_cast<double>(++motion.windows), format("energy %.4g", energy));
    }
    examine(bundle, observed.window, observed.series(), motion);
    if (motion.verdict.kind != MotionKind::undecided) return motion;
    grows = any_grows(motion.exponents) && motion.discarded < motion.periods();
    if (target < most) continue;
    motion.verdict.would_decide += format(" (-settled_periods %zu)", 4 * most);
    return motion;
  }
}

} // namespace squeal
