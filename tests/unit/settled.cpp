// What a motion settles on: means with their bars, spectra, Lyapunov exponents and kinds, on series and smooth flows.
#include "../support/smooth_flows.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/settled/motion.hpp"

#include <cmath>
#include <doctest/doctest.h>
#include <numbers>
#include <random>

using namespace squeal;
using namespace squeal::test;

namespace
{

std::vector<double> sampled(std::size_t count, const std::function<double(double)>& of)
{
  std::vector<double> series;
  for (std::size_t i = 0; i < count; ++i) series.push_back(of(static_cast<double>(i)));
  return series;
}

/// x_(n+1) = memory x_n + noise about a mean of 1.
std::vector<double> noise_with_memory(std::mt19937& random, double memory)
{
  std::normal_distribution<double> normal;
  std::vector<double> series;
  double x = normal(random) / std::sqrt(1 - memory * memory);
  for (int i = 0; i < 512; ++i)
  {
    series.push_back(1 + x);
    x = memory * x + normal(random);
  }
  return series;
}

constexpr int pieces = 40; // of a period, for means and spectra

/// A smooth model whose tangent is a central difference, sampled in pieces of a period.
struct Motion
{
  SmoothModel model;
  Flow piece;    // over a part of a period
  double period; // [s] of a window
  MotionSeries seen{};
  Owned<Vec> from;             // of the period recorded last
  std::vector<double> weights; // of the displacements in the coordinate

  Motion(const Rate& rate, const std::vector<double>& weights_, double period_)
      : model(make_smooth_model(rate, std::vector<double>(weights_.size(), 1.))), period(period_), weights(weights_)
  {
    piece = runge_kutta_in(20, rate, model.M, model.K);
    model.flow = runge_kutta_in(20 * pieces, rate, model.M, model.K);
    model.flow.apply_tangent = [this](std::span<const Vec> states)
    {
      for (const Vec state : states) differentiate(state);
    };
  }

  void differentiate(Vec state) const
  {
    const double step = 1e-5;
    const Owned<Vec> ahead = copy_of(from.get()), behind = copy_of(from.get()), end = zeros_like(from);
    check(VecAXPY(ahead, step, state));
    check(VecAXPY(behind, -step, state));
    model.flow.integrate(period, ahead, state, nullptr);
    model.flow.integrate(period, behind, end, nullptr);
    check(VecAXPY(state, -1, end));
    check(VecScale(state, 1 / (2 * step)));
  }

  double advance(Vec state)
  {
    from = copy_of(state);
    const Owned<Vec> next = zeros_like(from);
    double energy = 0;
    for (int i = 0; i < pieces; ++i)
    {
      piece.integrate(period / pieces, state, next, nullptr);
      check(VecCopy(next, state));
      const double norm = energy_norm(model.flow, state);
      seen.averaged[0].push_back(norm * norm / 2);
      energy += seen.averaged[0].back() / pieces;
      const std::vector<double> u = all_entries(displacement(state));
      double value = 0;
      for (std::size_t k = 0; k < u.size(); ++k) value += weights[k] * u[k];
      seen.moving[0].push_back(value);
    }
    return energy;
  }

