// ranks: 1 2 3
// Displacements carried from one mesh to another: by parts, points by name, and what lies outside of the coarse mesh.
#include "squeal/solid/interpolation.hpp"
#include "../support/bricks.hpp"
#include "squeal/mesh/location.hpp"

#include <algorithm>
#include <doctest/doctest.h>

using namespace squeal;
using namespace squeal::test;

namespace
{

const MPI_Comm& world = PETSC_COMM_WORLD; // set when the session starts
const Motions all{true, true, true, true, true, true};

/// Two blocks that touch at z = 0 without sharing nodes, a strip of shells away from them, and a point. The upper block
/// has the given part.
Mesh two_blocks(const Cells& low, const Cells& high, int part_of_high, const Scene& scene)
{
  Mesh mesh, above;
  add_box(mesh, "low", 0, {0, 0, -1}, {1, 1, 0}, low);
  add_box(above, "high", part_of_high, {0, 0, 0}, {1, 1, 1}, high);
  const auto offset = static_cast<int>(mesh.nodes.size());
  mesh.nodes.insert(mesh.nodes.end(), above.nodes.begin(), above.nodes.end());
  for (Element element : above.elements)
  {
    for (std::size_t i = 0; i < 8; ++i) element.nodes[i] += offset;
    mesh.elements.push_back(element);
  }
  add_strip(mesh, "strip", 2, {{3, 0, 0}, {1, 0, 0}, {0, 1, 0}, low[0], low[1]});
  add_points(mesh, scene);
  return mesh;
}

Scene scene_of_parts()
{
  Scene scene;
  const Material steel{210e9, 0.3, 7850};
  scene.parts = {{"low", steel, 0, {}}, {"high", steel, 0, {}}, {"strip", steel, 0.01, {}}};
  scene.points = {{"mass", {5, 5, 5}, 1, all}};
  return scene;
}

/// Linear in space, and another one above z = 0 and at the point.
std::array<double, 6> broken(const Vec3& x, bool above)
{
  const double s = above ? -2 : 1;
  return {s * (1 + x[0]), s * (2 - x[1] + 3 * x[2]), s * (x[2] - x[0]), s * x[1], s * 0.5, s * (x[0] - 1)};
}

/// Values of the broken field on the free degrees of freedom; z tells the blocks apart, and the bodies do at z = 0.
Owned<Vec> values(const Built& built, const Mesh& mesh)
{
  std::vector<bool> above(mesh.nodes.size(), false);
  for (const Element& element : mesh.elements)
  {
    double middle = 0;
    for (std::size_t i = 0; i < 8 && element.shape == Shape::hex8; ++i) middle += mesh.nodes[element.nodes[i]][2];
    for (std::size_t i = 0; i < 8 && middle > 0; ++i) above[static_cast<std::size_t>(element.nodes[i])] = true;
  }
  above[static_cast<std::size_t>(mesh.points.at("mass"))] = true;
  Owned<Vec> u = zeros_like(built.structure.load);
  double* entries = nullptr;
  check(VecGetArray(u, &entries));
  for (PetscInt dof = built.dofs.first; dof < built.dofs.last; ++dof)
  {
    const PetscInt nodal = built.dofs.names.nodal_dof[dof];
    entries[dof - built.dofs.first] = broken(mesh.nodes[nodal / 6], above[nodal / 6])[nodal % 6];
  }
  check(VecRestoreArray(u, &entries));
  return u;
}

/// Largest difference of what is carried from the field itself.
double error_of(const Cells& coarse, const Cells& fine, int part_of_high)
{
  const Scene scene = scene_of_parts();
  const Mesh from = two_blocks(coarse, {coarse[1], coarse[2], coarse[0]}, part_of_high, scene);
  const Mesh to = two_blocks(fine, {fine[2], fine[0], fine[1]}, part_of_high, scene);
  const Built first = build(from, scene, world), second = build(to, scene, world);
  const Interpolation interpolation({from, first.dofs}, {to, second.dofs}, scene, world);
  const Owned<Vec> u = values(first, from), expected = values(second, to), carried = zeros_like(expected);
  interpolation.apply(u, carried);
  check(VecAXPY(carried, -1, expected));
  double error = 0;
  check(VecNorm(carried, NORM_INFINITY, &error));
  return error;
}

} // namespace

