/// Shape functions (Zienkiewicz and Taylor, The Finite Element Method, volume 1) in gmsh's node order.
///
/// Boxes: with s the natural position of a node, s_k in {-1, 0, 1},
///     linear        N = prod (1 + s_k xi_k) / 2^d
///     serendipity   corner N = linear (sum s_k xi_k - d + 1),   mid-side N = (1 - xi_m^2) prod_{k != m} (1 + s_k xi_k)
///     / 2
/// Simplices: with L the barycentric coordinates,   corner N = L (2 L - 1),   mid-side N = 4 L_a L_b.
/// Caveat: mid-side orders are gmsh's, which are not those of Abaqus or VTK.
#include "interpolation.hpp"

#include <cmath>

namespace squeal
{

namespace
{

using Position = std::array<int, 3>;

constexpr std::array<Position, 20> hexahedron = {{{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}, {-1, -1, 1},
                                                  {1, -1, 1},   {1, 1, 1},   {-1, 1, 1}, {0, -1, -1}, {-1, 0, -1},
                                                  {-1, -1, 0},  {1, 0, -1},  {1, -1, 0}, {0, 1, -1},  {1, 1, 0},
                                                  {-1, 1, 0},   {0, -1, 1},  {-1, 0, 1}, {1, 0, 1},   {0, 1, 1}}};

constexpr std::array<Position, 9> quadrilateral = {
    {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {0, -1, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, 0, 0}}};

using Edge = std::array<int, 2>;
constexpr std::array<Edge, 6> tetrahedron_edges = {{{0, 1}, {1, 2}, {0, 2}, {0, 3}, {2, 3}, {1, 3}}};
constexpr std::array<Edge, 3> triangle_edges = {{{0, 1}, {1, 2}, {0, 2}}};

Interpolation of_nodes(Eigen::Index count)
{
  return {NodeValues::Zero(count), Columns<3, 20>::Zero(3, count)};
}

/// N = prod f_k(xi_k) of one-dimensional factors and their slopes.
void set_product(Interpolation& at, Eigen::Index node, const Eigen::Vector3d& f, const Eigen::Vector3d& slope)
{
  at.N(node) = f.prod();
  at.dN.col(node) << slope(0) * f(1) * f(2), f(0) * slope(1) * f(2), f(0) * f(1) * slope(2);
}

Interpolation linear_box(std::span<const Position> nodes, int dimension, const Eigen::Vector3d& xi)
{
  Interpolation at = of_nodes(static_cast<Eigen::Index>(nodes.size()));
  for (Eigen::Index i = 0; i < at.N.size(); ++i)
  {
    Eigen::Vector3d f = Eigen::Vector3d::Ones(), slope = Eigen::Vector3d::Zero();
    for (int k = 0; k < dimension; ++k)
    {
      slope(k) = .5 * nodes[i][k];
      f(k) = .5 + slope(k) * xi(k);
    }
    set_product(at, i, f, slope);
  }
  return at;
}

Interpolation serendipity_box(std::span<const Position> nodes, int dimension, const Eigen::Vector3d& xi)
{
  Interpolation at = linear_box(nodes, dimension, xi);
  for (Eigen::Index i = 0; i < at.N.size(); ++i)
  {
    const Eigen::Vector3d s(nodes[i][0], nodes[i][1], nodes[i][2]);
    const auto middle = std::find(nodes[i].begin(), nodes[i].begin() + dimension, 0) - nodes[i].begin();
    if (middle == dimension) // corner
    {
      const double factor = s.dot(xi) - dimension + 1;
      at.dN.col(i) = at.dN.col(i) * factor + at.N(i) * s;
      at.N(i) *= factor;
      continue;
    }
    const double bubble = 2 * (1 - xi(middle) * xi(middle)); // 2: the linear factor of this direction is 1/2
    at.dN.col(i) *= bubble;
    at.dN(middle, i) = -4 * xi(middle) * at.N(i);
    at.N(i) *= bubble;
  }
  return at;
}

Interpolation quadratic_box(std::span<const Position> nodes, int dimension, const Eigen::Vector3d& xi)
{
  Interpolation at = of_nodes(static_cast<Eigen::Index>(nodes.size()));
  for (Eigen::Index i = 0; i < at.N.size(); ++i)
  {
    Eigen::Vector3d f = Eigen::Vector3d::Ones(), slope = Eigen::Vector3d::Zero();
    for (int k = 0; k < dimension; ++k)
    {
      const double s = nodes[i][k], z = xi(k);
      f(k) = s == 0 ? 1 - z * z : .5 * z * (z + s);
      slope(k) = s == 0 ? -2 * z : z + .5 * s;
    }
    set_product(at, i, f, slope);
  }
  return at;
}

/// Linear simplex: the barycentric coordinates themselves.
Interpolation barycentric(int dimension, const Eigen::Vector3d& xi)
{
  Interpolation at = of_nodes(dimension + 1);
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

Interpolation quadratic_simplex(std::span<const Edge> edges, int dimension, const Eigen::Vector3d& xi)
{
  const Interpolation L = barycentric(dimension, xi);
  const auto corners = L.N.size();
  Interpolation at = of_nodes(corners + static_cast<Eigen::Index>(edges.size()));
  for (Eigen::Index i = 0; i < corners; ++i)
  {
    at.N(i) = L.N(i) * (2 * L.N(i) - 1);
    at.dN.col(i) = (4 * L.N(i) - 1) * L.dN.col(i);
  }
  for (std::size_t e = 0; e < edges.size(); ++e)
  {
    const auto [a, b] = edges[e];
    const auto i = corners + static_cast<Eigen::Index>(e);
    at.N(i) = 4 * L.N(a) * L.N(b);
    at.dN.col(i) = 4 * (L.N(a) * L.dN.col(b) + L.N(b) * L.dN.col(a));
  }
  return at;
}

Interpolation wedge(const Eigen::Vector3d& xi)
{
  const Interpolation L = barycentric(2, xi);
  Interpolation at = of_nodes(6);
  for (int i = 0; i < 6; ++i)
  {
    const double s = i < 3 ? -.5 : .5;
    const double f = .5 + s * xi(2);
    at.N(i) = L.N(i % 3) * f;
    at.dN.col(i) << L.dN(0, i % 3) * f, L.dN(1, i % 3) * f, L.N(i % 3) * s;
  }
  return at;
}

struct LinePoint
{
  double at, weight;
};

/// Gauss-Legendre on [-1, 1], exact to degree 2 n - 1, n = 2, 3, 4.
std::vector<LinePoint> gauss(int n)
{
  if (n == 2) return {{-std::sqrt(1. / 3), 1}, {std::sqrt(1. / 3), 1}};
  if (n == 3) return {{-std::sqrt(.6), 5. / 9}, {0, 8. / 9}, {std::sqrt(.6), 5. / 9}};
  const double near = std::sqrt(3. / 7 - 2. / 7 * std::sqrt(1.2)), far = std::sqrt(3. / 7 + 2. / 7 * std::sqrt(1.2));
  const double heavy = (18 + std::sqrt(30.)) / 36, light = (18 - std::sqrt(30.)) / 36;
  return {{-far, light}, {-near, heavy}, {near, heavy}, {far, light}};
}

Quadrature square(int n)
{
  Quadrature rule;
  for (const auto& a : gauss(n))
    for (const auto& b : gauss(n)) rule.push_back({{a.at, b.at, 0}, a.weight * b.weight});
  return rule;
}

/// A plane rule swept along zeta in [-1, 1].
Quadrature swept(const Quadrature& plane, int n)
{
  Quadrature rule;
  for (const auto& p : plane)
    for (const auto& c : gauss(n)) rule.push_back({{p.xi(0), p.xi(1), c.at}, p.weight * c.weight});
  return rule;
}

/// The square collapsed to the unit triangle (conical product): exact to degree 2 n - 2.
Quadrature collapsed_triangle(int n)
{
  Quadrature rule;
  for (const auto& [xi, weight] : square(n))
  {
    const double a = .5 * (1 + xi(0)), b = .5 * (1 + xi(1));
    rule.push_back({{a, b * (1 - a), 0}, .25 * weight * (1 - a)});
  }
  return rule;
}

/// The cube collapsed to the unit tetrahedron: exact to degree 2 n - 3.
Quadrature collapsed_tetrahedron(int n)
{
  Quadrature rule;
  for (const auto& [xi, weight] : swept(square(n), n))
  {
    const Eigen::Vector3d t = .5 * (xi.array() + 1);
    const double b = t(1) * (1 - t(0));
    rule.push_back({{t(0), b, t(2) * (1 - t(0) - b)}, weight / 8 * (1 - t(0)) * (1 - t(0) - b)});
  }
  return rule;
}

Quadrature three_point_triangle()
{
  return {{{1. / 6, 1. / 6, 0}, 1. / 6}, {{2. / 3, 1. / 6, 0}, 1. / 6}, {{1. / 6, 2. / 3, 0}, 1. / 6}};
}

/// Degree 2, as the three inner points; sides in the order 01, 12, 20.
Quadrature mid_side_triangle()
{
  return {{{.5, 0, 0}, 1. / 6}, {{.5, .5, 0}, 1. / 6}, {{0, .5, 0}, 1. / 6}};
}

/// Degree 2 (Hammer and Stroud 1956).
Quadrature four_point_tetrahedron()
{
  const double a = (5 - std::sqrt(5.)) / 20, b = 1 - 3 * a, w = 1. / 24;
  return {{{a, a, a}, w}, {{b, a, a}, w}, {{a, b, a}, w}, {{a, a, b}, w}};
}

} // namespace

Interpolation interpolate(Shape shape, const Eigen::Vector3d& xi)
{
  const std::span<const Position> box(hexahedron);
  switch (shape)
  {
  case Shape::hex8:
    return linear_box(box.first(8), 3, xi);
  case Shape::hex20:
    return serendipity_box(box, 3, xi);
  case Shape::wedge6:
    return wedge(xi);
  case Shape::tet10:
    return quadratic_simplex(tetrahedron_edges, 3, xi);
  case Shape::shell4:
    return interpolate(FaceShape::quad4, xi);
  default:
    return interpolate(FaceShape::triangle3, xi);
  }
}

Interpolation interpolate(FaceShape shape, const Eigen::Vector3d& xi)
{
  const std::span<const Position> box(quadrilateral);
  switch (shape)
  {
  case FaceShape::quad4:
    return linear_box(box.first(4), 2, xi);
  case FaceShape::quad8:
    return serendipity_box(box.first(8), 2, xi);
  case FaceShape::quad9:
    return quadratic_box(box, 2, xi);
  case FaceShape::triangle6:
    return quadratic_simplex(triangle_edges, 2, xi);
  default:
    return barycentric(2, xi);
  }
}

const Quadrature& stiffness_rule(Shape shape)
{
  static const Quadrature box2 = swept(square(2), 2), box3 = swept(square(3), 3),
                          tetrahedron = four_point_tetrahedron(), prism = swept(three_point_triangle(), 2),
                          quad = square(2), triangle = mid_side_triangle();
  switch (shape)
  {
  case Shape::hex8:
    return box2;
  case Shape::hex20:
    return box3;
  case Shape::wedge6:
    return prism;
  case Shape::tet10:
    return tetrahedron;
  case Shape::shell4:
    return quad;
  default:
    return triangle;
  }
}

const Quadrature& mass_rule(Shape shape)
{
  static const Quadrature box = swept(square(3), 3), tetrahedron = collapsed_tetrahedron(4),
                          prism = swept(collapsed_triangle(3), 3), quad = square(3), triangle = collapsed_triangle(3);
  switch (shape)
  {
  case Shape::hex8:
  case Shape::hex20:
    return box;
  case Shape::wedge6:
    return prism;
  case Shape::tet10:
    return tetrahedron;
  case Shape::shell4:
    return quad;
  default:
    return triangle;
  }
}

const Quadrature& area_rule(FaceShape shape)
{
  static const Quadrature quad = square(3), triangle = collapsed_triangle(3);
  return shape == FaceShape::triangle3 || shape == FaceShape::triangle6 ? triangle : quad;
}

NodePositions columns_of(std::span<const Vec3> x)
{
  NodePositions X(3, static_cast<Eigen::Index>(x.size()));
  for (std::size_t i = 0; i < x.size(); ++i) X.col(static_cast<Eigen::Index>(i)) << x[i][0], x[i][1], x[i][2];
  return X;
}

} // namespace squeal
