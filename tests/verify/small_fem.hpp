#pragma once
/// A finite element program of a page, to hold the kernels to exact answers. Meshes are by formula, of one material;
/// sparse matrices on one process. Displacements are prescribed by elimination, eigenpairs found by subspace
/// iteration.
#include "../support/approx.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/solid/element.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <functional>
#include <map>
#include <vector>

namespace small_fem
{

using squeal::Shape;
using squeal::Vec3;
using squeal::operator+;
using squeal::operator*;

struct Mesh
{
  Shape shape{};
  std::vector<Vec3> x;
  std::vector<std::vector<int>> elements;
};

struct Body
{
  Mesh mesh;
  squeal::Material material;
  double thickness = 0; // [m] shells only
};

inline std::vector<Vec3> positions(const Mesh& mesh, const std::vector<int>& element)
{
  std::vector<Vec3> x;
  for (int node : element) x.push_back(mesh.x[node]);
  return x;
}

/// Lattice of n[0] x n[1] x n[2] bricks; `place` maps the unit cube to space.
inline Mesh bricks(std::array<int, 3> n, const std::function<Vec3(double, double, double)>& place)
{
  Mesh mesh{Shape::hex8, {}, {}};
  const auto id = [&](int i, int j, int k) { return i + (n[0] + 1) * (j + (n[1] + 1) * k); };
  for (int k = 0; k <= n[2]; ++k)
    for (int j = 0; j <= n[1]; ++j)
      for (int i = 0; i <= n[0]; ++i) mesh.x.push_back(place(double(i) / n[0], double(j) / n[1], double(k) / n[2]));
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i)
        mesh.elements.push_back({id(i, j, k), id(i + 1, j, k), id(i + 1, j + 1, k), id(i, j + 1, k), id(i, j, k + 1),
                                 id(i + 1, j, k + 1), id(i + 1, j + 1, k + 1), id(i, j + 1, k + 1)});
  return mesh;
}

/// Lattice of quadrilaterals; `place` maps the unit square to space.
inline Mesh quads(int nx, int ny, const std::function<Vec3(double, double)>& place)
{
  Mesh mesh{Shape::quad4, {}, {}};
  for (int j = 0; j <= ny; ++j)
    for (int i = 0; i <= nx; ++i) mesh.x.push_back(place(double(i) / nx, double(j) / ny));
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i)
    {
      const int a = i + (nx + 1) * j, b = a + nx + 1;
      mesh.elements.push_back({a, a + 1, b + 1, b});
    }
  return mesh;
}

/// One mesh of several, coincident nodes made one; of one mesh, closes a ring.
inline Mesh joined(const std::vector<Mesh>& meshes)
{
  Mesh whole{meshes.front().shape, {}, {}};
  std::map<std::array<long, 3>, int> known;
  for (const auto& mesh : meshes)
    for (const auto& element : mesh.elements)
    {
      auto& nodes = whole.elements.emplace_back();
      for (const auto& x : positions(mesh, element))
      {
        const std::array<long, 3> key = {std::lround(x[0] * 1e7), std::lround(x[1] * 1e7), std::lround(x[2] * 1e7)};
        const auto [place, is_new] = known.try_emplace(key, static_cast<int>(whole.x.size()));
        if (is_new) whole.x.push_back(x);
        nodes.push_back(place->second);
      }
    }
  return whole;
}

/// The same nodes with other elements, `cuts` naming the old element's corners of each new one.
inline Mesh recut(const Mesh& mesh, Shape shape, const std::vector<std::vector<int>>& cuts)
{
  Mesh finer{shape, mesh.x, {}};
  for (const auto& element : mesh.elements)
    for (const auto& cut : cuts)
    {
      auto& nodes = finer.elements.emplace_back();
      for (int corner : cut) nodes.push_back(element[corner]);
    }
  return finer;
}

/// Nodes in the middle of sides, faces and boxes as the shape has them, shared between neighbours.
inline Mesh with_middles(Mesh mesh, Shape shape)
{
  mesh.shape = shape;
  std::map<std::vector<int>, int> middles;
  for (auto& element : mesh.elements)
    for (std::vector<int> corners : squeal::middles_of(shape))
    {
      for (int& corner : corners) corner = element[corner];
      std::sort(corners.begin(), corners.end());
      const auto [place, is_new] = middles.try_emplace(corners, static_cast<int>(mesh.x.size()));
      if (is_new)
      {
        Vec3 sum{};
        for (const int corner : corners) sum = sum + mesh.x[corner];
        mesh.x.push_back((1. / static_cast<double>(corners.size())) * sum);
      }
      element.push_back(place->second);
    }
  return mesh;
}

/// Each brick as six pyramids, whose apex is its middle.
inline Mesh pyramids(Mesh mesh)
{
  for (auto& element : mesh.elements)
  {
    Vec3 middle{};
    for (const int node : element) middle = middle + 0.125 * mesh.x[node];
    element.push_back(static_cast<int>(mesh.x.size()));
    mesh.x.push_back(middle);
  }
  return recut(mesh, Shape::pyramid5,
               {{0, 1, 2, 3, 8}, {0, 4, 5, 1, 8}, {0, 3, 7, 4, 8}, {5, 6, 2, 1, 8}, {2, 6, 7, 3, 8}, {4, 7, 6, 5, 8}});
}

