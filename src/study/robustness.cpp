#include "squeal/study/robustness.hpp"

#include "robustness_summary.hpp"
#include "squeal/algebra/lent_cores.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/base/random.hpp"
#include "squeal/base/run_control.hpp"
#include "swept_model.hpp"

#include <algorithm>
#include <ranges>
#include <utility>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;

constexpr double loosest_tolerance = 0.01; // on backward errors: that of a frequency's square, so to speak
constexpr double least_share = 0.1;        // of a reference mode in an unstable one, below which it is none of them
constexpr std::size_t prepared = 16; // samples whose closed pairs tell those of the basis, and whose scatter its error

/// The text of the Error of some work; empty where there is none.
template <class Work> std::string error_of(Work work)
{
  try
  {
    work();
  }
  catch (const LibraryError&)
  {
    throw;
  }
  catch (const Error& error)
  {
    return error.what();
  }
  return {};
}

/// Error: a stage of a sample did not converge, and why.
void need(const Outcome& outcome)
{
  if (outcome.kind != OutcomeKind::converged) throw Error(word(outcome.kind) + (": " + outcome.reason));
}

std::vector<double> values_at(const std::vector<UncertainNumber>& numbers, const std::vector<double>& parts)
{
  std::vector<double> values;
  for (std::size_t i = 0; i < numbers.size(); ++i) values.push_back(quantile(numbers[i], parts[i]));
  return values;
}

/// The samples. Collective: it ends where the run is asked to.
std::vector<std::vector<double>> random_values(const RobustnessProblem& problem, MPI_Comm comm)
{
  constexpr int between = 1 << 14; // samples, a few milliseconds
  std::mt19937_64 generator(static_cast<std::uint64_t>(problem.settings.seed));
  std::vector<std::vector<double>> samples;
  for (int k = 0; k < problem.settings.samples; ++k)
  {
    if (k % between == 0) end_if_asked(comm);
    std::vector<double> parts;
    for (std::size_t i = 0; i < problem.numbers.size(); ++i) parts.push_back(uniform(generator));
    samples.push_back(values_at(problem.numbers, parts));
  }
  return samples;
}

/// The modes of the medians, by which those of samples are named.
class Reference
{
public:
  Reference() = default;
  explicit Reference(PointModes modes) : modes_(std::move(modes)) {}

  std::vector<Complex> eigenvalues() const
  {
    std::vector<Complex> values;
    for (const TwoSidedPair& pair : modes_.pairs) values.push_back(pair.lambda);
    return values;
  }

  /// For each mode of a sample the one that it shares most with, and whose frequency is not far from its own.
  std::vector<int> nearest_to(const PointModes& sample) const
  {
    std::vector<int> result(sample.pairs.size(), unmatched);
    if (modes_.pairs.empty() || sample.pairs.empty()) return result;
    const Eigen::MatrixXd macs = all_macs(forms_between(modes_, sample));
    for (std::size_t j = 0; j < result.size(); ++j)
      for (double most = least_share; const std::size_t i : std::views::iota(std::size_t{0}, modes_.pairs.size()))
      {
        // to be one mode, its stiffness over its mass would have to have changed by so much
        const double change = folded(std::norm(modes_.pairs[i].lambda) / std::norm(sample.pairs[j].lambda)),
                     alike = macs(static_cast<Index>(i), static_cast<Index>(j)) * change;
        if (alike <= most) continue;
        most = alike;
        result[j] = unstable_partner(i);
      }
    return result;
  }

private:
  /// Of two modes locked in at one frequency, of which one grows: that one, whichever it is of the two.
  int unstable_partner(std::size_t mode) const
  {
    const Complex own = modes_.pairs[mode].lambda;
    const auto locked =
        std::ranges::find_if(modes_.pairs,
                             [own](const TwoSidedPair& other)
                             {
                               const Complex apart = other.lambda - own;
                               return is_unstable(other.lambda) && std::abs(apart.imag()) < std::abs(apart.real());
                             });
    return static_cast<int>(is_unstable(own) || locked == modes_.pairs.end() ? static_cast<std::ptrdiff_t>(mode)
                                                                             : locked - modes_.pairs.begin());
  }

  PointModes modes_{};
};

/// The modes of some samples, and the largest backward error of their vectors.
struct SampledModes
{
  std::vector<std::vector<Complex>> lambda{}; // by samples
  double backward_error = 0;
};

/// The largest distance of an eigenvalue in the band [Hz] from the nearest one of the other list, over its size.
double largest_shift(const SampledModes& from, const SampledModes& to, double band)
{
  double largest = 0;
  for (std::size_t k = 0; k < from.lambda.size(); ++k)
    for (const Complex lambda : from.lambda[k])
    {
      if (std::abs(lambda) >= two_pi * band) continue;
      double nearest = std::numeric_limits<double>::infinity();
      for (const Complex other : to.lambda[k]) nearest = std::min(nearest, std::abs(other - lambda) / std::abs(lambda));
      largest = std::max(largest, nearest);
    }
  return largest;
}

