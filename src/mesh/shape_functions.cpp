/// Shape functions in gmsh's node order (Zienkiewicz and Taylor, The Finite Element Method, volume 1).
///
/// Boxes of dimension d, with s the natural position of a node, s_k in {-1, 0, 1}:
///     linear        N = prod (1 + s_k xi_k) / 2^d
///     serendipity   corner     N = prod (1 + s_k xi_k) / 2^d (sum s_k xi_k - d + 1)
///                   mid-side   N = (1 - xi_m^2) prod_{k != m} (1 + s_k xi_k) / 2^(d-1),   m the direction of the side
/// Simplices, with L the barycentric coordinates:
///     linear        N = L
///     quadratic     corner N = L (2 L - 1),   mid-side between a and b: N = 4 L_a L_b
/// Caveat: the mid-side nodes of gmsh are not in the order of Abaqus or VTK.
#include "squeal/mesh/quadrature.hpp"
#include "squeal/mesh/shapes.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

using NaturalPosition = std::array<int, 3>;
using Sides = std::span<const std::array<int, 2>>;

constexpr std::array<NaturalPosition, 8> quad_positions = {
    {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {0, -1, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}}};

constexpr std::array<std::array<int, 2>, 3> triangle_sides = {{{0, 1}, {1, 2}, {0, 2}}};

/// Natural positions of the nodes of hex20, the first eight of which are those of hex8.
std::array<NaturalPosition, 20> hex_positions()
{
  std::array<NaturalPosition, 20> positions = {
      {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}, {-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}}};
  std::size_t node = 8;
  for (const auto& [a, b] : mid_sides(Shape::hex20))
  {
    for (std::size_t k = 0; k < 3; ++k) positions[node][k] = (positions[a][k] + positions[b][k]) / 2;
    ++node;
  }
  return positions;
}

ShapeFunctions zero_functions(Eigen::Index nodes)
{
  return {NodeValues::Zero(nodes), NodeGradients::Zero(3, nodes)};
}

ShapeFunctions linear_box(std::span<const NaturalPosition> nodes, int dimension, const Eigen::Vector3d& xi)
{
  ShapeFunctions at = zero_functions(static_cast<Eigen::Index>(nodes.size()));
  for (Eigen::Index i = 0; i < at.N.size(); ++i)
  {
    Eigen::Vector3d f = Eigen::Vector3d::Ones(), slope = Eigen::Vector3d::Zero();
    for (int k = 0; k < dimension; ++k)
    {
      slope(k) = 0.5 * nodes[i][k];
      f(k) = 0.5 + slope(k) * xi(k);
    }
    at.N(i) = f.prod();
    at.dN.col(i) << slope(0) * f(1) * f(2), f(0) * slope(1) * f(2), f(0) * f(1) * slope(2);
  }
  return at;
}

ShapeFunctions serendipity_box(std::span<const NaturalPosition> nodes, int dimension, const Eigen::Vector3d& xi)
{
  ShapeFunctions at = linear_box(nodes, dimension, xi);
  for (Eigen::Index i = 0; i < at.N.size(); ++i)
  {
    const Eigen::Vector3d s(nodes[i][0], nodes[i][1], nodes[i][2]);
    const auto m = std::find(nodes[i].begin(), nodes[i].begin() + dimension, 0) - nodes[i].begin();
    const bool is_corner = m == dimension;
    if (is_corner)
    {
      const double factor = s.dot(xi) - dimension + 1;
      at.dN.col(i) = at.dN.col(i) * factor + at.N(i) * s;
      at.N(i) *= factor;
      continue;
    }
    const double bubble = 2 * (1 - xi(m) * xi(m)); // 2 because the linear factor of direction m is 1/2
    at.dN.col(i) *= bubble;
    at.dN(m, i) = -4 * xi(m) * at.N(i);
    at.N(i) *= bubble;
  }
  return at;
}

ShapeFunctions linear_simplex(int dimension, const Eigen::Vector3d& xi)
{
  ShapeFunctions at = zero_functions(dimension + 1);
  at.N(0) = 1;
  for (int k = 0; k < dimension; ++k)
  {
    at.N(0) -= xi(k);
    at.N(k + 1) = xi(k);
    at.dN(k, 0) = -1;
    at.dN(k, k + 1) = 1;
  }
  return at;
}

