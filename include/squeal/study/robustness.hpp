#pragma once
/// How likely modes are unstable where numbers of the scene are random (src/README.md, section 12). Samples are points
/// of a sweep, on one basis that they share (section 10.2), each checked by its residual in the full problem.
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

/// The mode of a sample with the greatest growth rate over |lambda|. The sample must have one.
const SweptMode& least_stable(const SweepPoint& sample);

/// A mode of the reference, where all numbers have their median, and the unstable modes of the samples that it is.
struct RobustMode
{
  int number = -1;             // of the reference; -1: it is like none of them
  std::complex<double> lambda; // of the reference [1/s]
  Probability unstable;
  std::vector<double> growth_rates; // [1/s] ascending, where it is unstable
  std::vector<double> frequencies;  // [Hz] ascending, likewise
};

/// outcome: "converged", "not converged" (samples failed: how many, the first reason), "off". residual: the largest
/// backward error. iterations: number of samples.
struct Robustness
{
  Outcome outcome;
  std::vector<SweepPoint> samples; // the track of a mode is its number in the reference
  std::vector<RobustMode> modes;   // those that are unstable in a sample, falling probability
  Probability any;                 // at least one unstable mode
  std::vector<double> correlation; // of each number with the largest growth ratio: Spearman's
  int basis = 0;                   // shapes in the end
};

/// By samples of the scene's random numbers, whose keys are those of the problem. Collective.
Robustness find_robustness(const RobustnessSettings& settings, const std::vector<UncertainNumber>& numbers,
                           SweepProblem problem, MPI_Comm comm);

} // namespace squeal
