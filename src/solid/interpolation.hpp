#pragma once
/// Shape functions in natural coordinates and the quadrature rules that go with them.
#include "squeal/mesh/mesh.hpp"

#include <Eigen/Dense>
#include <span>
#include <vector>

namespace squeal
{

/// Matrices whose column count is known at run time only, but never needs the heap.
template <int rows, int most> using Columns = Eigen::Matrix<double, rows, Eigen::Dynamic, Eigen::ColMajor, rows, most>;
using NodePositions = Columns<3, 20>; // one node a column
using NodeValues = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 20, 1>;

/// Values and natural derivatives (rows xi, eta, zeta; one node a column) at one point.
struct Interpolation
{
  NodeValues N;
  Columns<3, 20> dN;
};

Interpolation interpolate(Shape shape, const Eigen::Vector3d& xi);
Interpolation interpolate(FaceShape shape, const Eigen::Vector3d& xi);

struct QuadraturePoint
{
  Eigen::Vector3d xi;
  double weight = 0;
};
using Quadrature = std::vector<QuadraturePoint>;

/// Full integration: exact where the element is a parallelepiped or has straight sides.
const Quadrature& stiffness_rule(Shape shape);
/// Exact for N_i N_j det(J) where the sides are straight.
const Quadrature& mass_rule(Shape shape);
/// Exact for N_i times the area vector, sides straight or curved.
const Quadrature& area_rule(FaceShape shape);

NodePositions columns_of(std::span<const Vec3> x);

} // namespace squeal
