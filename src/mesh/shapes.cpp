/// Shapes in gmsh's node order, and their shape functions.
///
/// The functions of a shape are the polynomials with N_i = 1 at node i and 0 at the others (Zienkiewicz and Taylor, The
/// Finite Element Method, volume 1). Their space has the products of powers of the natural coordinates
///     on boxes     with the powers 0 and 1, with mid-side nodes at most one power 2 (serendipity)
///     on simplices of degree 1, with mid-side nodes 2
///     on wedges    of degree 1 or 2 in the triangle and along it, with mid-side nodes of at most 3 together
///     on pyramids  r^a s^b t^k with t = -zeta, r = xi/t, s = eta/t, and a, b <= k <= 1 or 2 (Bedrosian, Int. J. Numer.
///                  Methods Eng. 35 (1992) 95), with mid-side nodes without r^2 s^2
/// Shapes that have nodes in the middle of quadrilaterals and boxes, too, leave none of these products out. The apex
/// of a pyramid is the origin; its base is at zeta = -1. The factors of the products are multiples of 1/8, hence exact.
/// Caveat: the mid-side nodes of gmsh are not in the order of Abaqus or VTK.
#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>
#include <numeric>

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
constexpr Place pyramid[] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}, {0, 0, 0}};

constexpr Side line_sides[] = {{0, 1}}, triangle_sides[] = {{0, 1}, {1, 2}, {2, 0}},
               quad_sides[] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}},
               tet_sides[] = {{0, 1}, {1, 2}, {2, 0}, {3, 0}, {3, 2}, {3, 1}},
               pyramid_sides[] = {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 4}, {2, 3}, {2, 4}, {3, 4}},
               wedge_sides[] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 4}, {2, 5}, {3, 4}, {3, 5}, {4, 5}},
               hex_sides[] = {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 5}, {2, 3},
                              {2, 6}, {3, 7}, {4, 5}, {4, 7}, {5, 6}, {6, 7}};

constexpr CornerFace hex_faces[] = {{0, 3, 2, 1}, {0, 1, 5, 4}, {0, 4, 7, 3}, {1, 2, 6, 5}, {2, 3, 7, 6}, {4, 5, 6, 7}};
constexpr CornerFace wedge_faces[] = {{0, 2, 1, -1}, {3, 4, 5, -1}, {0, 1, 4, 3}, {0, 3, 5, 2}, {1, 2, 5, 4}};
constexpr CornerFace pyramid_faces[] = {{0, 1, 4, -1}, {3, 0, 4, -1}, {1, 2, 4, -1}, {2, 3, 4, -1}, {0, 3, 2, 1}};
constexpr CornerFace tet_faces[] = {{0, 2, 1, -1}, {0, 1, 3, -1}, {0, 3, 2, -1}, {3, 1, 2, -1}};

struct Topology
{
  int gmsh_type, dimension;
  std::span<const Place> corners;
  std::span<const Side> mid_sides{};
  std::span<const CornerFace> faces{};
  bool is_full = false; // with a node in the middle of each quadrilateral, and of a box
};

constexpr std::span line_corners = std::span(box).first(2), quad_corners = std::span(box).first(4),
                    triangle_corners = std::span(simplex).first(3);

/// In the order of Shape.
constexpr std::array topologies = {
    Topology{1, 1, line_corners},
    Topology{8, 1, line_corners, line_sides},
    Topology{2, 2, triangle_corners},
    Topology{3, 2, quad_corners},
    Topology{9, 2, triangle_corners, triangle_sides},
    Topology{16, 2, quad_corners, quad_sides},
    Topology{10, 2, quad_corners, quad_sides, {}, true},
    Topology{4, 3, simplex, {}, tet_faces},
    Topology{11, 3, simplex, tet_sides, tet_faces},
    Topology{7, 3, pyramid, {}, pyramid_faces},
    Topology{19, 3, pyramid, pyramid_sides, pyramid_faces},
    Topology{14, 3, pyramid, pyramid_sides, pyramid_faces, true},
    Topology{6, 3, wedge, {}, wedge_faces},
    Topology{18, 3, wedge, wedge_sides, wedge_faces},
    Topology{13, 3, wedge, wedge_sides, wedge_faces, true},
    Topology{5, 3, box, {}, hex_faces},
    Topology{17, 3, box, hex_sides, hex_faces},
    Topology{12, 3, box, hex_sides, hex_faces, true},
};

const Topology& topology(Shape shape)
{
  return topologies.at(static_cast<std::size_t>(shape));
}

/// of(shape) of each, in the order of Shape.
template <class Of> auto of_all_shapes(Of of)
{
  std::vector<decltype(of(Shape{}))> result;
  for (std::size_t i = 0; i < topologies.size(); ++i) result.push_back(of(static_cast<Shape>(i)));
  return result;
}

