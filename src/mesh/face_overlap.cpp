/// Overlaps of faces: both are projected onto the mean plane of the slave face, or along a given direction. The polygon
/// of the slave's corners is clipped by that of the master's (Sutherland and Hodgman 1974) and cut into triangles. At
/// each of their Gauss points Newton's method finds the natural coordinates on both faces.
///
/// Caveat: polygons join corners, so sides that are curved in the plane are taken as straight.
#include "face_overlap.hpp"

#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace squeal
{

namespace
{

using PlanePoint = Eigen::Vector2d;
using Polygon = std::vector<PlanePoint>;

constexpr double facing = 0.2;        // cosine: faces steeper than 78 degrees to each other do not press on each other
constexpr double least_share = 1e-10; // of the slave face's area: smaller overlaps are rounding

/// Two axes of a plane and its normal, as rows.
Eigen::Matrix3d frame_of(const Eigen::Vector3d& normal)
{
  Eigen::Index least = 0;
  normal.cwiseAbs().minCoeff(&least);
  const Eigen::Vector3d first = Eigen::Vector3d::Unit(least).cross(normal).normalized();
  Eigen::Matrix3d frame;
  frame << first.transpose(), normal.cross(first).transpose(), normal.transpose();
  return frame;
}

/// Twice the area, positive if counter-clockwise.
double twice_area(const Polygon& polygon)
{
  double sum = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i)
  {
    const PlanePoint &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    sum += (a(0) - polygon[0](0)) * (b(1) - polygon[0](1)) - (a(1) - polygon[0](1)) * (b(0) - polygon[0](0));
  }
  return sum;
}

/// The corners of a face in the plane, counter-clockwise.
Polygon corners_of(Shape shape, const NodePositions& x)
{
  Polygon polygon;
  for (int i = 0; i < corner_count(shape); ++i) polygon.emplace_back(x.col(i).head<2>());
  if (twice_area(polygon) < 0) std::reverse(polygon.begin(), polygon.end());
  return polygon;
}

/// The part of `polygon` on the left of every side of `window`; both are convex and counter-clockwise.
Polygon clip(Polygon polygon, const Polygon& window)
{
  Polygon kept;
  std::vector<double> left;
  for (std::size_t k = 0; k < window.size() && !polygon.empty(); ++k)
  {
    const PlanePoint &a = window[k], side = window[(k + 1) % window.size()] - a;
    left.clear();
    for (const PlanePoint& p : polygon) left.push_back(side(0) * (p(1) - a(1)) - side(1) * (p(0) - a(0)));
    kept.clear();
    for (std::size_t i = 0; i < polygon.size(); ++i)
    {
      const std::size_t j = (i + 1) % polygon.size();
      if (left[i] >= 0) kept.push_back(polygon[i]);
      if (left[i] * left[j] < 0) kept.push_back(polygon[i] + left[i] / (left[i] - left[j]) * (polygon[j] - polygon[i]));
    }
    polygon.swap(kept);
  }
  return polygon;
}

/// The shape functions of a face at a point of the plane.
ShapeFunctions functions_at(Shape shape, const NodePositions& x, const PlanePoint& point, double size)
{
  constexpr double rounding = 1e-15;
  constexpr int most = 20; // three are enough on any face without a corner of 180 degrees
  Eigen::Vector3d xi = Eigen::Vector3d::Zero();
  if (corner_count(shape) == 3) xi.head<2>().setConstant(1. / 3);
  ShapeFunctions at = shape_functions(shape, xi);
  for (int i = 0; i < most; ++i)
  {
    const PlanePoint off = x.topRows<2>() * at.N - point;
    if (off.norm() <= rounding * size) break;
    const Eigen::Matrix2d J = x.topRows<2>() * at.dN.topRows<2>().transpose();
    xi.head<2>() -= J.inverse() * off;
    at = shape_functions(shape, xi);
  }
  return at;
}

/// A slave face in its plane.
struct SlaveInPlane
{
  const PlacedFace& face;
  Eigen::Vector3d origin, normal; // normal: out of the slave, square to the plane
  Eigen::Matrix3d frame;
  NodePositions x; // in the frame, from the origin
  Polygon corners;
  double stretch = 1; // area of the face over that of its projection
  double size = 0;    // [m]

  NodePositions in_frame(const NodePositions& nodes) const { return frame * (nodes.colwise() - origin); }
};

SlaveInPlane in_plane(const PlacedFace& face, const Eigen::Vector3d& along)
{
  SlaveInPlane slave{face, face.x.col(0), face.normal, {}, {}, {}, 1, 0};
  if (!along.isZero())
  {
    slave.normal = along;
    slave.stretch = 1 / std::max(std::abs(along.dot(face.normal)), facing);
  }
  slave.frame = frame_of(slave.normal);
  slave.x = slave.in_frame(face.x);
  slave.corners = corners_of(face.shape, slave.x);
  slave.size = slave.x.topRows<2>().colwise().norm().maxCoeff();
  return slave;
}

/// Calls visit(point, weight [m2], slave's functions) at the Gauss points of the triangles of a polygon.
template <class Visit> void for_each_point(const SlaveInPlane& slave, const Polygon& polygon, Visit visit)
{
  for (std::size_t k = 1; k + 1 < polygon.size(); ++k)
  {
    const Polygon triangle{polygon[0], polygon[k], polygon[k + 1]};
    const double jacobian = slave.stretch * twice_area(triangle);
    for (const auto& [xi, weight, corner] : triangle_rule())
    {
      const PlanePoint point = corner.N(0) * triangle[0] + corner.N(1) * triangle[1] + corner.N(2) * triangle[2];
      visit(point, weight * jacobian, functions_at(slave.face.shape, slave.x, point, slave.size).N);
    }
  }
}

/// Integrals over one overlap.
struct Overlap
{
  FaceValues area;
  FaceMatrix gram, coupling;
  double least_gap = 0, nearest_gap = 0; // [m] at the Gauss points; the latter of least modulus
  PlanePoint at;                         // of the least gap
};

Overlap integrate(const SlaveInPlane& slave, const PlacedFace& master, const NodePositions& x, const Polygon& polygon)
{
  const auto ns = slave.x.cols(), nm = x.cols();
  Overlap overlap{FaceValues::Zero(ns), FaceMatrix::Zero(ns, ns), FaceMatrix::Zero(ns, nm), 1e300, 1e300, {}};
  const auto add = [&](const PlanePoint& point, double w, const FaceValues& phi)
  {
    const FaceValues N = functions_at(master.shape, x, point, slave.size).N;
    const FaceValues chi = multiplier_factors(slave.face.shape) * phi;
    const double gap = x.row(2).dot(N.transpose()) - slave.x.row(2).dot(phi.transpose());
    overlap.area += w * chi;
    overlap.gram += w * chi * chi.transpose();
    overlap.coupling += w * chi * N.transpose();
    if (std::abs(gap) < std::abs(overlap.nearest_gap)) overlap.nearest_gap = gap;
    if (gap < overlap.least_gap) overlap.least_gap = gap, overlap.at = point;
  };
  for_each_point(slave, polygon, add);
  return overlap;
}

/// int chi over the polygon of the slave's corners.
FaceValues whole_area(const SlaveInPlane& slave)
{
  FaceValues sum = FaceValues::Zero(slave.x.cols());
  for_each_point(slave, slave.corners, [&](const PlanePoint&, double w, const FaceValues& phi) { sum += w * phi; });
  return multiplier_factors(slave.face.shape) * sum;
}

Vec3 place_of(const SlaveInPlane& slave, const PlanePoint& at)
{
  const Eigen::Vector3d place = slave.origin + slave.frame.topRows<2>().transpose() * at;
  return {place(0), place(1), place(2)};
}

/// Whether the overlap is part of the contact; if not, the findings say why.
bool is_within(const Overlap& overlap, const SlaveInPlane& slave, double slack, const OverlapLimits& limits,
               OverlapFindings& findings)
{
  const double distance = std::abs(overlap.nearest_gap);
  if (distance > (limits.closes ? slack : limits.distance))
  {
    if (findings.nearest == 0 || distance < std::abs(findings.nearest))
      findings.nearest = overlap.nearest_gap, findings.nearest_at = place_of(slave, overlap.at);
    return false;
  }
  if (!limits.closes && -overlap.least_gap > std::max(slack, findings.deepest))
    findings.deepest = -overlap.least_gap, findings.deepest_at = place_of(slave, overlap.at);
  return true;
}

/// Whether the faces look at each other. Where they look the same way from one place the findings say so.
bool oppose(const SlaveInPlane& slave, const PlacedFace& master, const NodePositions& x, double most,
            OverlapFindings& findings)
{
  const double own = slave.face.two_sided ? 1 : slave.face.normal.dot(slave.normal);
  const double cosine = master.normal.dot(slave.normal);
  const bool turned = own < facing || (!master.two_sided && cosine > facing);
  if (turned && std::abs(x.row(2).mean() - slave.x.row(2).mean()) <= most)
    findings.same_way = true, findings.same_way_at = place_of(slave, slave.x.col(0).head<2>());
  return own >= facing && (master.two_sided ? std::abs(cosine) > facing : cosine < -facing);
}

} // namespace

