#pragma once
/// The derivative of the reduced period map (src/README.md, sections 4.13 and 7.5). Functions that take a map are
/// collective among its ranks.
#include "squeal/reduction/reduced_step.hpp"
#include "squeal/transient/step_record.hpp"

#include <span>

namespace squeal
{

/// The contact of each step of a period.
std::vector<StepRecord> record_contacts(ReducedMap& map, double period, ReducedState state);

/// The same of the full model's recorded steps, as the reduced model sees them.
std::vector<StepRecord> recorded_contacts(const ReducedModel& model, int directions,
                                          std::span<const StepRecord> records);

/// Columns of changes of the start, (q, v), to those of the period's end: the product of the steps' own tangents on the
/// recorded contact. Each rank does its share of the columns.
Eigen::MatrixXd apply_tangent(ReducedMap& map, double period, std::span<const StepRecord> contacts,
                              const Eigen::MatrixXd& columns);

/// Columns x to (dPhi/dx)'x.
Eigen::MatrixXd apply_adjoint(ReducedMap& map, double period, std::span<const StepRecord> contacts,
                              const Eigen::MatrixXd& columns);

/// The derivative of a period's end (q, v) in the coordinates q and v of the slow shapes.
Eigen::MatrixXd monodromy(ReducedMap& map, double period, std::span<const StepRecord> contacts);

} // namespace squeal