  ExaminedMotion examine(const std::vector<double>& u, int before, int periods)
  {
    const Owned<Vec> displaced = on_first_rank(u);
    const Owned<Vec> state = state_of(displaced, model.zero), end = zeros_like(state);
    for (int i = 0; i < before; ++i)
    {
      model.flow.integrate(period, state, end, nullptr);
      check(VecCopy(end, state));
    }
    SettledOptions options;
    options.periods = periods;
    options.exponents = std::min<PetscInt>(4, 2 * static_cast<PetscInt>(u.size()));
    seen = {{{}}, {{}}, {}};
    return examine_motion(model.flow, {period, [this](Vec now) { return advance(now); }, [this] { return seen; }},
                          state, options);
  }
};

/// Van der Pol's oscillator beside its copy, `factor` times as fast.
Rate two_apart(double factor)
{
  return [factor](const std::vector<double>& x, std::vector<double>& rate) {
    rate = {x[2], x[3], (1 - x[0] * x[0]) * x[2] - x[0], factor * (1 - x[1] * x[1]) * x[3] - factor * factor * x[1]};
  };
}

/// x'' + 0.3 x' - x + x^3 = drive cos(1.2 t); the cosine is the cycle of a second oscillator, which nothing drives.
void duffing(double drive, const std::vector<double>& x, std::vector<double>& rate)
{
  const double w = 1.2, q = x[3] / w;
  rate = {x[2], x[3], -0.3 * x[2] + x[0] - x[0] * x[0] * x[0] + drive * x[1],
          -w * w * x[1] + (1 - x[1] * x[1] - q * q) * x[3]};
}

/// The largest exponent of the driven oscillator a period, from the growth of a difference of 1e-8 in (x, x') alone.
double growth_of_a_difference(double drive, int periods)
{
  const double w = 1.2, h = two_pi / w / 400, apart = 1e-8;
  const auto rate = [&](double t, std::array<double, 2> x) {
    return std::array{x[1], -0.3 * x[1] + x[0] - x[0] * x[0] * x[0] + drive * std::cos(w * t)};
  };
  const auto advance = [&](double t, std::array<double, 2> x)
  {
    const auto at = [&](const std::array<double, 2>& k, double ahead) {
      return std::array{x[0] + ahead * k[0], x[1] + ahead * k[1]};
    };
    const auto a = rate(t, x), b = rate(t + h / 2, at(a, h / 2)), c = rate(t + h / 2, at(b, h / 2)),
               d = rate(t + h, at(c, h));
    for (int i = 0; i < 2; ++i) x[i] += h / 6 * (a[i] + 2 * b[i] + 2 * c[i] + d[i]);
    return x;
  };
  std::array<double, 2> x{1, 0}, y{1 + apart, 0};
  double sum = 0, t = 0;
  for (int period = -100; period < periods; ++period)
  {
    for (int i = 0; i < 400; ++i, t += h)
    {
      x = advance(t, x);
      y = advance(t, y);
    }
    const double now = std::hypot(y[0] - x[0], y[1] - x[1]);
    if (period >= 0) sum += std::log(now / apart);
    for (int i = 0; i < 2; ++i) y[i] = x[i] + apart / now * (y[i] - x[i]);
  }
  return sum / periods;
}

} // namespace

TEST_CASE("bars of batch means hold the true mean in nine series of ten or more")
{
  std::mt19937 random(7);
  for (const double memory : {0., 0.7, 0.9})
  {
    int held = 0;
    for (int i = 0; i < 400; ++i)
    {
      const MeanValue mean = batch_mean(noise_with_memory(random, memory));
      held += std::abs(mean.value - 1) <= mean.error;
    }
    CAPTURE(memory);
    // 95 % by construction without memory; the widest of three bars holds a little more
    CHECK(held >= 360);
  }
}

TEST_CASE(
    "the correlation time of noise with memory a is (1 + a)/(1 - a); an irregular motion that wanders is undecided")
{
  std::mt19937 random(11);
  double sum = 0;
  for (int i = 0; i < 400; ++i) sum += correlation_time(noise_with_memory(random, 0.7));
  CHECK(sum / 400 == doctest::Approx(1.7 / 0.3).epsilon(0.15)); // taking the mean off costs 2 M tau/n = 12 %
  const std::vector<MeanValue> exponents{{0.1, 0.01}};
  const BaseFrequencies base;
  CHECK(judge_motion(exponents, noise_with_memory(random, 0), base).kind == MotionKind::irregular);
  const MotionVerdict wandering = judge_motion(exponents, noise_with_memory(random, 0.97), base);
  CHECK(wandering.kind == MotionKind::undecided);
}

TEST_CASE("steady energies are a cycle's, unless the spectrum has a second frequency that is no fraction of the first")
{
  std::mt19937 random(4);
  std::vector<double> energies = noise_with_memory(random, 0);
  for (double& energy : energies) energy = 1 + 1e-5 * energy;
  const std::vector<MeanValue> two_zeros{{1e-4, 1e-2}, {-1e-4, 1e-2}};
  CHECK(judge_motion(two_zeros, energies, {1, 0, 0, 1}).kind == MotionKind::periodic);
  CHECK(judge_motion(two_zeros, energies, {1, 0.5, 2, 1}).kind == MotionKind::periodic);
  CHECK(judge_motion(two_zeros, energies, {1, 0.97, 0, 1}).kind != MotionKind::periodic);
  CHECK(judge_motion(two_zeros, energies, {1, 4. / 19, 19, 1}).kind != MotionKind::periodic); // a torus comes as near
}

