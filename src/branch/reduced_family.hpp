#pragma once
/// A brake at the values of a parameter p on the same shapes, as a family of flows (src/README.md, section 9.4).
///
/// Shapes, active pairs and the state (u0, r0) that motion is measured from are those of the scene's own p. What else
/// depends on p is sampled at Chebyshev points of the range and interpolated by one polynomial. Every rank does the
/// same by itself: flows of the family are not collective.
#include "brake_family.hpp"
#include "squeal/cycle/reduced_flow.hpp"
#include "squeal/modes/modes.hpp"

namespace squeal
{

/// What pairs have been seen to do. A pair that does one thing alone need not keep its contact.
struct PairsSeen
{
  std::vector<char> open, slipping, sticking; // by pairs

  void add(std::size_t pair, ContactStatus status);
  /// What is neither active nor sliding stays open.
  PairRoles roles(const std::vector<double>& reactions) const;
};

/// In the cycle, in the followed mode at `margin` times the cycle's fluctuation, and at rest.
PairsSeen pairs_seen_in(const BrakeBranchProblem& problem, double margin);

/// A reduced brake at one value: its model about u0 of the scene, and its state of rest.
struct ReducedBrake
{
  ReducedModel model;
  Eigen::VectorXd rest; // coordinates of its own equilibrium
  Eigen::VectorXd pull; // [N on the shapes] K u0
  double energy = 0;    // [J] of u0
};

class ReducedFamily
{
public:
  /// Samples the brakes of `full`, whose pairs were seen. Collective. Error: a value of the range has no equilibrium
  /// or no modes, or a shape no mass or stiffness.
  ReducedFamily(BrakeFamily& full, const BrakeBranchProblem& problem, const PairsSeen& seen);
  ReducedFamily(const ReducedFamily&) = delete;
  ReducedFamily& operator=(const ReducedFamily&) = delete;

  /// Borrows the object.
  FlowFamily flows();

  void set_parameter(double parameter);
  const ReducedModel& model() const { return own_; } // with its shapes, at the scene's own value
  double interpolation_error() const { return interpolation_error_; }

  /// The start of the branch: the full model's orbit on the shapes. Collective.
  Orbit reduced(const Orbit& orbit);
  /// A state (q, v) as one of the full model. Collective.
  Owned<Vec> lifted(const Eigen::VectorXd& state) const;

private:
  struct At // a value of the parameter
  {
    At(double value, ReducedBrake made, int steps, double theta);
    double parameter;
    ReducedBrake brake;
    ReducedMap map;
    Flow flow;
  };

  void check_shapes_fit(const Interface& other) const; // Error: they do not
  ReducedBrake sample(BrakeFamily& full, double parameter);
  ReducedBrake interpolated(double parameter);
  void take_samples(BrakeFamily& full);
  SlowMotions slow_motions(double period, Vec start);
  PointMeasures measure(const Orbit& orbit);

  const BrakeBranchProblem& problem_;
  double least_, greatest_;
  PairRoles roles_;
  int open_pairs_ = 0; // that stay open
  ReducedModel own_;
  EnergyMatrices energy_;
  Eigen::MatrixXd probes_; // on the shapes
  std::vector<double> nodes_;
  std::vector<ReducedBrake> samples_;
  double interpolation_error_ = 0;
  std::unique_ptr<At> at_;
  std::vector<StepRecord> recorded_;
  std::optional<ReducedMap> other_grid_; // of the recorded steps, where it is not the map's own
  MonodromyCorrection correction_;
};

} // namespace squeal