/// A Bernstein polynomial of degree 2 at a node is a chance. Two corners are drawn from those around the node; the
/// polynomial's node is in their middle.
const FaceMatrix& multiplier_factors(Shape shape)
{
  static const auto all = []
  {
    std::map<Shape, FaceMatrix> result;
    for (const Shape face : {Shape::triangle3, Shape::quad4, Shape::triangle6, Shape::quad8, Shape::quad9})
    {
      const std::vector<Eigen::Vector3d> places = natural_positions(face);
      std::vector<std::vector<int>> corners;
      for (int i = 0; i < corner_count(face); ++i) corners.push_back({i});
      corners.insert(corners.end(), middles_of(face).begin(), middles_of(face).end());
      FaceMatrix& T = result[face].setZero(node_count(face), node_count(face));
      for (std::size_t j = 0; j < places.size(); ++j)
        for (const int a : corners[j])
          for (const int b : corners[j])
            T(std::ranges::find(places, Eigen::Vector3d((places[a] + places[b]) / 2)) - places.begin(), j) +=
                1. / static_cast<double>(corners[j].size() * corners[j].size());
    }
    return result;
  }();
  return all.at(shape);
}

CoveredFace cover_face(const PlacedFace& face, std::span<const PlacedFace> masters, std::span<const int> candidates,
                       const OverlapLimits& limits, OverlapFindings& findings)
{
  const SlaveInPlane slave = in_plane(face, limits.along);
  const auto n = face.x.cols();
  CoveredFace covered{whole_area(slave), FaceValues::Zero(n), FaceMatrix::Zero(n, n), {}};
  const double area = twice_area(slave.corners);
  for (const int candidate : candidates)
  {
    const PlacedFace& master = masters[static_cast<std::size_t>(candidate)];
    const NodePositions x = slave.in_frame(master.x);
    const Polygon polygon = clip(slave.corners, corners_of(master.shape, x));
    if (polygon.size() < 3 || twice_area(polygon) < least_share * area) continue;
    const double slack = limits.rounding + slave.face.slack + master.slack;
    if (!oppose(slave, master, x, std::max(limits.search, limits.closes ? slack : limits.distance), findings)) continue;
    const Overlap overlap = integrate(slave, master, x, polygon);
    if (!is_within(overlap, slave, slack, limits, findings)) continue;
    covered.area += overlap.area;
    covered.gram += overlap.gram;
    covered.masters.push_back({candidate, overlap.coupling});
  }
  return covered;
}

} // namespace squeal
