#pragma once
/// The period maps of a brake at the values of a parameter, as a family of flows.
#include "squeal/branch/brake_branch.hpp"
#include "squeal/cycle/period_map.hpp"

#include <memory>

namespace squeal
{

/// Adds the counts of a period, from the statuses of the pairs at its steps.
void count_statuses(const std::vector<std::vector<ContactStatus>>& statuses, PointMeasures& measures);

/// column = dPhi_period(start)/dparameter by a central difference, where `range` is that of the parameter.
void difference_column(const FlowFamily& family, double parameter, double range, double period, Vec start, Vec column);

/// The brake at a value of the parameter.
struct BrakeAt
{
  BrakeAt(double value, BrakeModel made, const BrakeBranchProblem& problem);

  double parameter;
  BrakeModel model;
  Equilibrium equilibrium{};
  bool equilibrium_known = false;
  PeriodMap map;
  Flow flow; // of the map
};

class BrakeFamily
{
public:
  explicit BrakeFamily(const BrakeBranchProblem& problem);
  BrakeFamily(const BrakeFamily&) = delete;
  BrakeFamily& operator=(const BrakeFamily&) = delete;

  /// Borrows the object.
  FlowFamily flows();

  void set_parameter(double parameter);
  SlidingEquilibrium sliding(); // at the value set last; finds its equilibrium
  /// The next period starts from the reactions at rest: those of another value would stick or slide at once.
  void start_from_rest();
  MeasuredPeriod measured_period(double period, Vec start);
  Owned<Vec> rest();

private:
  void parameter_column(double period, Vec start, Vec column);
  PointMeasures measure(const Orbit& orbit);

  const BrakeBranchProblem& problem_;
  bool friction_; // the parameter is the friction coefficient
  double range_;
  std::unique_ptr<BrakeAt> at_;
};

} // namespace squeal