ShapeFunctions quadratic_simplex(Sides sides, int dimension, const Eigen::Vector3d& xi)
{
  const ShapeFunctions L = linear_simplex(dimension, xi);
  const auto corners = L.N.size();
  ShapeFunctions at = zero_functions(corners + static_cast<Eigen::Index>(sides.size()));
  for (Eigen::Index i = 0; i < corners; ++i)
  {
    at.N(i) = L.N(i) * (2 * L.N(i) - 1);
    at.dN.col(i) = (4 * L.N(i) - 1) * L.dN.col(i);
  }
  auto i = corners;
  for (const auto& [a, b] : sides)
  {
    at.N(i) = 4 * L.N(a) * L.N(b);
    at.dN.col(i) = 4 * (L.N(a) * L.dN.col(b) + L.N(b) * L.dN.col(a));
    ++i;
  }
  return at;
}

/// Product of the linear triangle in xi, eta and linear functions in zeta.
ShapeFunctions linear_wedge(const Eigen::Vector3d& xi)
{
  const ShapeFunctions L = linear_simplex(2, xi);
  ShapeFunctions at = zero_functions(6);
  for (int i = 0; i < 6; ++i)
  {
    const double s = i < 3 ? -0.5 : 0.5;
    const double f = 0.5 + s * xi(2);
    at.N(i) = L.N(i % 3) * f;
    at.dN.col(i) << L.dN(0, i % 3) * f, L.dN(1, i % 3) * f, L.N(i % 3) * s;
  }
  return at;
}

} // namespace

ShapeFunctions shape_functions(Shape shape, const Eigen::Vector3d& xi)
{
  static const std::array<NaturalPosition, 20> hex = hex_positions();
  switch (shape)
  {
  case Shape::hex8:
    return linear_box(std::span(hex).first(8), 3, xi);
  case Shape::hex20:
    return serendipity_box(hex, 3, xi);
  case Shape::wedge6:
    return linear_wedge(xi);
  case Shape::tet10:
    return quadratic_simplex(mid_sides(Shape::tet10), 3, xi);
  case Shape::tet4:
    return linear_simplex(3, xi);
  case Shape::shell4:
    return shape_functions(FaceShape::quad4, xi);
  default:
    return shape_functions(FaceShape::triangle3, xi);
  }
}

ShapeFunctions shape_functions(FaceShape shape, const Eigen::Vector3d& xi)
{
  const std::span<const NaturalPosition> quad(quad_positions);
  switch (shape)
  {
  case FaceShape::quad4:
    return linear_box(quad.first(4), 2, xi);
  case FaceShape::quad8:
    return serendipity_box(quad, 2, xi);
  case FaceShape::triangle6:
    return quadratic_simplex(triangle_sides, 2, xi);
  default:
    return linear_simplex(2, xi);
  }
}

NodePositions position_matrix(std::span<const Vec3> x)
{
  NodePositions X(3, static_cast<Eigen::Index>(x.size()));
  for (std::size_t i = 0; i < x.size(); ++i) X.col(static_cast<Eigen::Index>(i)) = Eigen::Vector3d(x[i].data());
  return X;
}

/// n dA = (dx/dxi x dx/deta) dxi deta
std::vector<Vec3> face_weights(FaceShape shape, std::span<const Vec3> x)
{
  const NodePositions X = position_matrix(x);
  std::vector<Vec3> weights(x.size(), Vec3{});
  for (const auto& [xi, weight, at] : area_rule(shape))
  {
    const Eigen::Vector3d dx_dxi = X * at.dN.row(0).transpose(), dx_deta = X * at.dN.row(1).transpose();
    const Eigen::Vector3d area = weight * dx_dxi.cross(dx_deta);
    for (std::size_t i = 0; i < x.size(); ++i)
      for (int k = 0; k < 3; ++k) weights[i][k] += at.N(static_cast<Eigen::Index>(i)) * area(k);
  }
  return weights;
}

} // namespace squeal