/// Whether the functions of a shape have a product of these powers.
bool has_product(const Topology& t, const Place& powers)
{
  const auto [a, b, c] = powers;
  const int order = t.mid_sides.empty() ? 1 : 2, sum = a + b + c; // sum: the power of t on pyramids
  const Place* const family = t.corners.data();
  if ((t.dimension < 3 && c != 0) || (t.dimension < 2 && b > 0)) return false;
  if (family == pyramid) return std::max(a, b) <= sum && sum <= order && (t.is_full || a * b < 4);
  if (c < 0) return false;
  if (family == simplex) return sum <= order;
  if (family == wedge) return std::max(a + b, c) <= order && (t.is_full || sum <= order + 1);
  return std::max({a, b, c}) <= order && (t.is_full || std::ranges::count(powers, 2) < 2);
}

/// The product of these powers, or its derivative along a direction; -1: none. At the apex of a pyramid 0/0 is 0.
double product(const Place& powers, const Eigen::Vector3d& xi, int along)
{
  double value = along < 0 ? 1 : powers[static_cast<std::size_t>(along)];
  for (int k = 0; k < 3; ++k)
  {
    int power = powers[static_cast<std::size_t>(k)] - (k == along ? 1 : 0);
    for (; power > 0; --power) value *= xi(k);
    for (; power < 0 && value != 0; ++power) value /= xi(k);
  }
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
      for (int c = -2; c < 3; ++c)
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

int gmsh_type(Shape shape)
{
  return topology(shape).gmsh_type;
}

int node_count(Shape shape)
{
  return corner_count(shape) + static_cast<int>(middles_of(shape).size());
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

std::vector<Vec3> arms_of(const Mesh& mesh, std::size_t element, double offset)
{
  std::vector<Vec3> arms(nodes_of(mesh.elements[element]).size(), Vec3{});
  if (offset != 0)
    std::ranges::transform(mesh.normals.at(static_cast<int>(element)), arms.begin(),
                           [&](const Vec3& normal) { return offset * normal; });
  return arms;
}

std::span<const std::array<int, 4>> corner_faces(Shape shape)
{
  return topology(shape).faces;
}

const std::vector<std::vector<int>>& middles_of(Shape shape)
{
  const auto of = [](Shape each)
  {
    const Topology& t = topology(each);
    std::vector<std::vector<int>> middles;
    for (const auto& [a, b] : t.mid_sides) middles.push_back({a, b});
    if (!t.is_full) return middles;
    for (const CornerFace& face : t.faces)
      if (face[3] >= 0) middles.emplace_back(face.begin(), face.end());
    if (t.corners.data() != box) return middles;
    middles.emplace_back(t.corners.size());
    std::iota(middles.back().begin(), middles.back().end(), 0);
    return middles;
  };
  static const auto all = of_all_shapes(of);
  return all[static_cast<std::size_t>(shape)];
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

Face face_on(const Element& element, std::span<const int> corners)
{
  const bool is_full = topology(element.shape).is_full && corners.size() == 4;
  const auto is_its = [&](const Topology& t)
  {
    return t.dimension == 2 && t.corners.size() == corners.size() && t.is_full == is_full &&
           t.mid_sides.empty() == topology(element.shape).mid_sides.empty();
  };
  Face face{static_cast<Shape>(std::ranges::find_if(topologies, is_its) - topologies.begin()), {}, false};
  const std::vector<Eigen::Vector3d> places = natural_positions(element.shape);
  std::vector<Eigen::Vector3d> at;
  for (const int corner : corners)
    at.push_back(places[std::ranges::find(element.nodes, corner) - element.nodes.begin()]);
  add_middles(face.shape, at);
  std::ranges::transform(at, face.nodes.begin(),
                         [&](const Eigen::Vector3d& place)
                         { return element.nodes[std::ranges::find(places, place) - places.begin()]; });
  return face;
}

void mirror(Element& element)
{
  const std::vector<Eigen::Vector3d> places = natural_positions(element.shape);
  const auto before = element.nodes;
  for (std::size_t i = 0; i < places.size(); ++i)
    element.nodes[i] =
        before[std::ranges::find(places, Eigen::Vector3d(places[i](1), places[i](0), places[i](2))) - places.begin()];
}

void add_middles(Shape shape, std::vector<Eigen::Vector3d>& corners)
{
  for (const std::vector<int>& of : middles_of(shape))
  {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const int corner : of) sum += corners[static_cast<std::size_t>(corner)];
    corners.push_back(sum / static_cast<double>(of.size()));
  }
}

std::vector<Eigen::Vector3d> natural_positions(Shape shape)
{
  std::vector<Eigen::Vector3d> places;
  for (const auto& [a, b, c] : topology(shape).corners) places.emplace_back(a, b, c);
  add_middles(shape, places);
  return places;
}

Eigen::Vector3d middle_of(Shape shape)
{
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const std::vector<Eigen::Vector3d> places = natural_positions(shape);
  for (const Eigen::Vector3d& place : places) sum += place / static_cast<double>(places.size());
  return sum;
}

ShapeFunctions shape_functions(Shape shape, const Eigen::Vector3d& xi)
{
  static const std::vector<Polynomials> all = of_all_shapes(polynomials_of);
  const auto& [products, factors] = all[static_cast<std::size_t>(shape)];
  BoundedMatrix<4, most_nodes> values(4, factors.rows()); // rows: the product and its derivatives
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
