// ranks: 1 2 3
// A shell that meets a solid at shared nodes or is tied to it: free of energy in rigid motions, and stiff in bending.
#include "../support/bricks.hpp"
#include "squeal/mesh/contact_pairs.hpp"

#include <algorithm>
#include <doctest/doctest.h>

using namespace squeal;
using namespace squeal::test;

namespace
{

const MPI_Comm& world = PETSC_COMM_WORLD; // set when the session starts
const Motions all{true, true, true, true, true, true};
constexpr double length = 0.2, width = 0.1, thickness = 0.004, young = 210e9;

/// A cube of edge 0.1 with a strip that stands out of the middle of its face x = 0.1, as wide as the face.
Mesh cube_and_strip(int cells)
{
  Mesh mesh;
  add_box(mesh, "cube", 0, {0, 0, -0.05}, {0.1, 0.1, 0.05}, {cells, cells, cells});
  add_strip(mesh, "strip", 1, {{0.1, 0, 0}, {length, 0, 0}, {0, width, 0}, 2 * cells, cells});
  return mesh;
}

Scene two_parts()
{
  Scene scene;
  scene.parts = {{"cube", {young, 0, 7850}, 0, {}}, {"strip", {young, 0, 7850}, thickness, {}}};
  return scene;
}

Scene tied_parts(const Tie& tie)
{
  Scene scene = two_parts();
  scene.ties = {tie};
  return scene;
}

void check_free_of_energy(const Mesh& mesh, const Scene& scene)
{
  const auto built = build(mesh, scene, world);
  double size = 0;
  check(MatNorm(built.structure.K, NORM_INFINITY, &size));
  for (int k = 0; k < 6; ++k)
  {
    const auto u = sample(built.structure, unit_rigid_motion(k));
    // The rotations of shared nodes follow sums over some 20 nodes at lever arms of 1e-2 of the field's size.
    CHECK(largest_of_product(built.structure.K, u) < 1e-11 * size);
  }
}

/// A beam of bricks, 1 long, with a skin of shells on top, whose middle surface is half its thickness above.
Mesh beam_and_skin(double height, double skin)
{
  Mesh mesh, top;
  add_box(mesh, "cube", 0, {0, 0, 0}, {1, width, height}, {20, 2, 2});
  add_strip(top, "strip", 1, {{1, 0, height + skin / 2}, {-1, 0, 0}, {0, width, 0}, 30, 3});
  for (const Element& shell : top.elements)
  {
    Face face{Shape::quad4, {}, true};
    std::copy_n(shell.nodes.begin(), 4, face.nodes.begin());
    top.surfaces["strip"].push_back(face);
  }
  append(mesh, top);
  return mesh;
}

Owned<Vec> static_solution(const Structure& structure)
{
  Owned<KSP> solver;
  Owned<Vec> u = zeros_like(structure.load);
  check(KSPCreate(world, solver.put()));
  check(KSPSetOperators(solver, structure.K, structure.K));
  PC preconditioner = nullptr;
  check(KSPSetType(solver, KSPPREONLY));
  check(KSPGetPC(solver, &preconditioner));
  check(PCSetType(preconditioner, PCCHOLESKY));
  check(PCFactorSetMatSolverType(preconditioner, MATSOLVERMUMPS));
  check(KSPSolve(solver, structure.load, u));
  return u;
}

double motion_at(const Mesh& mesh, const Built& built, Vec u, const Vec3& at, int component)
{
  Mesh copy = mesh;
  const int node = node_at(copy, at);
  double value = 0;
  for (const DofTerm& term : built.dofs.terms_of(6 * node + component))
    if (term.dof >= built.dofs.first && term.dof < built.dofs.last)
    {
      double entry = 0;
      check(VecGetValues(u, 1, &term.dof, &entry));
      value += term.factor * entry;
    }
  double sum = 0;
  MPI_Allreduce(&value, &sum, 1, MPI_DOUBLE, MPI_SUM, world);
  return sum;
}

} // namespace

TEST_CASE("a shell on a solid, with a rigid cap and a spring, has six motions without energy")
{
  Scene scene = two_parts();
  scene.rigid_bodies = {{"cap", {"strip:end"}, {0.4, 0.05, 0.02}, 1, {0.1, 0.1, 0.1}, all}};
  Mesh mesh = cube_and_strip(2);
  add_points(mesh, scene);
  check_free_of_energy(mesh, scene);
}

TEST_CASE("a shell tied to a solid by its face has six motions without energy, and a gap between them too")
{
  check_free_of_energy(beam_and_skin(0.04, 0.01), tied_parts({"strip", "cube:z+", 0.006}));
}

