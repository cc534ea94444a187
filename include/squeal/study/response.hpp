#pragma once
/// Frequency responses about steady sliding (src/README.md, section 13): displacements at probes under a harmonic unit
/// force at a probe, along its direction. With p_i the row of probe i and Q of section 13,
///     H_ji(omega) = p_j'Z q_i,     Q(omega) q_i = Y'p_i.
///
/// All frequencies are solved on one basis, that of modes (section 10.2). Residuals of the full problem and of its
/// transpose extend it. The error of H is the product of both.
/// Where modes are unstable, H is formal: no vibration settles on it.
#include "squeal/modes/modes.hpp"

#include <complex>
#include <vector>

namespace squeal
{

/// outcome: "converged", "not converged" (a residual stays above the tolerance), "skipped", "off".
/// residual: the largest geometric mean of |Q q_i - Y'p_i| and its like of the transposed problem, for unit forces.
struct Response
{
  Outcome outcome;
  std::vector<double> frequency_hz;                                       // ascending
  std::vector<int> excitations;                                           // the probes that are driven
  std::vector<std::vector<std::vector<std::complex<double>>>> receptance; // [m/N] [excitation][probe][frequency]
  double change = 0; // of H by the last extension of the basis: over |H|, or 1e-4 of the largest |H| at the frequency
  int shapes = 0;    // of the basis
};

/// Options -response_...
struct ResponseOptions
{
  double tolerance = 1e-5; // of the geometric mean of both residuals, over a unit force
  int passes = 40;         // corrections of the basis, at most
};

/// The probes that are driven and read, and the frequencies.
struct ResponseProblem
{
  SlidingEquilibrium sliding;
  Mat probes = nullptr;         // a row a probe
  std::vector<int> excitations; // their rows
  std::vector<double> frequency_hz;
  const ResponseOptions& options;
  const ModesOptions& modes_options;
};

/// Responses of all probes to every excitation. Collective. Error: memory runs out.
Response find_response(const ResponseProblem& problem);

} // namespace squeal
