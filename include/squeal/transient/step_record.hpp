#pragma once
/// What the tangent of a step needs to know of it (src/README.md, section 4.13). `advance` fills it where one is given.
#include "squeal/base/petsc.hpp"

#include <memory>
#include <vector>

namespace squeal
{

/// What of a step is recorded.
enum class Recorded
{
  contact,
  contact_and_rates, // the column of h needs the rates
};

class LinearContact;

/// The record of one step; that of a reduced model has the contact of its active pairs alone.
struct StepRecord
{
  Recorded wanted = Recorded::contact;

  // the same on every rank
  std::vector<double> reactions;        // [N] r+
  std::vector<double> contact_velocity; // [m/s] w = W r+ + b
  std::vector<char> opposes_theta;      // chi of each pair: 1 where friction opposes s_theta (section 4.3)

  // rates
  Owned<Vec> force;        // [N] M (v+ - v)/h - theta K (u+ - u)
  Owned<Vec> v_theta;      // [m/s]
  std::vector<double> gap; // [m] g0 + B_n u of each pair, on every rank

  mutable std::shared_ptr<const LinearContact> linear{}; // kept by rank 0 for the columns to come, where there is room
};

} // namespace squeal