TEST_CASE("linear fields are carried exactly, each side of a contact by its own")
{
  // fields are of order 10; Newton ends below 1e-13 of an element
  CHECK(error_of({2, 3, 2}, {3, 4, 5}, 1) < 1e-11);
  CHECK(error_of({1, 2, 1}, {5, 3, 2}, 0) < 1e-11);   // both blocks in one part
  CHECK(error_of({3, 2, 2}, {3, 2, 2}, 1) < 1e-11);   // the same mesh
  CHECK(error_of({100, 2, 3}, {1, 1, 2}, 0) < 1e-11); // the nodes' own elements are the larger ones
}

TEST_CASE("a node beyond the coarse mesh is carried along the line, and one far away is refused")
{
  Scene scene;
  scene.parts = {{"low", {210e9, 0.3, 7850}, 0, {}}};
  Mesh from, beyond, away;
  add_box(from, "low", 0, {0, 0, 0}, {1, 1, 1}, {2, 2, 2});
  add_box(beyond, "low", 0, {0, 0, 0}, {1.1, 1, 1}, {3, 3, 3}); // by 0.4 of half an element's width
  add_box(away, "low", 0, {0, 0, 0}, {1000, 1000, 1000}, {3, 3, 3});
  const Built first = build(from, scene, world), second = build(beyond, scene, world),
              third = build(away, scene, world);
  const Field field = rigid_motion({1, 2, 3}, {0.1, 0.2, 0.3});
  const Interpolation interpolation({from, first.dofs}, {beyond, second.dofs}, scene, world);
  const Owned<Vec> carried = zeros_like(second.structure.load), expected = sample(second.structure, field);
  interpolation.apply(sample(first.structure, field), carried);
  check(VecAXPY(carried, -1, expected));
  double error = 0;
  check(VecNorm(carried, NORM_INFINITY, &error));
  CHECK(error < 1e-12);
  CHECK_THROWS_WITH_AS(Interpolation({from, first.dofs}, {away, third.dofs}, scene, world),
                       doctest::Contains("lies outside of part 'low' of the coarse mesh"), Error);
}

TEST_CASE("natural coordinates of a point are those whose shape functions gave it")
{
  const std::vector<Vec3> corners = {{0, 0, 0},   {2, 0.1, 0}, {2.2, 1, 0.1}, {0, 1.2, 0},
                                     {0.1, 0, 1}, {2, 0, 1.3}, {2, 1, 1},     {0, 1, 1.1}};
  Mesh mesh;
  mesh.nodes = corners;
  const std::array<std::pair<Shape, std::vector<int>>, 4> elements = {{{Shape::hex8, {0, 1, 2, 3, 4, 5, 6, 7}},
                                                                       {Shape::wedge6, {0, 1, 3, 4, 5, 7}},
                                                                       {Shape::tet4, {0, 1, 3, 4}},
                                                                       {Shape::shell4, {0, 1, 2, 3}}}};
  for (const auto& [shape, nodes] : elements)
  {
    Element element{shape, 0, {}};
    std::ranges::copy(nodes, element.nodes.begin());
    mesh.elements = {element};
    const Eigen::Vector3d xi(0.2, 0.3, shape == Shape::shell4 ? 0 : 0.25);
    const ShapeFunctions at = shape_functions(shape, xi);
    Vec3 x{};
    for (std::size_t i = 0; i < nodes.size(); ++i)
      x = x + at.N(static_cast<Eigen::Index>(i)) * corners[static_cast<std::size_t>(nodes[i])];
    const Location found = located(mesh, 0, x);
    CHECK((found.xi - xi).norm() < 1e-12);
    CHECK(found.excess < 1e-12); // of a shell the distance from its surface, rounding
    CHECK(located(mesh, 0, x + Vec3{9, 0, 0}).excess > 1);
  }
}