/// A mesh of bricks or quadrilaterals as the same domain in another shape; mid-sides in gmsh's order.
inline Mesh in_shape(const Mesh& bricks, Shape shape)
{
  switch (shape)
  {
  case Shape::triangle3:
    return recut(bricks, shape, {{0, 1, 2}, {0, 2, 3}});
  case Shape::triangle6:
    return with_middles(in_shape(bricks, Shape::triangle3), shape);
  case Shape::wedge6:
    return recut(bricks, shape, {{0, 1, 2, 4, 5, 6}, {0, 2, 3, 4, 6, 7}});
  case Shape::wedge15:
  case Shape::wedge18:
    return with_middles(in_shape(bricks, Shape::wedge6), shape);
  case Shape::pyramid5:
    return pyramids(bricks);
  case Shape::pyramid13:
  case Shape::pyramid14:
    return with_middles(pyramids(bricks), shape);
  case Shape::quad8:
  case Shape::quad9:
  case Shape::hex20:
  case Shape::hex27:
    return with_middles(bricks, shape);
  case Shape::tet4:
    return recut(bricks, shape, {{0, 1, 2, 6}, {0, 2, 3, 6}, {0, 3, 7, 6}, {0, 7, 4, 6}, {0, 4, 5, 6}, {0, 5, 1, 6}});
  case Shape::tet10:
    return with_middles(in_shape(bricks, Shape::tet4), shape);
  default:
    return bricks;
  }
}

/// A lattice of shells; those of more than four nodes have half as many cells, so that a side has as many nodes. All
/// nodes are where `place` maps the unit square.
inline Mesh shells(Shape shape, int nx, int ny, const std::function<Vec3(double, double)>& place)
{
  const int half = squeal::node_count(shape) > 4 ? 2 : 1;
  Mesh mesh = in_shape(quads(nx / half, ny / half, [](double x, double y) { return Vec3{x, y, 0}; }), shape);
  for (Vec3& x : mesh.x) x = place(x[0], x[1]);
  return mesh;
}

using Sparse = Eigen::SparseMatrix<double>;

struct System
{
  Sparse K, M;
};

inline System assemble(const Body& body)
{
  const int per_node = squeal::dofs_per_node(body.mesh.shape);
  const auto size = static_cast<Eigen::Index>(body.mesh.x.size()) * per_node;
  std::vector<Eigen::Triplet<double>> K, M;
  for (const auto& element : body.mesh.elements)
  {
    const auto x = positions(body.mesh, element);
    const auto matrices = squeal::element_matrices(body.mesh.shape, x, body.material, body.thickness);
    const int n = static_cast<int>(element.size()) * per_node;
    const auto global = [&](int i) { return element[i / per_node] * per_node + i % per_node; };
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
      {
        K.emplace_back(global(i), global(j), matrices.stiffness(i, j));
        M.emplace_back(global(i), global(j), matrices.mass(i, j));
      }
  }
  System system{Sparse(size, size), Sparse(size, size)};
  system.K.setFromTriplets(K.begin(), K.end());
  system.M.setFromTriplets(M.begin(), M.end());
  return system;
}

using Prescribed = std::map<int, double>; // degree of freedom -> value

/// Columns of the identity that belong to the degrees of freedom not prescribed.
inline Sparse free_columns(Eigen::Index size, const Prescribed& prescribed)
{
  std::vector<Eigen::Triplet<double>> ones;
  int column = 0;
  for (int dof = 0; dof < size; ++dof)
    if (!prescribed.contains(dof)) ones.emplace_back(dof, column++, 1.);
  Sparse F(size, column);
  F.setFromTriplets(ones.begin(), ones.end());
  return F;
}

/// K u = load with u prescribed where it is.
inline Eigen::VectorXd solve(const Sparse& K, const Eigen::VectorXd& load, const Prescribed& prescribed)
{
  Eigen::VectorXd u = Eigen::VectorXd::Zero(K.rows());
  for (const auto& [dof, value] : prescribed) u(dof) = value;
  const Sparse F = free_columns(K.rows(), prescribed);
  if (F.cols() == 0) return u;
  const Sparse Kf = F.transpose() * K * F;
  const Eigen::SimplicialLDLT<Sparse> factor(Kf);
  return u + F * factor.solve(F.transpose() * (load - K * u));
}

/// The lowest `count` frequencies [Hz], u = 0 where prescribed, by subspace iteration with K + shift M factored;
/// shift > 0 [1/s2] of the order of the wanted eigenvalues admits rigid motions.
inline std::vector<double> frequencies(const System& system, const Prescribed& prescribed, int count, double shift)
{
  const Sparse F = free_columns(system.K.rows(), prescribed);
  const Sparse K = F.transpose() * system.K * F, M = F.transpose() * system.M * F;
  const Eigen::SimplicialLDLT<Sparse> factor(Sparse(K + shift * M));
  const auto block = std::min<Eigen::Index>(K.rows(), 2 * count + 8);
  std::srand(1);
  Eigen::MatrixXd V = Eigen::MatrixXd::Random(K.rows(), block);
  Eigen::VectorXd values = Eigen::VectorXd::Zero(block);
  for (int pass = 0; pass < 60; ++pass)
  {
    V = factor.solve(M * V).eval();
    const Eigen::MatrixXd k = V.transpose() * (K * V), m = V.transpose() * (M * V);
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> small(k, m);
    V = (V * small.eigenvectors()).eval();
    const double change = (small.eigenvalues() - values).head(count).cwiseAbs().maxCoeff();
    values = small.eigenvalues();
    if (change < 1e-10 * std::abs(values(count - 1))) break;
  }
  std::vector<double> hertz;
  for (int i = 0; i < count; ++i) hertz.push_back(std::sqrt(std::max(values(i), 0.)) / (2 * M_PI));
  return hertz;
}

} // namespace small_fem
