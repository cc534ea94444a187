#pragma once
/// Points of a mesh: the element of a part that holds a point, and its natural coordinates there.
#include "squeal/mesh/shape_functions.hpp"

#include <memory>

namespace squeal
{

/// A point in an element.
struct Location
{
  int element = -1;                                   // index in Mesh::elements; -1: none
  Eigen::Vector3d xi = Eigen::Vector3d::Zero();       // [-] natural coordinates; of shells the first two
  double excess = std::numeric_limits<double>::max(); // [-] by which xi leaves the element, over its half width
};

/// Finds points in the elements of one part. Borrows the mesh.
class ElementLocator
{
public:
  ElementLocator(const Mesh& mesh, int part);
  ~ElementLocator();

  /// The element that `point` leaves least; points outside of every one have an excess above 0.
  Location find(const Vec3& point) const;

private:
  struct Tree; // of the elements' boxes, enlarged by half their size
  const Mesh& mesh_;
  std::unique_ptr<Tree> tree_;
};

/// The natural coordinates of a point of an element, which may be outside of it, by Newton's method. Of a shell those
/// of the nearest point of its surface.
Location located(const Mesh& mesh, int element, const Vec3& point);

/// How far the point that was located is outside of its element [m], from the natural coordinates nearest to its own.
double distance_outside(const Mesh& mesh, const Location& location);

} // namespace squeal
