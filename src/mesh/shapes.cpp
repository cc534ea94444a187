/// Shapes in gmsh's node order, and their shape functions.
///
/// The functions of a shape are the polynomials with N_i = 1 at node i and 0 at the others (Zienkiewicz and Taylor, The
/// Finite Element Method, volume 1). Their space has the products of powers of the natural coordinates
///     on boxes     with the powers 0 and 1, with mid-side nodes at most one power 2 (serendipity)
///     on simplices of degree 1, with mid-side nodes 2
///     on wedges    of degree 1 in the triangle and along it
/// The factors of the products are multiples of 1/8, hence exact.
/// Caveat: the mid-side nodes of gmsh are not in the order of Abaqus or VTK.
#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

using Side = std::array<int, 2>;
using CornerFace = std::array<int, 4>;
using Place = std::array<int, 3>; // natural coordinates of a corner, or the powers of the three in a product

constexpr Place box[] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                         {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};
constexpr Place simplex[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
constexpr Place wedge[] = {{0, 0, -1}, {1, 0, -1}, {0, 1, -1}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}};

constexpr Side line_sides[] = {{0, 1}}, triangle_sides[] = {{0, 1}, {1, 2}, {2, 0}},
               quad_sides[] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}},
               tet_sides[] = {{0, 1}, {1, 2}, {2, 0}, {3, 0}, {3, 2}, {3, 1}},
               hex_sides[] = {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 5}, {2, 3},
                              {2, 6}, {3, 7}, {4, 5}, {4, 7}, {5, 6}, {6, 7}};

constexpr CornerFace hex_faces[] = {{0, 3, 2, 1}, {0, 1, 5, 4}, {0, 4, 7, 3}, {1, 2, 6, 5}, {2, 3, 7, 6}, {4, 5, 6, 7}};
constexpr CornerFace wedge_faces[] = {{0, 2, 1, -1}, {3, 4, 5, -1}, {0, 1, 4, 3}, {0, 3, 5, 2}, {1, 2, 5, 4}};
constexpr CornerFace tet_faces[] = {{0, 2, 1, -1}, {0, 1, 3, -1}, {0, 3, 2, -1}, {3, 1, 2, -1}};

struct Topology
{
  int gmsh_type, dimension;
  std::span<const Place> corners;
  std::span<const Side> mid_sides;
  std::span<const CornerFace> faces;
};

/// In the order of Shape.
constexpr std::array topologies = {
    Topology{1, 1, std::span(box).first(2), {}, {}},
    Topology{8, 1, std::span(box).first(2), line_sides, {}},
    Topology{2, 2, std::span(simplex).first(3), {}, {}},
    Topology{3, 2, std::span(box).first(4), {}, {}},
    Topology{9, 2, std::span(simplex).first(3), triangle_sides, {}},
    Topology{16, 2, std::span(box).first(4), quad_sides, {}},
    Topology{4, 3, simplex, {}, tet_faces},
    Topology{11, 3, simplex, tet_sides, tet_faces},
    Topology{6, 3, wedge, {}, wedge_faces},
    Topology{5, 3, box, {}, hex_faces},
    Topology{17, 3, box, hex_sides, hex_faces},
};

const Topology& topology(Shape shape)
{
  return topologies.at(static_cast<std::size_t>(shape));
}

/// Whether the functions of a shape have a product of these powers.
bool has_product(const Topology& t, const Place& powers)
{
  const auto [a, b, c] = powers;
  const int order = t.mid_sides.empty() ? 1 : 2;
  if ((t.dimension < 3 && c > 0) || (t.dimension < 2 && b > 0)) return false;
  if (t.corners.data() == simplex) return a + b + c <= order;
  if (t.corners.data() == wedge) return a + b <= 1 && c <= 1;
  return std::ranges::count(powers, 2) < order;
}

/// The product of these powers, or its derivative along a direction; -1: none.
double product(const Place& powers, const Eigen::Vector3d& xi, int along)
{
  double value = along < 0 ? 1 : powers[static_cast<std::size_t>(along)];
  for (int k = 0; k < 3; ++k)
    for (int i = powers[static_cast<std::size_t>(k)] - (k == along ? 1 : 0); i > 0; --i) value *= xi(k);
  return value;
}

/// Products of powers, and their factors in the functions: a row a product, a column a node.
struct Polynomials
{
  std::vector<Place> products{};
  Eigen::MatrixXd factors{};
};

Polynomials polynomials_of(Shape shape)
{
  Polynomials result;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      for (int c = 0; c < 3; ++c)
        if (has_product(topology(shape), {a, b, c})) result.products.push_back({a, b, c});
  const std::vector<Eigen::Vector3d> nodes = natural_positions(shape);
  Eigen::MatrixXd at_nodes(nodes.size(), result.products.size());
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (std::size_t j = 0; j < nodes.size(); ++j)
      at_nodes(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = product(result.products[j], nodes[i], -1);
  result.factors = (8 * at_nodes.inverse()).array().round() / 8;
  return result;
}

} // namespace

