#pragma once
/// How a cycle is sought, and how the reduced model serves.
#include "squeal/shooting/options.hpp"

namespace squeal
{

/// Choices of the cycle.
struct CycleOptions
{
  ShootingOptions shooting;
  PetscInt samples = 32; // displacements kept over the last period
  PetscInt reduced_modes =
      100000; // complex modes of a reduced model at most, the nearest in frequency to the followed one
};

} // namespace squeal
