#pragma once
/// Rayleigh damping that matrices have, whatever they were made from.
#include "squeal/base/petsc.hpp"

#include <optional>

namespace squeal
{

/// C = of_mass M + of_stiffness K
struct Rayleigh
{
  double of_mass = 0, of_stiffness = 0; // [1/s, s]
};

/// The sum that C is, by what the matrices make of two random vectors: another part of C would show in them. Nothing
/// where C is none to the rounding with which it is stored, or M and K are too alike to tell their parts. Collective.
std::optional<Rayleigh> rayleigh_part(Mat M, Mat C, Mat K);

} // namespace squeal