TEST_CASE("an exponent that is zero within a wide bar makes no cycle of a motion of two frequencies")
{
  std::mt19937 random(7);
  const std::vector<double> energies = noise_with_memory(random, 0);
  const BaseFrequencies base{1, 0.97, 0, 1};
  const std::vector<MeanValue> wide = {{0.278, 0.307}, {-0.277, 0.14}, {-1, 0.1}},
                               narrow = {{0.0005, 0.001}, {-0.01, 0.002}, {-1, 0.1}};
  CHECK(judge_motion(wide, energies, base).kind == MotionKind::undecided);
  CHECK(judge_motion(wide, energies, {1, 0, 0, 1}).kind == MotionKind::periodic);
  CHECK(judge_motion(wide, energies, {1, 1.5, 2, 1}).kind == MotionKind::undecided); // two rounds that differ in energy
  CHECK(judge_motion(narrow, energies, base).kind == MotionKind::periodic);
}

TEST_CASE("energies of a broad spectrum are told from those of lines: zero exponents are then an irregular motion's")
{
  std::mt19937 random(5);
  const auto lines = sampled(400, [](double i)
                             { return 2 + std::sin(0.83 * i) + 0.6 * std::cos(2.17 * i) + 0.4 * std::sin(1.39 * i); });
  std::vector<double> noise = noise_with_memory(random, 0.3);
  for (double& value : noise) value = 2 + 0.3 * value;
  const auto torus = sampled(400, [](double i) { return 2 + std::sin(0.83 * i) + 0.3 * std::cos(1.66 * i); });
  CHECK(wandering(torus) < 0.1);
  CHECK(wandering(lines) < 0.3); // angles near a line's own take longer
  CHECK(wandering(noise) > 0.8);
  CHECK(std::isnan(wandering(std::span(lines).first(190))));
  const std::vector<MeanValue> three_zeros{{0.014, 0.031}, {0.002, 0.02}, {-0.006, 0.017}, {-1, 0.1}};
  CHECK(judge_motion(three_zeros, noise, {1, 0.37, 0, 0.3}).kind == MotionKind::irregular);
  CHECK(judge_motion(three_zeros, lines, {1, 0.37, 0, 0.3}).kind == MotionKind::undecided);
  const std::vector<MeanValue> two_zeros{{1e-3, 1e-2}, {-1e-3, 1e-2}, {-0.3, 0.1}};
  CHECK(judge_motion(two_zeros, torus, {1, 0.37, 0, 0.3}).kind == MotionKind::quasi_periodic);
}

TEST_CASE("a drift is not stationary, a beat is; what comes before the motion has settled is left out")
{
  std::mt19937 random(3);
  CHECK(is_stationary(sampled(256, [](double i) { return 2 + std::sin(0.37 * i); })));
  CHECK_FALSE(is_stationary(sampled(256, [](double i) { return 2 + 0.01 * i + std::sin(0.37 * i); })));
  const auto settles = sampled(512, [](double i) { return 2 + 3 * std::exp(-i / 20) + std::sin(0.37 * i); });
  CHECK_FALSE(is_stationary(settles));
  CHECK(values_before_stationary(settles) == 64); // an eighth: e^-3.2 of the decay is left there
}

TEST_CASE("the spread of a beat that dies decays at its rate")
{
  const auto dying = sampled(512, [](double i) { return 1 + std::exp(-0.01 * i) * std::sin(0.8 * i); });
  const MeanValue decay = decay_of_spread(dying);
  CHECK(std::abs(decay.value - 0.01) <= decay.error);
  const MeanValue none = decay_of_spread(sampled(512, [](double i) { return 1 + std::sin(0.8 * i); }));
  CHECK(std::abs(none.value) <= none.error);
}

