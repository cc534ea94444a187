/// Quadrature rules: Gauss-Legendre products, Gauss-Legendre collapsed to simplices, and symmetric rules of degree 2.
///
/// Reference elements: xi_k in [-1, 1] of boxes; xi_k >= 0, sum xi_k <= 1 of simplices; their product of wedges;
/// |xi_1|, |xi_2| <= -xi_3 <= 1 of pyramids. Collapsed rules are conical products (Stroud 1971).
#include "squeal/mesh/shape_functions.hpp"

#include <cmath>

namespace squeal
{

namespace
{

/// A point of a rule in two or three dimensions.
struct RulePoint
{
  Eigen::Vector3d xi;
  double weight;
};

using Rule = std::vector<RulePoint>;

} // namespace

std::vector<LinePoint> gauss(int n)
{
  if (n == 2) return {{-std::sqrt(1. / 3), 1}, {std::sqrt(1. / 3), 1}};
  if (n == 3) return {{-std::sqrt(0.6), 5. / 9}, {0, 8. / 9}, {std::sqrt(0.6), 5. / 9}};
  const double inner = std::sqrt(3. / 7 - 2. / 7 * std::sqrt(1.2)), outer = std::sqrt(3. / 7 + 2. / 7 * std::sqrt(1.2));
  const double inner_weight = (18 + std::sqrt(30.)) / 36, outer_weight = (18 - std::sqrt(30.)) / 36;
  return {{-outer, outer_weight}, {-inner, inner_weight}, {inner, inner_weight}, {outer, outer_weight}};
}

namespace
{

/// Product of a rule and a Gauss-Legendre rule of n points along one more coordinate.
Rule extruded(const Rule& rule, Eigen::Index along, int n)
{
  Rule result;
  for (const auto& p : rule)
    for (const auto& c : gauss(n))
    {
      result.push_back({p.xi, p.weight * c.weight});
      result.back().xi(along) = c.x;
    }
  return result;
}

Rule on_box(int n, Eigen::Index dimension)
{
  Rule rule{{Eigen::Vector3d::Zero(), 1}};
  for (Eigen::Index k = 0; k < dimension; ++k) rule = extruded(rule, k, n);
  return rule;
}

/// The rule with coordinates that go from 0 to 1.
Rule to_unit(Rule rule, std::initializer_list<Eigen::Index> coordinates)
{
  for (auto& [xi, weight] : rule)
    for (const Eigen::Index k : coordinates) xi(k) = (1 + xi(k)) / 2, weight /= 2;
  return rule;
}

/// The rule with coordinates that shrink to nothing at the end of another one, which goes from 0 to 1.
Rule collapsed(Rule rule, Eigen::Index along, std::initializer_list<Eigen::Index> shrunk)
{
  for (auto& [xi, weight] : rule)
    for (const Eigen::Index k : shrunk) xi(k) *= 1 - xi(along), weight *= 1 - xi(along);
  return rule;
}

/// The product rule of n points a direction. It is exact to degree 2 n - 1 on boxes, 2 n - 2 on triangles and 2 n - 3
/// on tetrahedra. On pyramids it is for r^a s^b t^k of shapes.cpp with a, b and k + 2 up to 2 n - 1.
Rule product_rule(Shape shape, int n)
{
  const int corners = corner_count(shape), dimension = dimension_of(shape);
  Rule rule = on_box(n, dimension);
  if (corners == 3 || corners == 6) return collapsed(to_unit(rule, {0, 1}), 0, {1});
  if (corners == 4 && dimension == 3) return collapsed(collapsed(to_unit(rule, {0, 1, 2}), 1, {2}), 0, {1, 2});
  if (corners != 5) return rule;
  rule = collapsed(to_unit(rule, {2}), 2, {0, 1});
  for (auto& point : rule) point.xi(2) -= 1; // the apex is the origin
  return rule;
}

/// Three inner points of degree 2.
Rule inner_triangle()
{
  return {{{1. / 6, 1. / 6, 0}, 1. / 6}, {{2. / 3, 1. / 6, 0}, 1. / 6}, {{1. / 6, 2. / 3, 0}, 1. / 6}};
}

/// The mid-points of the sides 01, 12, 20, of degree 2.
Rule mid_side_triangle()
{
  return {{{0.5, 0, 0}, 1. / 6}, {{0.5, 0.5, 0}, 1. / 6}, {{0, 0.5, 0}, 1. / 6}};
}

/// Four points of degree 2 (Hammer and Stroud 1956).
Rule four_point_tetrahedron()
{
  const double a = (5 - std::sqrt(5.)) / 20, b = 1 - 3 * a, w = 1. / 24;
  return {{{a, a, a}, w}, {{b, a, a}, w}, {{a, b, a}, w}, {{a, a, b}, w}};
}

/// The points with the shape's functions.
Quadrature evaluated(Shape shape, const Rule& rule)
{
  Quadrature result;
  for (const auto& [xi, weight] : rule) result.push_back({xi, weight, shape_functions(shape, xi)});
  return result;
}

/// The rules of all shapes.
std::vector<Quadrature> rules_of(Rule (*of)(Shape))
{
  std::vector<Quadrature> result;
  for (int i = 0; i <= static_cast<int>(Shape::hex27); ++i)
    result.push_back(evaluated(static_cast<Shape>(i), of(static_cast<Shape>(i))));
  return result;
}

Rule stiffness_points(Shape shape)
{
  if (shape == Shape::wedge6) return extruded(inner_triangle(), 2, 2);
  if (shape == Shape::tet10) return four_point_tetrahedron();
  if (shape == Shape::tet4) return {{{0.25, 0.25, 0.25}, 1. / 6}};
  if (shape == Shape::triangle3) return mid_side_triangle();
  return product_rule(shape, middles_of(shape).empty() ? 2 : 3);
}

Rule mass_points(Shape shape)
{
  if (shape == Shape::tet4) return four_point_tetrahedron();
  const bool three = middles_of(shape).empty() || dimension_of(shape) < 3 || shape == Shape::hex20;
  return product_rule(shape, three ? 3 : 4);
}

} // namespace

const Quadrature& stiffness_rule(Shape shape)
{
  static const std::vector<Quadrature> rules = rules_of(stiffness_points);
  return rules[static_cast<std::size_t>(shape)];
}

const Quadrature& mass_rule(Shape shape)
{
  static const std::vector<Quadrature> rules = rules_of(mass_points);
  return rules[static_cast<std::size_t>(shape)];
}

const Quadrature& triangle_rule()
{
  static const Quadrature rule = evaluated(Shape::triangle3, product_rule(Shape::triangle3, 4));
  return rule;
}

} // namespace squeal