/// Standard deviation of the largest growth rate over |lambda| of each sample.
double scatter_of(const SampledModes& modes)
{
  std::vector<double> growth;
  for (const std::vector<Complex>& lambda : modes.lambda)
  {
    const auto ratio = [](Complex one) { return one.real() / std::abs(one); };
    if (!lambda.empty()) growth.push_back(std::ranges::max(lambda | std::views::transform(ratio)));
  }
  const Eigen::Map<const Eigen::ArrayXd> values(growth.data(), static_cast<Index>(growth.size()));
  return growth.size() < 2
             ? 0
             : std::sqrt((values - values.mean()).square().sum() / static_cast<double>(growth.size() - 1));
}

/// The points of a scene with random numbers, on a basis of one rank that they share.
class Sampler
{
public:
  explicit Sampler(const RobustnessProblem& problem)
      : problem_(problem),
        model_({problem.model_at, problem.modes, problem.modes_options, problem.equilibrium_options}, MPI_COMM_SELF)
  {
  }

  /// Finds the pairs that stay closed at the first samples, then the modes of the medians. Without these, modes are
  /// like none of the reference.
  void prepare(std::span<const SampleResult> samples)
  {
    const std::vector<double> medians(problem_.numbers.size(), 0.5);
    const SweptPlace middle{values_at(problem_.numbers, medians)};
    model_.prepare(middle);
    samples = samples.first(std::min(samples.size(), prepared));
    for (const SampleResult& result : samples) model_.prepare({result.sample.values});
    find_tolerance(samples);
    (void)error_of([&] { reference_ = Reference(modes_at(middle)); });
  }

  /// The modes in the band. Error: there is no equilibrium, or they were not found.
  std::vector<Complex> modes_of(const std::vector<double>& values)
  {
    std::vector<Complex> modes;
    for (const TwoSidedPair& pair : modes_at({values}).pairs) modes.push_back(pair.lambda);
    return modes;
  }

  /// Sets what is found at the values of a sample. Error: as of modes_of.
  void evaluate(SampleResult& result)
  {
    RobustSample& sample = result.sample;
    const SweptPlace at{sample.values};
    const PointModes modes = modes_at(at);
    const std::vector<int> names = reference_.nearest_to(modes);
    sample.known = true;
    sample.closed = static_cast<int>(std::ranges::count(model_.equilibrium_at(at).closed, 1));
    Complex worst;
    for (std::size_t k = 0; k < names.size(); ++k)
    {
      const Complex lambda = modes.pairs[k].lambda;
      const bool first = worst == 0. || lambda.real() / std::abs(lambda) > worst.real() / std::abs(worst);
      if (first) worst = lambda;
      if (!is_unstable(lambda)) continue;
      if (first) sample.mode = names[k];
      result.unstable.push_back({names[k], lambda});
      ++sample.unstable;
    }
    sample.growth_rate = worst.real();
    sample.frequency_hz = frequency_hz_of(worst);
    model_.forget(at);
  }

  const Reference& reference() const { return reference_; }
  Index shapes() const { return model_.shapes(); }

private:
  /// Tightens the tolerance until the error of these samples' eigenvalues is a part of what their growth rates scatter
  /// by. What a larger basis changes is the error on the smaller one, which is taken where that is small enough: the
  /// work of a sample grows with the cube of the shapes. Errors fall as the product of those of both vectors.
  void find_tolerance(std::span<const SampleResult> samples)
  {
    SampledModes coarse = modes_of(samples);
    while (tolerance_ > close_tolerance)
    {
      const Index shapes = model_.shapes();
      const double before = std::exchange(tolerance_, std::max(close_tolerance, tolerance_ / 10));
      SampledModes fine = modes_of(samples);
      const double shift = largest_shift(coarse, fine, problem_.modes.band),
                   enough = problem_.accuracy * scatter_of(fine),
                   reduction = std::pow(fine.backward_error / coarse.backward_error, 2);
      if (model_.shapes() > shapes && shift <= enough)
      {
        tolerance_ = before;
        return model_.truncate(shapes);
      }
      if (model_.shapes() > shapes && shift * reduction <= enough) return;
      coarse = std::move(fine);
    }
  }

  /// Empty where a sample has none.
  SampledModes modes_of(std::span<const SampleResult> samples)
  {
    SampledModes found;
    for (const auto& [sample, unstable, problem] : samples)
    {
      std::vector<Complex>& lambda = found.lambda.emplace_back();
      (void)error_of(
          [&]
          {
            const PointModes modes = followed_modes_at({sample.values});
            for (const TwoSidedPair& pair : modes.pairs) lambda.push_back(pair.lambda);
            found.backward_error = std::max(found.backward_error, modes.outcome.residual);
          });
    }
    return found;
  }

