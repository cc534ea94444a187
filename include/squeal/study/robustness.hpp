#pragma once
/// How likely modes are unstable where numbers of the scene are random (src/README.md, section 12). Samples are points
/// of a sweep, on one basis that they share (section 10.2). Full models of some are the check.
#include "squeal/study/sweep.hpp"

namespace squeal
{

/// `lower`, `upper`: the interval of Clopper and Pearson at the confidence asked for.
struct Probability
{
  int count = 0, samples = 0;
  double lower = 0, upper = 1;

  double estimate() const { return samples > 0 ? static_cast<double>(count) / samples : 0; }
};

/// The probability of an event that `count` of the samples show. Arithmetic of one rank.
Probability probability_of(int count, int samples, double confidence);

/// Of all samples. growth_rate, frequency_hz and mode are of the mode with the greatest growth rate over |lambda|.
struct RobustSample
{
  std::vector<double> values; // of the random numbers
  bool known = false;         // there is an equilibrium
  int closed = 0;             // pairs
  int unstable = 0;           // modes in the band
  double growth_rate = 0;     // [1/s] 0 without a mode in the band
  double frequency_hz = 0;
  int mode = -1; // which mode of the reference it is, if it is unstable
};

/// A mode of the reference, where all numbers have their median, and the unstable modes of the samples that it is.
struct RobustMode
{
  int number = -1;             // of the reference; -1: it is like none of them
  std::complex<double> lambda; // of the reference [1/s]
  Probability unstable;
  std::vector<double> growth_rates; // [1/s] ascending, where it is unstable
  std::vector<double> frequencies;  // [Hz] ascending, likewise
};

/// A sample computed by the full problem as well. Errors are over |lambda|, at the unstable modes of either side.
struct RobustCheck
{
  int sample = 0;
  bool known = false; // the full problem converged
  int unstable = 0, unstable_reduced = 0;
  double growth_error = 0, frequency_error = 0;
};

/// outcome: "converged", "not converged" (samples or checks failed: how many, the first reason), "off". residual: the
/// largest growth error. iterations: number of samples.
struct Robustness
{
  Outcome outcome;
  std::vector<RobustSample> samples;
  std::vector<RobustMode> modes; // those that are unstable in a sample, falling probability
  Probability any;               // at least one unstable mode
  std::vector<RobustCheck> checks;
  std::vector<double> correlation; // of each number with the largest growth ratio: Spearman's
  int basis = 0;                   // shapes in the end
};

/// The scene's random numbers and how a sample is computed.
struct RobustnessProblem
{
  const RobustnessSettings& settings;
  const std::vector<UncertainNumber>& numbers;
  std::function<BrakeModel(std::span<const double> values, MPI_Comm comm)> model_at; // on MPI_COMM_SELF
  const ModesSettings& modes;
  const ModesOptions& modes_options;
  const EquilibriumOptions& equilibrium_options;
  double accuracy = 0; // of growth rates over |lambda|, as a part of their scatter
};

/// Every rank computes samples of its own. Collective.
Robustness find_robustness(const RobustnessProblem& problem, MPI_Comm comm);

} // namespace squeal
