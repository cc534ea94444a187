/// Newton's method on x(xi) = p; on shells on the least distance, which leaves p's part along the normal. The excess is
/// how far xi leaves the element in units of half its width; on a shell the distance from its surface counts as well.
#include "location.hpp"

#include "squeal/mesh/shapes.hpp"

#include <algorithm>
#include <boost/geometry.hpp>
#include <boost/geometry/index/rtree.hpp>
#include <cmath>

namespace squeal
{

namespace
{

namespace geometry = boost::geometry;
using Corner = geometry::model::point<double, 3, geometry::cs::cartesian>;
using Box = geometry::model::box<Corner>;

double diagonal(const NodePositions& x)
{
  return (x.rowwise().maxCoeff() - x.rowwise().minCoeff()).norm();
}

/// The box round an element, enlarged by so much of its diagonal.
Box box_of(const Mesh& mesh, const Element& element, double margin)
{
  const NodePositions x = position_matrix(positions_of(mesh, element));
  const double more = margin * diagonal(x);
  const Eigen::Vector3d low = x.rowwise().minCoeff().array() - more, high = x.rowwise().maxCoeff().array() + more;
  return {Corner(low(0), low(1), low(2)), Corner(high(0), high(1), high(2))};
}

/// Natural coordinates: first those of a simplex, from 0 on with a sum of at most 1, then those of a box, within 1.
struct Axes
{
  Eigen::Index simplex, box;
};

Axes axes_of(Shape shape)
{
  switch (shape)
  {
  case Shape::tet4:
  case Shape::tet10:
    return {3, 0};
  case Shape::wedge6:
    return {2, 1};
  case Shape::shell4:
    return {0, 2};
  case Shape::shell3:
    return {2, 0};
  default:
    return {0, 3};
  }
}

/// The smallest barycentric coordinate of a simplex may be negative; along an axis of the box |xi| may exceed 1.
double excess_of(Shape shape, const Eigen::Vector3d& xi)
{
  const auto [simplex, box] = axes_of(shape);
  double excess = -1;
  if (simplex > 0) excess = -2 * std::min(xi.head(simplex).minCoeff(), 1 - xi.head(simplex).sum());
  return box > 0 ? std::max(excess, xi.segment(simplex, box).cwiseAbs().maxCoeff() - 1) : excess;
}

/// The natural coordinates of the element that are nearest to these.
Eigen::Vector3d inside(Shape shape, const Eigen::Vector3d& xi)
{
  const auto [simplex, box] = axes_of(shape);
  Eigen::Vector3d result = xi;
  result.head(simplex) = xi.head(simplex).cwiseMax(0);
  result.head(simplex) /= std::max(1., result.head(simplex).sum());
  result.segment(simplex, box) = xi.segment(simplex, box).cwiseMax(-1).cwiseMin(1);
  return result;
}

} // namespace

Location located(const Mesh& mesh, int element, const Vec3& point)
{
  constexpr int most = 20;       // Newton steps; a mildly distorted brick takes 3 to 5
  constexpr double near = 1e-13; // [-] last step
  const Element& of = mesh.elements[static_cast<std::size_t>(element)];
  const NodePositions x = position_matrix(positions_of(mesh, of));
  const Eigen::Vector3d p(point[0], point[1], point[2]);
  const Eigen::Index axes = is_shell(of.shape) ? 2 : 3;
  Location at{element, Eigen::Vector3d::Zero(), 0};
  const Eigen::Index simplex = axes_of(of.shape).simplex;
  at.xi.head(simplex).setConstant(1. / static_cast<double>(simplex + 1));
  double away = 0; // [m] of a shell's surface
  for (int i = 0; i < most; ++i)
  {
    const ShapeFunctions N = shape_functions(of.shape, at.xi);
    const Eigen::Vector3d missing = p - x * N.N;
    const Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3> J = x * N.dN.topRows(axes).transpose();
    const Eigen::VectorXd step = J.colPivHouseholderQr().solve(missing);
    // a step of more than a whole element's width would leave where the map is one to one
    at.xi.head(axes) += step * std::min(1., 2 / std::max(step.norm(), 1e-300));
    away = (missing - J * step).norm();
    if (!(step.norm() > near)) break;
  }
  at.excess = excess_of(of.shape, at.xi);
  if (axes == 2) at.excess = std::max(at.excess, 2 * away / diagonal(x));
  if (!std::isfinite(at.excess)) at.excess = std::numeric_limits<double>::max();
  return at;
}

double distance_outside(const Mesh& mesh, const Location& location)
{
  const Element& element = mesh.elements[static_cast<std::size_t>(location.element)];
  const NodePositions x = position_matrix(positions_of(mesh, element));
  return (x * shape_functions(element.shape, location.xi).N -
          x * shape_functions(element.shape, inside(element.shape, location.xi)).N)
      .norm();
}

struct ElementLocator::Tree
{
  geometry::index::rtree<std::pair<Box, int>, geometry::index::quadratic<16>> boxes;
};

ElementLocator::ElementLocator(const Mesh& mesh, int part) : mesh_(mesh), tree_(std::make_unique<Tree>())
{
  constexpr double margin = 0.5; // of an element's size
  std::vector<std::pair<Box, int>> boxes;
  for (std::size_t i = 0; i < mesh.elements.size(); ++i)
    if (mesh.elements[i].part == part) boxes.emplace_back(box_of(mesh, mesh.elements[i], margin), static_cast<int>(i));
  tree_->boxes = {boxes.begin(), boxes.end()};
}

ElementLocator::~ElementLocator() = default;

Location ElementLocator::find(const Vec3& point) const
{
  std::vector<int> candidates; // ascending, so that the first of two that share the point is found
  const Corner at(point[0], point[1], point[2]);
  for (auto it = tree_->boxes.qbegin(geometry::index::intersects(at)); it != tree_->boxes.qend(); ++it)
    candidates.push_back(it->second);
  std::sort(candidates.begin(), candidates.end());
  Location best;
  for (const int element : candidates)
  {
    if (const Location in = located(mesh_, element, point); in.excess < best.excess) best = in;
    if (best.excess <= 0) break;
  }
  return best;
}

} // namespace squeal
