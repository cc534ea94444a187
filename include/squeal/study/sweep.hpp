#pragma once
/// Stability of sliding at many values of numbers of the scene, with the modes followed from value to value
/// (src/README.md, section 10).
#include "squeal/modes/modes.hpp"

#include <functional>

namespace squeal
{

/// A mode at a point. Its track is the same number at every point along a line where it could be followed. At design
/// points it is that of the mode of the first point that it shares most with.
struct SweptMode
{
  std::complex<double> lambda; // [1/s]
  double backward_error = 0;   // the larger one of the right and of the left vector
  int track = -1;              // -1: not followed
  double mac = 1;              // with the mode of this track at the point before; 1 at the first
  int subspace = 1;            // number of modes that were followed together, whose subspace has this MAC
};

/// Where a sweep is: the values of its numbers, and whether the rotation is reversed.
struct SweptPlace
{
  std::vector<double> values{};
  bool reversed = false;

  auto operator<=>(const SweptPlace&) const = default;
};

/// Turns round the drive of the contacts, and the G that rotation brings.
void reverse_rotation(Structure& structure, Interface& interface);

/// outcome: that of the stage that ended the point: "converged", or what failed and why.
struct SweepPoint : SweptPlace
{
  bool inserted = false; // between points of the scene: modes were unclear, or pairs open or close
  Outcome outcome;
  int closed = 0;               // pairs
  int unstable = 0;             // modes in the band
  std::vector<SweptMode> modes; // in the band, falling growth rate
};

/// Where the growth rate of a followed mode passes zero along the first number.
struct Threshold : SweptPlace
{
  int track = 0;
  double error = 0;        // of the first value
  double frequency_hz = 0; // of the mode there
  int change = 0;          // of the number of unstable modes as the value rises
};

/// outcome: "converged", "not converged" (points failed: how many, the first reason), "refused", "skipped",
/// "off".
/// residual: the largest backward error. iterations: number of points.
struct Sweep
{
  Outcome outcome;
  std::vector<SweepPoint> points; // line by line, along the first number
  std::vector<Threshold> thresholds;
  int tracks = 0;              // number of followed modes
  int lost = 0;                // modes in the band that could not be followed to the next point
  int cut_short = 0;           // steps between points of the scene that needed more points in between than allowed
  double least_mac = 1;        // along all tracks, where the same pairs are closed or modes change little
  double least_mac_across = 1; // of modes that jump where pairs open or close
  int basis = 0;               // shapes of the basis in the end
  int passes = 0;              // corrections of the basis by residuals
};

/// The points to visit and how each is computed.
struct SweepProblem
{
  SweepSettings settings;
  std::function<Model(std::span<const double> values)> model_at;
  const ModesSettings& modes;
  const ModesOptions& modes_options;
  const EquilibriumOptions& equilibrium_options;
  const char* name = "sweep"; // in progress
};

/// Visits all points, follows the modes along each line and finds the thresholds on the way. A point that fails is
/// recorded with its reason. Collective.
Sweep run_sweep(const SweepProblem& problem, MPI_Comm comm);

} // namespace squeal
