#pragma once
/// Integrals over the part of a slave face that master faces cover (src/README.md, section 1.9).
#include "squeal/mesh/shape_functions.hpp"

namespace squeal
{

using FaceValues = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 8, 1>;
using FaceMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 8, 8>;

/// The multipliers' functions chi from the shape functions of a face: chi = phi for linear faces. For quadratic ones a
/// corner takes a quarter of its two mid-sides, and a mid-side keeps half. They are not negative on triangles, and
/// their integrals are positive.
FaceValues multiplier_functions(Shape shape, const FaceValues& N);

/// A face with its nodes and what stands of it beside the plane through its corners.
struct PlacedFace
{
  Shape shape{};
  NodePositions x;                                  // [m]
  Eigen::Vector3d normal = Eigen::Vector3d::Zero(); // [-] outward, mean over the face
  double slack = 0;       // [m] how far the face may stand off the curved surface for which it stands
  bool two_sided = false; // a shell's
};

/// The part of one slave face that master faces cover. Functions chi are the slave's, N the master's.
struct CoveredFace
{
  struct Master
  {
    int face = 0;        // index among the candidates' faces
    FaceMatrix coupling; // [m2] int chi_i N_j
  };
  FaceValues whole, area; // [m2] int chi_i over the whole face and over the covered part
  FaceMatrix gram;        // [m2] int chi_i chi_j over the covered part
  std::vector<Master> masters;
};

/// Overlaps that were left out, or contain each other. Places are on the slave face.
struct OverlapFindings
{
  double nearest = 0; // [m] gap of the nearest one beyond the limit, negative inside; 0: none
  Vec3 nearest_at{};
  double deepest = 0; // [m] largest depth of one surface in the other; 0: none
  Vec3 deepest_at{};
  bool same_way = false; // faces within the limit whose normals do not oppose each other
  Vec3 same_way_at{};
};

/// How slave and master faces are compared.
struct OverlapLimits
{
  double distance = 0;   // [m] largest gap
  double rounding = 0;   // [m] depth, or with `closes` gap, that is no more than rounding
  bool closes = false;   // surfaces that should coincide: the faces' slacks limit the gap, not the distance
  Eigen::Vector3d along; // [-] out of the slave; zero: along the normal of the slave face
  double search = 0;     // [m] faces farther than the limits are looked at too up to here, for the findings
};

/// Returns the integrals over the overlaps with these candidates, an index in `masters` each.
CoveredFace cover_face(const PlacedFace& slave, std::span<const PlacedFace> masters, std::span<const int> candidates,
                       const OverlapLimits& limits, OverlapFindings& findings);

} // namespace squeal