TEST_CASE("a solid may be tied by a face that has nodes of a shell, and moves freely")
{
  Mesh mesh = cube_and_strip(2), base;
  add_box(base, "base", 2, {0, -0.1, -0.05}, {0.1, 0, 0.05}, {3, 3, 3});
  append(mesh, base);
  Scene scene = tied_parts({"cube:y-", "base:y+", 0});
  scene.parts.push_back({"base", {young, 0, 7850}, 0, {}});
  check_free_of_energy(mesh, scene);
}

TEST_CASE("the rotation of a shared node is the solid's: exact where the solid turns rigidly, no freedom of its own")
{
  const Mesh mesh = cube_and_strip(2);
  const auto built = build(mesh, two_parts(), world);
  const Vec3 turn{0.3, -0.2, 0.5};
  const auto u = sample(built.structure, rigid_motion({1, 2, 3}, turn));
  for (int c = 0; c < 3; ++c)
    CHECK(motion_at(mesh, built, u, {0.1, 0.05, 0}, 3 + c) ==
          doctest::Approx(turn[static_cast<std::size_t>(c)]).epsilon(1e-12));
  const auto& nodal_dofs = built.structure.names.nodal_dof;
  Mesh copy = mesh;
  const int shared = node_at(copy, {0.1, 0.05, 0});
  CHECK(std::count_if(nodal_dofs.begin(), nodal_dofs.end(), [&](PetscInt i) { return i / 6 == shared; }) == 3);
}

TEST_CASE("a cantilever strip on a cube bends like a clamped beam")
{
  // Deflection and rotation are 0.9989 and 0.9971 of the beam's with 2 cells, 0.9996 and 0.9983 with 4.
  // Beam: deflection F L^3/(3 E I), rotation F L^2/(2 E I); a joint that let moments slip would be a hinge, and K
  // singular.
  const double inertia = width * thickness * thickness * thickness / 12, force = 10;
  const double deflection = force * std::pow(length, 3) / (3 * young * inertia);
  const double rotation = force * length * length / (2 * young * inertia);
  for (const int cells : {2, 4})
  {
    Scene scene = two_parts();
    scene.supports = {{"cube:x-", all}};
    scene.forces = {{"strip:end", {0, 0, force}}};
    const Mesh mesh = cube_and_strip(cells);
    const auto built = build(mesh, scene, world);
    const auto u = static_solution(built.structure);
    const double w = motion_at(mesh, built, u, {0.1 + length, 0, 0}, 2) / deflection;
    const double ry = -motion_at(mesh, built, u, {0.1 + length, 0, 0}, 4) / rotation;
    CHECK(w == doctest::Approx(1).epsilon(0.01));
    CHECK(ry == doctest::Approx(1).epsilon(0.01));
  }
}

TEST_CASE("a beam with a tied skin bends like one of both heights")
{
  // Shear of the beam leaves 1.5e-3. Without the lever arm from the surface to the skin's middle w would be 1.21 times
  // as large.
  const double height = 0.04, skin = 0.01, force = 10;
  Scene scene = tied_parts({"strip", "cube:z+", 0.006});
  scene.parts[1].thickness = skin;
  scene.supports = {{"cube:x-", all}, {"strip:end", all}};
  scene.forces = {{"cube:x+", {0, 0, force}}};
  const Mesh mesh = beam_and_skin(height, skin);
  const auto built = build(mesh, scene, world);
  const double w = motion_at(mesh, built, static_solution(built.structure), {1, 0, 0}, 2);
  const double both = height + skin, bending = 4 * force / (young * width * both * both * both);
  CHECK(std::abs(w / bending - 1) < 0.01);
}

TEST_CASE("a shared node of a rigid body turns with the body")
{
  Scene scene = two_parts();
  scene.rigid_bodies = {{"clamp", {"cube:x+"}, {0.1, 0.05, 0}, 1, {1, 1, 1}, all}};
  Mesh mesh = cube_and_strip(2);
  add_points(mesh, scene);
  const auto built = build(mesh, scene, world);
  Mesh copy = mesh;
  const auto terms = built.dofs.terms_of(6 * node_at(copy, {0.1, 0.1, 0}) + 4);
  REQUIRE(terms.size() == 1);
  CHECK(terms[0].factor == 1);
  CHECK(describe(built.dofs.names, terms[0].dof).find("rigid body clamp") == 0);
}

TEST_CASE("a solid does not follow a shell from afar, which cannot turn it")
{
  const Mesh mesh = beam_and_skin(0.04, 0.01);
  CHECK_THROWS_WITH_AS((void)tied_nodes(mesh, tied_parts({"cube:z+", "strip", 0.006})),
                       doctest::Contains("exchange slave and master"), Error);
}