std::optional<Shape> shape_of(int gmsh_type)
{
  const auto* const found = std::ranges::find(topologies, gmsh_type, &Topology::gmsh_type);
  if (found == topologies.end()) return {};
  return static_cast<Shape>(found - topologies.begin());
}

int node_count(Shape shape)
{
  return corner_count(shape) + static_cast<int>(mid_sides(shape).size());
}

int corner_count(Shape shape)
{
  return static_cast<int>(topology(shape).corners.size());
}

int dimension_of(Shape shape)
{
  return topology(shape).dimension;
}

bool is_shell(Shape shape)
{
  return dimension_of(shape) == 2;
}

std::span<const int> nodes_of(const Element& element)
{
  return std::span(element.nodes).first(node_count(element.shape));
}

std::span<const int> nodes_of(const Face& face)
{
  return std::span(face.nodes).first(node_count(face.shape));
}

std::vector<Vec3> positions_of(const Mesh& mesh, std::span<const int> nodes)
{
  std::vector<Vec3> x;
  for (const int node : nodes) x.push_back(mesh.nodes[static_cast<std::size_t>(node)]);
  return x;
}

std::span<const std::array<int, 2>> mid_sides(Shape shape)
{
  return topology(shape).mid_sides;
}

std::span<const std::array<int, 4>> corner_faces(Shape shape)
{
  return topology(shape).faces;
}

std::vector<std::vector<int>> faces_of(const Element& element)
{
  std::vector<std::vector<int>> faces;
  for (const CornerFace& corners : corner_faces(element.shape))
  {
    std::vector<int>& face = faces.emplace_back();
    for (const int corner : corners)
      if (corner >= 0) face.push_back(element.nodes[static_cast<std::size_t>(corner)]);
  }
  return faces;
}

std::vector<int> mirrored_order(Shape shape)
{
  const std::vector<Eigen::Vector3d> nodes = natural_positions(shape);
  std::vector<int> order;
  for (const Eigen::Vector3d& xi : nodes)
    order.push_back(static_cast<int>(std::ranges::find(nodes, Eigen::Vector3d(xi(1), xi(0), xi(2))) - nodes.begin()));
  return order;
}

std::vector<Eigen::Vector3d> natural_positions(Shape shape)
{
  std::vector<Eigen::Vector3d> places;
  for (const auto& [a, b, c] : topology(shape).corners) places.emplace_back(a, b, c);
  for (const auto& [a, b] : mid_sides(shape)) places.emplace_back((places[a] + places[b]) / 2);
  return places;
}

ShapeFunctions shape_functions(Shape shape, const Eigen::Vector3d& xi)
{
  static const std::vector<Polynomials> all = []
  {
    std::vector<Polynomials> result;
    for (std::size_t i = 0; i < topologies.size(); ++i) result.push_back(polynomials_of(static_cast<Shape>(i)));
    return result;
  }();
  const auto& [products, factors] = all[static_cast<std::size_t>(shape)];
  BoundedMatrix<4, 20> values(4, factors.rows()); // rows: the product and its derivatives
  for (Eigen::Index i = 0; i < values.cols(); ++i)
    for (int row = 0; row < 4; ++row) values(row, i) = product(products[static_cast<std::size_t>(i)], xi, row - 1);
  values = (values * factors).eval();
  return {values.row(0).transpose(), values.bottomRows<3>()};
}

NodePositions position_matrix(std::span<const Vec3> x)
{
  NodePositions X(3, static_cast<Eigen::Index>(x.size()));
  for (std::size_t i = 0; i < x.size(); ++i) X.col(static_cast<Eigen::Index>(i)) = Eigen::Vector3d(x[i].data());
  return X;
}

/// n dA = (dx/dxi x dx/deta) dxi deta
std::vector<Vec3> face_weights(Shape shape, std::span<const Vec3> x)
{
  const NodePositions X = position_matrix(x);
  std::vector<Vec3> weights(x.size(), Vec3{});
  for (const auto& [xi, weight, at] : mass_rule(shape))
  {
    const Eigen::Vector3d dx_dxi = X * at.dN.row(0).transpose(), dx_deta = X * at.dN.row(1).transpose();
    const Eigen::Vector3d area = weight * dx_dxi.cross(dx_deta);
    for (std::size_t i = 0; i < x.size(); ++i)
      for (int k = 0; k < 3; ++k) weights[i][k] += at.N(static_cast<Eigen::Index>(i)) * area(k);
  }
  return weights;
}

} // namespace squeal
