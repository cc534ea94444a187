#pragma once
/// The reduced model as a flow for shooting (src/README.md, sections 7.5 and 7.6). Its monodromy matrix gives the
/// approximate inverse of a period map's dPhi_T/dx - I.
#include "squeal/reduction/reduced_step.hpp"
#include "squeal/shooting/flow.hpp"

#include <complex>

namespace squeal
{

/// Between motions (du, v) of the full model and their coordinates (q, v) in a reduced one. Functions are collective.
struct ReducedCoordinates
{
  const ReducedModel& model;
  const Structure& structure;

  Eigen::VectorXd of(Vec motion) const;
  void add(const Eigen::VectorXd& coordinates, Vec motion) const; // the motion that has these
};

/// New motions like `pattern` with these columns of coordinates.
std::vector<Owned<Vec>> motions_of(const ReducedCoordinates& coordinates, const Eigen::MatrixXd& columns, Vec pattern);

/// The reduced model's motions (du, v) as a flow on those of the full model. Borrows both.
Flow flow_of(ReducedMap& map, const Structure& structure);

/// D = (dPhi_r/dx S S' - f f^+ - I)^-1 + I at a state of the reduced model, as left x right. f is the flow, along which
/// the border of the shooting decides. S are the coordinates of the slow shapes, since motion in the others is damped
/// out within a period.
struct MonodromyCorrection
{
  Eigen::MatrixXd left, right;
};

/// Collective among the map's ranks.
MonodromyCorrection monodromy_correction(ReducedMap& map, double period, const ReducedState& state);

/// From the columns of a monodromy matrix along the slow coordinates of q and of v, and the flow.
MonodromyCorrection monodromy_correction(const ReducedModel& model, const Eigen::MatrixXd& columns,
                                         const ReducedState& flow);

/// P^-1 x = -x + V D R x: R takes the coordinates, V gives their motion. What they miss is taken as damped out within a
/// period. Borrows D.
Preconditioner preconditioner_of(const MonodromyCorrection& correction, const ReducedCoordinates& coordinates);

// Largest multipliers of a reduced model's monodromy matrix on recorded contact, with right and left vectors
// (src/README.md, sections 6.9 and 7.5). The same on every rank.

struct ReducedSpectrum
{
  std::vector<std::complex<double>> values; // largest first, complex pairs whole
  Eigen::MatrixXd right, left;              // orthonormal bases of the right and left vectors' spans, (q, v)
  Eigen::MatrixXd columns;                  // of the monodromy matrix, along the slow coordinates of q and of v
  std::vector<std::complex<double>> known;  // all values above 1/2, of which `values` are the first
  Eigen::MatrixXd known_right, known_left;  // bases of their vectors' spans; left ones along the slow coordinates
};

/// The multipliers above 0.85, 4 at least and 24 at most, on whose vectors the full model is projected. Each costs a
/// product with its tangent, and a search bounds the rest. Collective among the map's ranks.
ReducedSpectrum large_multipliers(ReducedMap& map, double period, std::span<const StepRecord> contacts);

/// The values of the spectrum, their vectors and the resolvent for motions that have these coordinates in the
/// model.
SlowMotions slow_motions_of(const ReducedSpectrum& spectrum, const ReducedModel& model,
                            const ReducedCoordinates& coordinates, Vec pattern);

/// Takes from a motion its part along the vectors of all values above 1/2: x - R (L'R)^-1 L'x.
std::function<void(Vec motion)> taking_out_known(const ReducedSpectrum& spectrum,
                                                 const ReducedCoordinates& coordinates);

/// Adds to the errors and rises of the slow motions a part of what the moduli change by: `others` are the values on
/// another grid of time.
void add_changes(const std::vector<std::complex<double>>& others, double part, SlowMotions& slow);

/// The multipliers that these vectors give on other contact or with other steps: eigenvalues of (L'R)^-1 L'Phi R, in
/// the order of the spectrum's values. Collective among the map's ranks.
std::vector<std::complex<double>> multipliers_along(const ReducedSpectrum& spectrum, ReducedMap& map, double period,
                                                    std::span<const StepRecord> contacts);

} // namespace squeal
