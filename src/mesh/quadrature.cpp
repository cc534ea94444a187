/// Quadrature rules: Gauss-Legendre products, Gauss-Legendre collapsed to simplices, and symmetric rules of degree 2.
///
/// Reference elements: xi_k in [-1, 1] of boxes; xi_k >= 0, sum xi_k <= 1 of simplices; their product of wedges.
/// Collapsed rules are conical products (Stroud 1971): x = a, y = b (1 - a), z = c (1 - a)(1 - b), a b c in [0, 1].
#include "squeal/mesh/shape_functions.hpp"

#include <cmath>
#include <map>

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

Rule square(int n)
{
  Rule rule;
  for (const auto& a : gauss(n))
    for (const auto& b : gauss(n)) rule.push_back({{a.x, b.x, 0}, a.weight * b.weight});
  return rule;
}

/// Product of a plane rule and a Gauss-Legendre rule of n points along zeta.
Rule extruded(const Rule& plane, int n)
{
  Rule rule;
  for (const auto& p : plane)
    for (const auto& c : gauss(n)) rule.push_back({{p.xi(0), p.xi(1), c.x}, p.weight * c.weight});
  return rule;
}

Rule cube(int n)
{
  return extruded(square(n), n);
}

/// The square's rule collapsed to the unit triangle; it is exact to degree 2 n - 2.
Rule collapsed_triangle(int n)
{
  Rule rule;
  for (const auto& [xi, weight] : square(n))
  {
    const double a = 0.5 * (1 + xi(0)), b = 0.5 * (1 + xi(1));
    rule.push_back({{a, b * (1 - a), 0}, 0.25 * weight * (1 - a)});
  }
  return rule;
}

/// The cube's rule collapsed to the unit tetrahedron; it is exact to degree 2 n - 3.
Rule collapsed_tetrahedron(int n)
{
  Rule rule;
  for (const auto& [xi, weight] : cube(n))
  {
    const Eigen::Vector3d t = 0.5 * (xi.array() + 1);
    const double b = t(1) * (1 - t(0));
    rule.push_back({{t(0), b, t(2) * (1 - t(0) - b)}, weight / 8 * (1 - t(0)) * (1 - t(0) - b)});
  }
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

/// Evaluates each shape's functions at the points of its rule.
std::map<Shape, Quadrature> with_shape_functions(const std::map<Shape, Rule>& rules)
{
  std::map<Shape, Quadrature> result;
  for (const auto& [shape, rule] : rules)
    for (const auto& [xi, weight] : rule) result[shape].push_back({xi, weight, shape_functions(shape, xi)});
  return result;
}

} // namespace

const Quadrature& stiffness_rule(Shape shape)
{
  static const auto rules = with_shape_functions({{Shape::hex8, cube(2)},
                                                  {Shape::hex20, cube(3)},
                                                  {Shape::wedge6, extruded(inner_triangle(), 2)},
                                                  {Shape::tet10, four_point_tetrahedron()},
                                                  {Shape::tet4, {{{0.25, 0.25, 0.25}, 1. / 6}}},
                                                  {Shape::quad4, square(2)},
                                                  {Shape::triangle3, mid_side_triangle()}});
  return rules.at(shape);
}

const Quadrature& mass_rule(Shape shape)
{
  static const auto rules = with_shape_functions({{Shape::hex8, cube(3)},
                                                  {Shape::hex20, cube(3)},
                                                  {Shape::wedge6, extruded(collapsed_triangle(3), 3)},
                                                  {Shape::tet10, collapsed_tetrahedron(4)},
                                                  {Shape::tet4, four_point_tetrahedron()},
                                                  {Shape::quad4, square(3)},
                                                  {Shape::triangle3, collapsed_triangle(3)},
                                                  {Shape::quad8, square(3)},
                                                  {Shape::triangle6, collapsed_triangle(3)}});
  return rules.at(shape);
}

const Quadrature& triangle_rule(int n)
{
  static const std::array<Quadrature, 2> rules = []
  {
    std::array<Quadrature, 2> result;
    for (const int points : {3, 4})
      for (const auto& [xi, weight] : collapsed_triangle(points))
        result[points - 3].push_back({xi, weight, shape_functions(Shape::triangle3, xi)});
    return result;
  }();
  return rules.at(n - 3);
}

} // namespace squeal
