#pragma once
/// The shapes of a motion in time (src/README.md, section 7.10). Velocities v at equal steps are kept as
///     v = V q + what is left out,   V'M V = 1,   q = V'M v,   so that the kinetic energy of V q is q'q/2.
/// V grows by what it misses of a sample. At the end it is turned to the principal axes of the samples, and those of
/// little energy are left out.
#include "squeal/algebra/multivector.hpp"
#include "squeal/base/petsc.hpp"

#include <vector>

namespace squeal
{

/// Samples of a velocity on few shapes.
struct MotionShapes
{
  MultiVector V;                                // [kg^-1/2]
  std::vector<std::vector<double>> coordinates; // [shape][sample] q [m/s kg^1/2]
  std::vector<double> squares;                  // v'Mv of each sample [J]
  double largest = 0;                           // of those, whose V is to be met [J]
  double left_out = 0;                          // part of the kinetic energy that the shapes miss
};

/// No sample yet; vectors are distributed as the columns of M.
MotionShapes no_shapes(Mat M);

/// The number of steps between samples. It is a divisor of `steps`, the largest one by which samples are not slower
/// than 96 kHz, nearly five times what is heard.
int steps_between_samples(int steps, double step_size);

/// Appends a sample. V gains a shape where it misses 2e-3 of the largest velocity seen, up to `most` shapes.
/// Collective.
void add_sample(MotionShapes& motion, Mat M, Vec v, Vec Mv, PetscInt most);

/// Turns the shapes to the principal axes of the samples from `first` on, the strongest first. Those of least energy go
/// that hold 1e-6 of it together. Collective.
void keep_strongest(MotionShapes& motion, std::size_t first);

} // namespace squeal
