#pragma once
/// How a cycle is sought, and how the reduced model serves.
#include "squeal/shooting/options.hpp"

namespace squeal
{

/// Choices of the cycle.
struct CycleOptions
{
  ShootingOptions shooting;
  double band_factor = 3; // the preconditioner's modes reach this many times the mode's frequency; 0: none
  PetscInt samples = 32;  // displacements kept over the last period
  PetscInt reduced_modes =
      100000; // complex modes of a reduced model at most, the nearest in frequency to the followed one
};

} // namespace squeal