TEST_CASE("lines between the points of the transform are found, with their amplitudes and base frequencies")
{
  const double h = 1e-3, pi = std::numbers::pi;
  const std::vector<std::pair<double, double>> parts = {{50.31, 1}, {61.77, 0.3}, {38.85, 0.1}, {100.62, 0.05}};
  const auto signal = sampled(4096,
                              [&](double i)
                              {
                                double sum = 3;
                                for (const auto& [frequency, amplitude] : parts)
                                  sum += amplitude * std::cos(2 * pi * frequency * i * h + frequency);
                                return sum;
                              });
  const Spectrum spectrum = spectrum_of(signal, h);
  REQUIRE(spectrum.lines.size() >= parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i)
  {
    // neighbours forty points away leak about 1e-4 of themselves
    CHECK(spectrum.lines[i].frequency_hz == doctest::Approx(parts[i].first).epsilon(1e-3));
    CHECK(spectrum.lines[i].amplitude == doctest::Approx(parts[i].second).epsilon(0.01));
  }
  const BaseFrequencies base = base_frequencies(spectrum);
  CHECK(base.first == doctest::Approx(50.31).epsilon(1e-4));
  CHECK(base.second == doctest::Approx(61.77).epsilon(1e-4));
  CHECK(base.closes_after == 0);
  CHECK(base.explained > 0.98); // 38.85 = 2 f_1 - f_2
}

TEST_CASE("the exponents of the van der Pol cycle are zero and the logarithm of its multiplier")
{
  Motion motion(van_der_pol, {1}, vdp_period);
  const ExaminedMotion seen = motion.examine({2}, 5, 64);
  REQUIRE(seen.exponents.size() == 2);
  CHECK(std::abs(seen.exponents[0].value) < 1e-6);
  CHECK(seen.exponents[1].value == doctest::Approx(std::log(vdp_multiplier)).epsilon(1e-4));
  CHECK(seen.verdict.kind == MotionKind::periodic);
  CHECK(seen.base.first == doctest::Approx(1 / vdp_period).epsilon(1e-4));
  CHECK(seen.base.second == 0);
}

TEST_CASE("two oscillators that do not know of each other move on a torus, whose base frequencies are theirs")
{
  const double factor = 1.2720196495; // no common period within any number of turns that matters
  Motion motion(two_apart(factor), {1, 0.7}, vdp_period);
  const ExaminedMotion seen = motion.examine({2, 2}, 10, 256);
  CHECK(seen.verdict.kind == MotionKind::quasi_periodic);
  CHECK(std::abs(seen.exponents[0].value) <= seen.exponents[0].error);
  CHECK(std::abs(seen.exponents[1].value) <= seen.exponents[1].error);
  CHECK(seen.exponents[2].value < -1);
  CHECK(seen.base.first == doctest::Approx(1 / vdp_period).epsilon(1e-3));
  CHECK(seen.base.second == doctest::Approx(factor / vdp_period).epsilon(1e-3));
}

TEST_CASE("a motion that winds down to a cycle is never called quasi-periodic")
{
  for (const double damping : {0.001, 0.003, 0.01})
  {
    const auto decaying = [damping](const std::vector<double>& x, std::vector<double>& rate) {
      rate = {x[2], x[3], (1 - x[0] * x[0]) * x[2] - x[0], -2 * damping * x[3] - 2.3 * x[1]};
    };
    Motion motion(decaying, {1, 1}, vdp_period);
    const ExaminedMotion seen = motion.examine({2, 1}, 0, 128);
    CAPTURE(damping);
    CHECK(seen.verdict.kind != MotionKind::quasi_periodic);
    CHECK(seen.verdict.kind != MotionKind::irregular);
  }
}

TEST_CASE("the driven double well: closing after two periods at one drive, irregular at another")
{
  const double period = two_pi / 1.2;
  Motion doubled([](const auto& x, auto& rate) { duffing(0.28, x, rate); }, {1, 0}, period);
  const ExaminedMotion two = doubled.examine({1, 1}, 60, 128);
  CHECK(two.verdict.kind == MotionKind::periodic);
  CHECK(two.base.closes_after == 2);

  Motion wild([](const auto& x, auto& rate) { duffing(0.5, x, rate); }, {1, 0}, period);
  const ExaminedMotion seen = wild.examine({1, 1}, 60, 256);
  CHECK(seen.verdict.kind == MotionKind::irregular);
  // the difference's own mean over 2000 periods of the drive is good to a tenth of the bar of 192
  const double exact = growth_of_a_difference(0.5, 2000) * seen.period / period;
  CHECK(std::abs(seen.exponents[0].value - exact) <= 1.2 * seen.exponents[0].error);
}
