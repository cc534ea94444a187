/// Newton's method on x(xi) = p; on shells on the least distance, which leaves p's part along the normal. The excess is
/// how far xi leaves the element in units of half its width; on a shell the distance from its surface counts as well.
#include "squeal/mesh/location.hpp"

#include "squeal/mesh/shapes.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr double margin = 0.5; // of an element's size, by which its box is enlarged

struct Box
{
  Vec3 low{}, high{};

  double size() const { return norm(high - low); }
};

Box box_of(const Mesh& mesh, const Element& element)
{
  const auto nodes = nodes_of(element);
  Box box{mesh.nodes[nodes[0]], mesh.nodes[nodes[0]]};
  for (const int node : nodes)
    for (std::size_t c = 0; c < 3; ++c)
    {
      box.low[c] = std::min(box.low[c], mesh.nodes[node][c]);
      box.high[c] = std::max(box.high[c], mesh.nodes[node][c]);
    }
  return box;
}

NodePositions positions_of(const Mesh& mesh, const Element& element)
{
  std::vector<Vec3> x;
  for (const int node : nodes_of(element)) x.push_back(mesh.nodes[node]);
  return position_matrix(x);
}

/// Of the simplices' barycentric coordinates the smallest may be negative; along an axis of a box |xi| may exceed 1.
double excess_of(Shape shape, const Eigen::Vector3d& xi)
{
  const auto of_axes = [&](int count) { return xi.head(count).cwiseAbs().maxCoeff() - 1; };
  const auto of_simplex = [&](int count) { return -2 * std::min(xi.head(count).minCoeff(), 1 - xi.head(count).sum()); };
  switch (shape)
  {
  case Shape::hex8:
  case Shape::hex20:
    return of_axes(3);
  case Shape::tet4:
  case Shape::tet10:
    return of_simplex(3);
  case Shape::wedge6:
    return std::max(of_simplex(2), std::abs(xi(2)) - 1);
  case Shape::shell4:
    return of_axes(2);
  case Shape::shell3:
    return of_simplex(2);
  }
  return 0;
}

} // namespace

Location located(const Mesh& mesh, int element, const Vec3& point)
{
  constexpr int most = 20;       // Newton steps; a mildly distorted brick takes 3 to 5
  constexpr double near = 1e-13; // [-] last step
  const Element& of = mesh.elements[static_cast<std::size_t>(element)];
  const NodePositions x = positions_of(mesh, of);
  const Eigen::Vector3d p(point[0], point[1], point[2]);
  const Eigen::Index axes = is_shell(of.shape) ? 2 : 3;
  const bool simplex = of.shape == Shape::tet4 || of.shape == Shape::tet10 || of.shape == Shape::shell3;
  Location at{element, simplex ? Eigen::Vector3d::Constant(1. / 4) : Eigen::Vector3d::Zero(), 0};
  if (of.shape == Shape::wedge6) at.xi = {1. / 3, 1. / 3, 0};
  if (axes == 2) at.xi(2) = 0;
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
  if (axes == 2) at.excess = std::max(at.excess, 2 * away / box_of(mesh, of).size());
  if (!std::isfinite(at.excess)) at.excess = std::numeric_limits<double>::max();
  return at;
}

ElementLocator::ElementLocator(const Mesh& mesh, int part) : mesh_(mesh)
{
  Box all;
  double size = 0;
  for (std::size_t i = 0; i < mesh.elements.size(); ++i)
  {
    if (mesh.elements[i].part != part) continue;
    const Box box = box_of(mesh, mesh.elements[i]);
    if (elements_.empty()) all = box;
    for (std::size_t c = 0; c < 3; ++c)
    {
      all.low[c] = std::min(all.low[c], box.low[c]);
      all.high[c] = std::max(all.high[c], box.high[c]);
    }
    size += box.size();
    elements_.push_back(static_cast<int>(i));
  }
  if (elements_.empty()) return;
  low_ = all.low;
  side_ = size / static_cast<double>(elements_.size());
  constexpr int most = 100; // cells along an axis
  for (std::size_t c = 0; c < 3; ++c) side_ = std::max(side_, (all.high[c] - all.low[c]) / most);
  for (std::size_t c = 0; c < 3; ++c) cells_[c] = static_cast<int>((all.high[c] - all.low[c]) / side_) + 1;
  in_cell_.resize(static_cast<std::size_t>(cells_[0]) * cells_[1] * cells_[2]);
  const auto cell = [&](double x, std::size_t c)
  { return std::clamp(static_cast<int>(std::floor((x - low_[c]) / side_)), 0, cells_[c] - 1); };
  for (const int element : elements_)
  {
    const Box box = box_of(mesh, mesh.elements[static_cast<std::size_t>(element)]);
    const double more = margin * box.size();
    std::array<std::array<int, 2>, 3> range{};
    for (std::size_t c = 0; c < 3; ++c) range[c] = {cell(box.low[c] - more, c), cell(box.high[c] + more, c)};
    for (int i = range[0][0]; i <= range[0][1]; ++i)
      for (int j = range[1][0]; j <= range[1][1]; ++j)
        for (int k = range[2][0]; k <= range[2][1]; ++k)
          in_cell_[static_cast<std::size_t>((i * cells_[1] + j) * cells_[2] + k)].push_back(element);
  }
}

void ElementLocator::visit(const Vec3& point, std::span<const int> candidates, Location& best) const
{
  for (const int element : candidates)
  {
    const Box box = box_of(mesh_, mesh_.elements[static_cast<std::size_t>(element)]);
    const double more = margin * box.size();
    bool outside = false;
    for (std::size_t c = 0; c < 3; ++c)
      outside = outside || point[c] < box.low[c] - more || point[c] > box.high[c] + more;
    if (outside) continue;
    if (const Location at = located(mesh_, element, point); at.excess < best.excess) best = at;
    if (best.excess <= 0) return;
  }
}

Location ElementLocator::find(const Vec3& point) const
{
  Location best;
  if (elements_.empty()) return best;
  std::array<int, 3> at{};
  for (std::size_t c = 0; c < 3; ++c)
    at[c] = std::clamp(static_cast<int>(std::floor((point[c] - low_[c]) / side_)), 0, cells_[c] - 1);
  visit(point, in_cell_[static_cast<std::size_t>((at[0] * cells_[1] + at[1]) * cells_[2] + at[2])], best);
  return best;
}

} // namespace squeal
