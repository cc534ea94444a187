#pragma once
/// Shape functions of elements and faces, and integrals of them over faces (src/mesh/shapes.cpp). Arithmetic of one
/// rank; no function throws.
#include "squeal/mesh/mesh.hpp"

#include <Eigen/Dense>
#include <optional>
#include <span>
#include <vector>

namespace squeal
{

/// Matrix with a number of columns known at run time and bounded by `most`, so that it needs no heap.
template <int rows, int most> using BoundedMatrix =
    Eigen::Matrix<double, rows, Eigen::Dynamic, Eigen::ColMajor, rows, most>;
constexpr int most_nodes = 27;                      // of an element
using NodePositions = BoundedMatrix<3, most_nodes>; // [m] one node a column
using NodeGradients = BoundedMatrix<3, most_nodes>; // derivatives in three directions, one node a column
using NodeValues = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, most_nodes, 1>;

/// Values and derivatives of the shape functions at one point.
struct ShapeFunctions
{
  NodeValues N;     // [-]
  NodeGradients dN; // [-] d N_i / d xi_k in row k, column i
};

/// Natural coordinates of the nodes.
std::vector<Eigen::Vector3d> natural_positions(Shape shape);

/// Appends the nodes between corners to the corners' places.
void add_middles(Shape shape, std::vector<Eigen::Vector3d>& corners);

/// Natural coordinates of the mean of the nodes.
Eigen::Vector3d middle_of(Shape shape);

/// Returns the shape functions at the natural coordinates xi. Those of shells and faces depend on xi(0), xi(1) alone.
ShapeFunctions shape_functions(Shape shape, const Eigen::Vector3d& xi);

/// The positions as columns.
NodePositions position_matrix(std::span<const Vec3> x);

/// Returns the consistent nodal weights of a face [m2], the integrals of N_i n dA.
/// The normal n points to where the nodes are counter-clockwise.
std::vector<Vec3> face_weights(Shape shape, std::span<const Vec3> x);

// Topology of shapes, in gmsh's node order (gmsh reference manual, "Node ordering"). Node numbers count from 0 within
// the element or face. Tables of one rank; no function throws.

/// Returns the shape of a gmsh element type; nothing if squeal does not know it.
std::optional<Shape> shape_of(int gmsh_type);

/// Returns gmsh's number of the element type.
int gmsh_type(Shape shape);

/// Number of nodes, number of corners, dimension, and whether an element of this shape is a shell.
int node_count(Shape shape);
int corner_count(Shape shape);
int dimension_of(Shape shape);
bool is_shell(Shape shape);

/// Returns the nodes that the element or face uses.
std::span<const int> nodes_of(const Element& element);
std::span<const int> nodes_of(const Face& face);

/// Returns where nodes are [m].
std::vector<Vec3> positions_of(const Mesh& mesh, std::span<const int> nodes);

/// Returns the arms [m] from the nodes of an element to its middle surface, which a shell's offset [m] moves along its
/// normals.
std::vector<Vec3> arms_of(const Mesh& mesh, std::size_t element, double offset);

/// Returns the corners that each further node is in the middle of: 2 of a side, then 4 of a face, 8 of a box.
const std::vector<std::vector<int>>& middles_of(Shape shape);

/// Returns the corners of each face of a solid, counter-clockwise seen from outside. A triangle has -1 as its fourth.
std::span<const std::array<int, 4>> corner_faces(Shape shape);

/// Returns the corner nodes of each face of a solid, counter-clockwise seen from outside.
std::vector<std::vector<int>> faces_of(const Element& element);

/// Returns the face of an element with these corner nodes, in their order, and with the element's nodes between them.
Face face_on(const Element& element, std::span<const int> corners);

/// Reverses the orientation of an element: one numbered inside out has a positive Jacobian then.
void mirror(Element& element);

// Quadrature rules on the reference elements, each with the shape functions at its points. Rules are made once and
// live as long as the program.

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

/// Returns a rule that is exact for N_i N_j det(J) with straight sides, and for N_i times a face's area vector, with
/// curved sides too.
const Quadrature& mass_rule(Shape shape);

/// Returns the rule of 4 x 4 points on the unit triangle, with the functions of a 3-node triangle. It is exact to
/// degree 6.
const Quadrature& triangle_rule();

} // namespace squeal
