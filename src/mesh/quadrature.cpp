/// Quadrature rules: Gauss-Legendre products, Gauss-Legendre collapsed to simplices, and symmetric rules of degree 2.
///
/// Reference elements: xi_k in [-1, 1] of boxes; xi_k >= 0, sum xi_k <= 1 of simplices; their product of wedges;
/// |xi_1|, |xi_2| <= -xi_3 <= 1 of pyramids. Collapsed rules are conical products (Stroud 1971).
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

/// It is exact to degree 2 n - 2.
Rule on_triangle(int n)
{
  return collapsed(to_unit(on_box(n, 2), {0, 1}), 0, {1});
}

/// It is exact to degree 2 n - 3.
Rule on_tetrahedron(int n)
{
  return collapsed(collapsed(to_unit(on_box(n, 3), {0, 1, 2}), 1, {2}), 0, {1, 2});
}

/// It is exact for r^a s^b t^k of shapes.cpp with a, b and k + 2 up to 2 n - 1.
Rule on_pyramid(int n)
{
  Rule rule = collapsed(to_unit(on_box(n, 3), {2}), 2, {0, 1});
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
  static const auto rules = with_shape_functions({{Shape::hex8, on_box(2, 3)},
                                                  {Shape::hex20, on_box(3, 3)},
                                                  {Shape::hex27, on_box(3, 3)},
                                                  {Shape::wedge6, extruded(inner_triangle(), 2, 2)},
                                                  {Shape::wedge15, extruded(on_triangle(3), 2, 3)},
                                                  {Shape::wedge18, extruded(on_triangle(3), 2, 3)},
                                                  {Shape::pyramid5, on_pyramid(2)},
                                                  {Shape::pyramid13, on_pyramid(3)},
                                                  {Shape::pyramid14, on_pyramid(3)},
                                                  {Shape::tet10, four_point_tetrahedron()},
                                                  {Shape::tet4, {{{0.25, 0.25, 0.25}, 1. / 6}}},
                                                  {Shape::quad4, on_box(2, 2)},
                                                  {Shape::triangle3, mid_side_triangle()}});
  return rules.at(shape);
}

const Quadrature& mass_rule(Shape shape)
{
  static const auto rules = with_shape_functions({{Shape::hex8, on_box(3, 3)},
                                                  {Shape::hex20, on_box(3, 3)},
                                                  {Shape::hex27, on_box(4, 3)},
                                                  {Shape::wedge6, extruded(on_triangle(3), 2, 3)},
                                                  {Shape::wedge15, extruded(on_triangle(4), 2, 4)},
                                                  {Shape::wedge18, extruded(on_triangle(4), 2, 4)},
                                                  {Shape::pyramid5, on_pyramid(4)},
                                                  {Shape::pyramid13, on_pyramid(4)},
                                                  {Shape::pyramid14, on_pyramid(4)},
                                                  {Shape::tet10, on_tetrahedron(4)},
                                                  {Shape::tet4, four_point_tetrahedron()},
                                                  {Shape::quad4, on_box(3, 2)},
                                                  {Shape::triangle3, on_triangle(3)},
                                                  {Shape::quad8, on_box(3, 2)},
                                                  {Shape::quad9, on_box(3, 2)},
                                                  {Shape::triangle6, on_triangle(3)}});
  return rules.at(shape);
}

const Quadrature& triangle_rule(int n)
{
  static const std::array<Quadrature, 2> rules = []
  {
    std::array<Quadrature, 2> result;
    for (const int points : {3, 4})
      for (const auto& [xi, weight] : on_triangle(points))
        result[points - 3].push_back({xi, weight, shape_functions(Shape::triangle3, xi)});
    return result;
  }();
  return rules.at(n - 3);
}

} // namespace squeal
