#pragma once
/// Shape functions of elements and faces, and integrals of them over faces (src/mesh/shapes.cpp). Arithmetic of one
/// rank; no function throws.
#include "squeal/mesh/mesh.hpp"

#include <Eigen/Dense>
#include <span>
#include <vector>

namespace squeal
{

/// Matrix with a number of columns known at run time and bounded by `most`, so that it needs no heap.
template <int rows, int most> using BoundedMatrix =
    Eigen::Matrix<double, rows, Eigen::Dynamic, Eigen::ColMajor, rows, most>;
using NodePositions = BoundedMatrix<3, 20>; // [m] one node a column
using NodeGradients = BoundedMatrix<3, 20>; // derivatives in three directions, one node a column
using NodeValues = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 20, 1>;

/// Values and derivatives of the shape functions at one point.
struct ShapeFunctions
{
  NodeValues N;     // [-]
  NodeGradients dN; // [-] d N_i / d xi_k in row k, column i
};

/// Natural coordinates of the nodes.
std::vector<Eigen::Vector3d> natural_positions(Shape shape);

/// Returns the shape functions at the natural coordinates xi. Those of shells and faces depend on xi(0), xi(1) alone.
ShapeFunctions shape_functions(Shape shape, const Eigen::Vector3d& xi);

/// The positions as columns.
NodePositions position_matrix(std::span<const Vec3> x);

/// Returns the consistent nodal weights of a face [m2], the integrals of N_i n dA.
/// The normal n points to where the nodes are counter-clockwise.
std::vector<Vec3> face_weights(Shape shape, std::span<const Vec3> x);

} // namespace squeal
