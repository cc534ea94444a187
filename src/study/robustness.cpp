#include "squeal/study/robustness.hpp"

#include "reduced_sliding.hpp"
#include "robustness_summary.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/base/random.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/modes/dense_losses.hpp"
#include "swept_model.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::VectorXcd;

constexpr int training = 12;                // points whose modes make the basis
constexpr double training_tolerance = 1e-6; // backward error of their vectors
constexpr double truncation = 5e-2;         // part of a vector, in energy norm, that the basis may leave out
constexpr double least_share = 0.1;         // of a reference mode in an unstable one, below which it is none of them

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

/// Points that fill the unit cube evenly: the centre, then Halton's sequence.
std::vector<std::vector<double>> even_points(std::size_t dimensions, PetscInt count)
{
  std::vector<std::vector<double>> points = {std::vector<double>(dimensions, 0.5)};
  std::vector<int> primes;
  for (int candidate = 2; primes.size() < dimensions; ++candidate)
    if (std::ranges::none_of(primes, [&](int prime) { return candidate % prime == 0; })) primes.push_back(candidate);
  for (PetscInt k = 1; k < count; ++k)
  {
    std::vector<double>& point = points.emplace_back();
    for (const int prime : primes)
    {
      double value = 0, digit = 1. / prime;
      for (PetscInt rest = k; rest > 0; rest /= prime, digit /= prime)
        value += static_cast<double>(rest % prime) * digit;
      point.push_back(value);
    }
  }
  return points;
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

/// Points whose modes make the basis: the middle parts of the distributions, stretched to their tails.
std::vector<std::vector<double>> training_values(const RobustnessProblem& problem)
{
  constexpr double tail = 0.01; // quantiles beyond are left to the samples
  std::vector<std::vector<double>> points;
  for (std::vector<double>& parts : even_points(problem.numbers.size(), training))
  {
    for (double& part : parts) part = tail + part * (1 - 2 * tail);
    points.push_back(values_at(problem.numbers, parts));
  }
  return points;
}

/// The modes in the band with both vectors.
std::vector<TwoSidedPair> two_sided_modes(const ReducedMatrices& at, double band)
{
  std::vector<TwoSidedPair> pairs =
      solve_two_sided_lossy_shared(MPI_COMM_SELF, {at.M, at.C, at.K, at.K_loss}, HUGE_VAL);
  std::erase_if(pairs, [&](const TwoSidedPair& pair) { return !in_band(pair, band); });
  return pairs;
}

/// Modes of the reference, on the reduced model's shapes.
class Reference
{
public:
  Reference() = default;

  Reference(const ReducedMatrices& at, double band) : pairs_(two_sided_modes(at, band))
  {
    for (const TwoSidedPair& pair : pairs_) own_.push_back(form(at, pair, pair));
  }

  std::vector<Complex> eigenvalues() const
  {
    std::vector<Complex> values;
    for (const TwoSidedPair& pair : pairs_) values.push_back(pair.lambda);
    return values;
  }

  /// The mode that an unstable one of a sample shares most with, and whose frequency is not far from its own.
  int nearest(const ReducedMatrices& at, const TwoSidedPair& pair) const
  {
    const Complex own = form(at, pair, pair);
    double most = least_share;
    int result = unmatched;
    for (std::size_t i = 0; i < pairs_.size(); ++i)
    {
      const double mac = folded(std::abs(form(at, pairs_[i], pair) * form(at, pair, pairs_[i]) / (own_[i] * own)));
      // Where only one of two shapes moves with the pairs, T may show them alike. To be one mode, its stiffness over
      // its mass would have to have changed by so much.
      const double alike = mac * folded(std::norm(pairs_[i].lambda) / std::norm(pair.lambda));
      if (alike <= most) continue;
      most = alike;
      result = static_cast<int>(i);
    }
    return result == unmatched ? unmatched : unstable_partner(result);
  }

private:
  /// Of two modes locked in at one frequency, of which one grows: that one, whichever it is of the two.
  int unstable_partner(int mode) const
  {
    const Complex own = pairs_[static_cast<std::size_t>(mode)].lambda;
    const auto locked =
        std::ranges::find_if(pairs_,
                             [own](const TwoSidedPair& other)
                             {
                               const Complex apart = other.lambda - own;
                               return is_unstable(other.lambda) && std::abs(apart.imag()) < std::abs(apart.real());
                             });
    return is_unstable(own) || locked == pairs_.end() ? mode : static_cast<int>(locked - pairs_.begin());
  }

  /// left'((lambda + lambda') M + C) right, of T alone: points have different pairs open
  static Complex form(const ReducedMatrices& at, const TwoSidedPair& a, const TwoSidedPair& b)
  {
    const Index n = at.common;
    const VectorXcd right = b.right.head(n);
    const VectorXcd image =
        (a.lambda + b.lambda) * (at.M.topLeftCorner(n, n) * right) + at.C.topLeftCorner(n, n) * right;
    return (a.left.head(n).array() * image.array()).sum();
  }

  std::vector<TwoSidedPair> pairs_{};
  std::vector<Complex> own_{};
};

/// The reduced model of a scene with random numbers, on one rank.
class Sampler
{
public:
  explicit Sampler(const RobustnessProblem& problem)
      : problem_(problem), model_(problem), omega_(0.1 * two_pi * problem.modes.band),
        equilibrium_options_(problem.equilibrium_options), equilibria_(equilibrium_options_)
  {
    const PairShapes pairs = make_pair_shapes(model_.reference(), omega_);
    reduced_.emplace(model_, trained_shapes(pairs), pairs);
    const std::vector<double> medians = values_at(problem.numbers, std::vector<double>(problem.numbers.size(), 0.5));
    // without it, modes are like none of the reference
    (void)error_of([&] { reference_ = Reference(matrices_at(medians), problem.modes.band); });
  }

  /// The reduced matrices at a point. Error: there is no equilibrium, or friction jams a closed pair.
  ReducedMatrices matrices_at(const std::vector<double>& values)
  {
    const BrakeModel& model = model_.at(values);
    const auto& [structure, interface] = model;
    Equilibrium equilibrium = equilibria_.at(structure, interface);
    need(equilibrium.outcome);
    closed_ = equilibrium.closed;
    return reduced_->at(model_.coefficients(values), interface, equilibrium);
  }

  /// The modes in the band; without loss factors without their vectors, which take longer.
  std::vector<TwoSidedPair> pairs_of(const ReducedMatrices& at) const
  {
    const auto norm = [](const Eigen::MatrixXd& A) { return A.cwiseAbs().colwise().sum().maxCoeff(); };
    const double floor = vibration_floor({norm(at.M), 0, norm(at.K)}), band = problem_.modes.band;
    std::vector<TwoSidedPair> pairs;
    if (at.K_loss.size() > 0)
      pairs = two_sided_modes(at, band);
    else
      for (const Complex lambda : dense_quadratic_eigenvalues(at.M, at.C, at.K)) pairs.push_back({lambda, {}, {}});
    std::erase_if(pairs,
                  [&](const TwoSidedPair& pair) { return std::norm(pair.lambda) < floor || !in_band(pair, band); });
    return pairs;
  }

  std::vector<Complex> modes_of(const ReducedMatrices& at) const
  {
    std::vector<Complex> modes;
    for (const TwoSidedPair& pair : pairs_of(at)) modes.push_back(pair.lambda);
    return modes;
  }

  /// Sets what is found at the values of a sample; its unstable modes join the list. Error: as of matrices_at.
  void evaluate(int place, RobustSample& sample, std::vector<UnstableMode>& unstable)
  {
    const ReducedMatrices at = matrices_at(sample.values);
    RobustSample found{sample.values, true, static_cast<int>(std::ranges::count(closed_, 1))};
    std::vector<UnstableMode> modes;
    Complex worst;
    for (const TwoSidedPair& pair : pairs_of(at))
    {
      const Complex lambda = pair.lambda;
      const bool first = worst == 0. || lambda.real() / std::abs(lambda) > worst.real() / std::abs(worst);
      if (first) worst = lambda;
      if (!is_unstable(lambda)) continue;
      const bool known = pair.right.size() > 0;
      const int mode = reference_.nearest(at, known ? pair : two_sided_pair(at.M, at.C, at.K, lambda));
      if (first) found.mode = mode;
      modes.push_back({place, mode, lambda});
    }
    found.unstable = static_cast<int>(modes.size());
    found.growth_rate = worst.real();
    found.frequency_hz = frequency_hz_of(worst);
    sample = std::move(found);
    unstable.insert(unstable.end(), modes.begin(), modes.end());
  }

  const Reference& reference() const { return reference_; }
  Index shapes() const { return reduced_->shapes(); }
  double error() const { return model_.error(); }
  int trained() const { return trained_; }

private:
  /// The modes of the training points, on a basis that they share.
  MultiVector trained_shapes(const PairShapes& pairs)
  {
    SweepSettings settings;
    for (const UncertainNumber& number : problem_.numbers) settings.key.push_back(number.key);
    const SweepOptions options;
    const auto model_at = [&](std::span<const double> values, MPI_Comm) { return problem_.model_at(values); };
    const SweepProblem sweep{settings, model_at, {}, problem_.modes, problem_.modes_options, equilibrium_options_,
                             options};
    SweptModel swept(sweep, MPI_COMM_SELF);
    const std::vector<std::vector<double>> points = training_values(problem_);
    for (const std::vector<double>& values : points) swept.prepare({values, false});
    ShapeCollection shapes(model_.reference(), pairs, omega_);
    for (const std::vector<double>& values : points)
    {
      if (swept.equilibrium_at({values, false}).outcome.kind != OutcomeKind::converged) continue;
      const PointModes modes = swept.modes_at({values, false}, training_tolerance);
      if (modes.outcome.kind != OutcomeKind::converged || modes.pairs.empty()) continue;
      for (const Side side : {Side::right, Side::left}) shapes.add(swept.vectors(modes, side), truncation);
      ++trained_;
    }
    if (trained_ == 0) throw Error("no point of the random numbers has an equilibrium with modes in the band");
    return shapes.shapes();
  }

  const RobustnessProblem& problem_;
  PolynomialModel model_;
  double omega_; // of energies, a tenth of the band's
  EquilibriumOptions equilibrium_options_;
  Equilibria equilibria_;
  std::vector<char> closed_{}; // at the equilibrium found last
  int trained_ = 0;
  std::optional<ReducedSliding> reduced_{};
  Reference reference_{};
};

/// The modes of the full problem in the band. Error: they were not found.
std::vector<Complex> full_modes(const RobustnessProblem& problem, const std::vector<double>& values)
{
  const BrakeModel model = problem.model_at(values);
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

/// Calls work(k) for this rank's share of so many samples, between requests to end. Returns the first that failed, on
/// every rank. Collective.
template <class Work> SampleFailure for_own(int count, MPI_Comm comm, Progress& progress, Work work)
{
  constexpr int between = 16;
  SampleFailure first;
  const int ranks = ranks_of(comm), rank = rank_of(comm);
  for (int step = 0; step * ranks < count; ++step)
  {
    if (step % between == 0) end_if_asked(comm);
    if (const int k = step * ranks + rank; k < count)
      if (const std::string error = error_of([&] { work(k); }); !error.empty() && first.reason.empty())
        first = {k, error};
    progress.update(std::min(count, (step + 1) * ranks), "");
  }
  return first_of_ranks(first, comm);
}

} // namespace

Robustness find_robustness(const RobustnessProblem& problem, MPI_Comm comm)
{
  Robustness result;
  std::optional<Sampler> sampler;
  try
  {
    on_every_rank(comm, [&] { sampler.emplace(problem); });
  }
  catch (const Error& error)
  {
    end_if_asked(comm); // an interruption on every rank is an error by now
    result.outcome = {OutcomeKind::refused, error.what(), 0, 0};
    return result;
  }
  for (std::vector<double>& values : random_values(problem, comm)) result.samples.push_back({std::move(values)});
  for (int k = 0; k < problem.settings.checks; ++k) result.checks.push_back({k});
  std::vector<UnstableMode> unstable;
  SampleFailure failed;
  {
    Progress progress(comm, "robustness", problem.settings.samples);
    failed = for_own(problem.settings.samples, comm, progress,
                     [&](int k) { sampler->evaluate(k, result.samples[static_cast<std::size_t>(k)], unstable); });
  }
  {
    Progress progress(comm, "robustness: checks", problem.settings.checks);
    const SampleFailure check_failed =
        for_own(problem.settings.checks, comm, progress,
                [&](int k)
                {
                  RobustCheck& check = result.checks[static_cast<std::size_t>(k)];
                  const auto& values = result.samples[static_cast<std::size_t>(k)].values;
                  compare(sampler->modes_of(sampler->matrices_at(values)), full_modes(problem, values), check);
                  check.known = true;
                });
    if (failed.reason.empty()) failed = check_failed;
  }
  share(result.samples, comm);
  share(result.checks, comm);
  share(unstable, comm);
  find_probabilities(result, unstable, sampler->reference().eigenvalues(), problem.settings.confidence);
  find_correlations(result, problem.numbers.size());
  result.trained = sampler->trained();
  result.basis = static_cast<int>(sampler->shapes());
  result.model_error = sampler->error();
  assess(result, failed);
  return result;
}

} // namespace squeal
