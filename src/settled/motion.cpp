#include "squeal/settled/motion.hpp"

#include "squeal/base/progress.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// Of two exponents that are zero: a torus, or a motion that winds down to a cycle.
MotionVerdict judge_torus(std::span<const double> energies, const BaseFrequencies& base)
{
  const MeanValue decay = decay_of_spread(energies);
  const double length = static_cast<double>(energies.size());
  if (base.second == 0)
    return {
        MotionKind::undecided, "quasi-periodic and weakly irregular",
        "neither the probe that swings most nor the normal force shows a second frequency: a [[probe]] elsewhere, or "
        "more periods (-settled_periods)"};
  if (base.explained < 0.8)
    return {MotionKind::undecided, "quasi-periodic and weakly irregular",
            format("%.0f %% of the side bands are at combinations of two frequencies: more periods would decide "
                   "(-settled_periods)",
                   100 * base.explained)};
  // Had the modulation decayed to a half, the window would show it.
  const double slowest = std::log(2.) / length;
  if (decay.value - decay.error <= 0 && decay.value + decay.error < slowest)
    return {MotionKind::quasi_periodic, "", ""};
  return {MotionKind::undecided, "quasi-periodic and a slow decay to a cycle",
          format("the modulation decays by %.1e +- %.1e a period: %.0f periods more would decide (-settled_periods)",
                 decay.value, decay.error, 3 / std::max({decay.value, decay.error, 1e-6}))};
}

/// Of an exponent above zero. A mean's bar comes from batches, and a series shorter than some 50 correlation times has
/// no batches that are independent (Sokal 1997).
MotionVerdict judge_irregular(std::span<const double> energies)
{
  constexpr double enough = 50; // correlation times
  const double needed = enough * correlation_time(energies);
  if (static_cast<double>(energies.size()) >= needed) return {MotionKind::irregular, "", ""};
  return {MotionKind::undecided, "an irregular motion and one that still changes",
          format("its energy wanders slowly, and means may be off by more than their bars: %.2g periods would decide "
                 "(-settled_periods)",
                 needed)};
}

/// Whether the periods' energies are one value within what is asked of a cycle's energy by default (accuracy), and do
/// not part from it.
bool steady(std::span<const double> energies)
{
  double sum = 0, squares = 0;
  for (const double energy : energies) sum += energy;
  const double middle = sum / static_cast<double>(energies.size());
  for (const double energy : energies) squares += (energy - middle) * (energy - middle);
  const MeanValue decay = decay_of_spread(energies);
  return std::sqrt(squares / static_cast<double>(energies.size())) < 1e-3 * middle && decay.value + decay.error >= 0;
}

/// Whether the two largest exponents are apart by their bars: a wide bar holds zero and much else.
bool parted(const std::vector<MeanValue>& exponents, double together)
{
  if (exponents.size() < 2) return true;
  const MeanValue &first = exponents[0], &second = exponents[1];
  return first.value - together * first.error > second.value + together * second.error;
}

/// Appends what was seen of a period.
void append(const PeriodSample& sample, ExaminedMotion& motion)
{
  motion.channels.resize(sample.means.size());
  for (std::size_t i = 0; i < sample.means.size(); ++i) motion.channels[i].push_back(sample.means[i]);
  motion.coordinate.insert(motion.coordinate.end(), sample.coordinate.begin(), sample.coordinate.end());
  motion.beside.insert(motion.beside.end(), sample.beside.begin(), sample.beside.end());
}

/// All that is said of the motion so far.
void examine(const TangentBundle& bundle, double period, ExaminedMotion& motion)
{
  const std::size_t periods = motion.periods();
  const std::size_t samples = motion.coordinate.size() / periods; // a period
  motion.discarded = values_before_stationary(motion.channels.front());
  const std::size_t first = motion.discarded < periods ? motion.discarded : periods / 2;
  motion.means.clear();
  for (const auto& channel : motion.channels) motion.means.push_back(batch_mean(std::span(channel).subspan(first)));
  motion.exponents = exponents_of(bundle, std::max(first, periods / 4));
  const double step = period / static_cast<double>(std::max<std::size_t>(samples, 1));
  motion.spectrum = spectrum_of(std::span(motion.coordinate).subspan(first * samples), step);
  motion.base = base_frequencies(motion.spectrum);
  if (motion.base.second == 0 && !motion.beside.empty())
    motion.base =
        base_frequencies(spectrum_of(std::span(motion.beside).subspan(first * samples), step), motion.base.first);
  motion.verdict = judge_motion(motion.exponents, std::span(motion.channels.front()).subspan(first), motion.base);
  const bool cycle = motion.verdict.kind == MotionKind::periodic && motion.base.closes_after == 0;
  if (cycle) motion.base.second = motion.base.explained = 0; // by the exponents: that line is rounding, or dies out
}

} // namespace

MotionVerdict judge_motion(const std::vector<MeanValue>& exponents, std::span<const double> energies,
                           const BaseFrequencies& base)
{
  const std::string more = "more periods would decide (-settled_periods)";
  if (!is_stationary(energies))
    return {MotionKind::undecided, "a motion that still changes and one that wanders slowly", more};
  if (exponents.empty()) return {MotionKind::undecided, "all kinds, without Lyapunov exponents", more};
  // Bars of 95 % each: 1.4 times as wide they hold for four exponents at once.
  constexpr double together = 1.4;
  const auto positive = std::count_if(exponents.begin(), exponents.end(),
                                      [](const MeanValue& one) { return one.value > together * one.error; });
  const auto zero = std::count_if(exponents.begin(), exponents.end(),
                                  [](const MeanValue& one) { return std::abs(one.value) <= together * one.error; });
  if (positive > 0) return judge_irregular(energies);
  const bool one_frequency = base.second == 0 || base.closes_after > 0;
  if (zero == 1 && (one_frequency || parted(exponents, together))) return {MotionKind::periodic, "", ""};
  if (zero == 1) return {MotionKind::undecided, "a cycle and an irregular motion: the exponents' bars overlap", more};
  // slow motions that die out have exponents within their bars of zero, too; of a torus whose parts hardly know of each
  // other the energies are as steady, and the second frequency tells
  if (zero > 1 && steady(energies) && one_frequency) return {MotionKind::periodic, "", ""};
  if (zero == 2) return judge_torus(energies, base);
  if (zero == 0) return {MotionKind::undecided, "a cycle and rest: no exponent is zero within its bar", more};
  return {MotionKind::undecided, "quasi-periodic with more than two frequencies and weakly irregular",
          format("%ld exponents are zero within their bars: ", static_cast<long>(zero)) + more};
}

ExaminedMotion examine_motion(const Flow& flow, const PeriodSampler& sampler, Vec state, double period,
                              const SettledOptions& options)
{
  ExaminedMotion motion;
  TangentBundle bundle = make_bundle(flow, state, options.exponents);
  Progress progress(comm_of(displacement(state)), "settled", static_cast<double>(options.periods));
  const auto most = static_cast<std::size_t>(options.periods);
  std::size_t target = std::min<std::size_t>(128, most);
  for (;; target = std::min(2 * target, most))
  {
    while (motion.periods() < target)
    {
      const PeriodSample sample = sampler(state);
      append(sample, motion);
      follow_period(flow, bundle);
      progress.update(static_cast<double>(motion.periods()), format("energy %.4g", sample.means.front()));
    }
    examine(bundle, period, motion);
    if (motion.verdict.kind != MotionKind::undecided || target == most) return motion;
  }
}

} // namespace squeal