  /// Up to a little beyond the band.
  PointModes followed_modes_at(const SweptPlace& place)
  {
    need(model_.equilibrium_at(place).outcome);
    PointModes modes = model_.modes_at(place, tolerance_);
    need(modes.outcome);
    return modes;
  }

  PointModes modes_at(const SweptPlace& place)
  {
    PointModes modes = followed_modes_at(place);
    std::erase_if(modes.pairs, [&](const TwoSidedPair& pair) { return !in_band(pair, problem_.modes.band); });
    return modes;
  }

  const RobustnessProblem& problem_;
  SweptModel model_;
  double tolerance_ = loosest_tolerance; // on the backward errors of both vectors
  Reference reference_{};
};

/// The modes of the full problem in the band. Error: they were not found.
std::vector<Complex> full_modes(const RobustnessProblem& problem, const std::vector<double>& values)
{
  const BrakeModel model = problem.model_at(values, MPI_COMM_SELF);
  const Equilibrium equilibrium = Equilibria(problem.equilibrium_options).at(model.structure, model.interface);
  need(equilibrium.outcome);
  const SlidingEquilibrium sliding{model.structure, model.interface, equilibrium};
  ModesSettings settings = problem.modes;
  settings.method = ModesMethod::full;
  const Modes modes = find_modes(sliding, linearise(sliding), settings, problem.modes_options);
  need(modes.outcome);
  std::vector<Complex> lambda;
  for (const ComplexMode& mode : modes.modes) lambda.push_back(mode.lambda);
  return lambda;
}

/// The largest errors of what is unstable in one of two lists, against the nearest of the other one.
void compare(const std::vector<Complex>& reduced, const std::vector<Complex>& full, RobustCheck& check)
{
  const auto add = [&](const std::vector<Complex>& from, const std::vector<Complex>& to)
  {
    for (const Complex lambda : from)
    {
      if (!is_unstable(lambda)) continue;
      double error = std::numeric_limits<double>::infinity();
      Complex difference;
      for (const Complex other : to)
        if (std::abs(other - lambda) < error)
        {
          difference = other - lambda;
          error = std::abs(difference);
        }
      check.growth_error = std::max(check.growth_error, std::abs(difference.real()) / std::abs(lambda));
      check.frequency_error = std::max(check.frequency_error, std::abs(difference.imag()) / std::abs(lambda));
    }
  };
  add(reduced, full);
  add(full, reduced);
  check.unstable_reduced = static_cast<int>(std::ranges::count_if(reduced, is_unstable));
  check.unstable = static_cast<int>(std::ranges::count_if(full, is_unstable));
}

/// Does work(k) for this rank's share of so many results, between requests to end, and gives every rank all results.
/// Results that failed have their reason. Collective.
template <class Result, class Work>
void find_all(std::vector<Result>& results, const char* what, MPI_Comm comm, Work work)
{
  constexpr std::size_t between = 16;
  const auto ranks = static_cast<std::size_t>(ranks_of(comm)), rank = static_cast<std::size_t>(rank_of(comm));
  Progress progress(comm, what, static_cast<double>(results.size()));
  for (std::size_t step = 0; step * ranks < results.size(); ++step)
  {
    if (step % between == 0) end_if_asked(comm);
    if (const std::size_t k = step * ranks + rank; k < results.size()) results[k].problem = error_of([&] { work(k); });
    progress.update(static_cast<double>(std::min(results.size(), (step + 1) * ranks)), "");
  }
  share_in_turn(results, comm);
}

} // namespace

Robustness find_robustness(const RobustnessProblem& problem, MPI_Comm comm)
{
  const Finally alone = one_thread(); // points are many dense problems of a few hundred rows
  std::vector<SampleResult> samples;
  for (std::vector<double>& values : random_values(problem, comm)) samples.push_back({{std::move(values)}});
  Sampler sampler(problem);
  sampler.prepare(samples);
  find_all(samples, "robustness", comm, [&](std::size_t k) { sampler.evaluate(samples[k]); });
  std::vector<CheckResult> checks(static_cast<std::size_t>(problem.settings.checks));
  const auto check = [&](std::size_t k)
  {
    RobustCheck& found = checks[k].check;
    const std::vector<double>& values = samples[k].sample.values;
    found.sample = static_cast<int>(k);
    compare(sampler.modes_of(values), full_modes(problem, values), found);
    found.known = true;
  };
  find_all(checks, "robustness: checks", comm, check);
  Robustness result;
  for (SampleResult& sample : samples) result.samples.push_back(std::move(sample.sample));
  for (const CheckResult& one : checks) result.checks.push_back(one.check);
  find_probabilities(result, samples, sampler.reference().eigenvalues(), problem.settings.confidence);
  find_correlations(result, problem.numbers.size());
  result.basis = static_cast<int>(sampler.shapes());
  assess(result, samples, checks);
  return result;
}

} // namespace squeal
