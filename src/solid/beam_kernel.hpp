#pragma once
/// Kernel of a straight beam.
#include "squeal/solid/element.hpp"

namespace squeal
{

struct BeamSection
{
  double young = 0, shear = 0;         // [Pa] moduli
  double density = 0;                  // [kg/m3]
  double area = 0;                     // [m2]
  double bending_2 = 0, bending_3 = 0; // [m4] second moments, for bending along axis 2 and along axis 3
  double torsion = 0;                  // [m4]
  double shear_factor = 0;             // [-] area of shear over area; 0: rigid
};

BeamSection section_of(const Beam& beam);

/// Returns the matrices of a beam from a to b on x y z rx ry rz of both. `axis_2` lies across it; zero: any.
ElementMatrices beam_matrices(const Vec3& a, const Vec3& b, const Vec3& axis_2, const BeamSection& section);

} // namespace squeal
