#pragma once
/// Quadrature rules on the reference elements, each with the shape functions at its points. Rules are made once and
/// live as long as the program.
#include "squeal/mesh/shape_functions.hpp"

namespace squeal
{

/// A point of a rule in one dimension, on [-1, 1].
struct LinePoint
{
  double x = 0, weight = 0;
};

/// Gauss-Legendre rule of n = 2, 3 or 4 points; it is exact to degree 2 n - 1.
std::vector<LinePoint> gauss(int n);

/// A point of a rule.
struct QuadraturePoint
{
  Eigen::Vector3d xi; // [-] natural coordinates
  double weight = 0;  // [-] natural volume or area
  ShapeFunctions at;  // shape functions of the rule's shape at xi
};

using Quadrature = std::vector<QuadraturePoint>;

/// Returns the full integration of the stiffness; it is exact where the Jacobian is constant.
const Quadrature& stiffness_rule(Shape shape);

/// Returns a rule that is exact for N_i N_j det(J) where the sides are straight, and for N_i times the area vector of a
/// face, whether its sides are straight or curved.
const Quadrature& mass_rule(Shape shape);

/// Returns the rule of n x n points on the unit triangle, n = 3 or 4, with the functions of a 3-node triangle. It is
/// exact to degree 2 n - 2.
const Quadrature& triangle_rule(int n);

} // namespace squeal
