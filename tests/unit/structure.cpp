// ranks: 1 2 3
// Assembly and constraints by their exact invariants: rigid motions, masses and inertias, point models, resultants.
// Tolerances are round-off of sums of some thousand terms unless said otherwise.
#include "squeal/solid/structure.hpp"
#include "../support/approx.hpp"
#include "../support/bricks.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/solid/binary.hpp"

#include <algorithm>
#include <doctest/doctest.h>

using namespace squeal;
using namespace squeal::test;

namespace
{

const MPI_Comm& world = PETSC_COMM_WORLD; // set when the session starts
constexpr double round_off = 1e-12;
const Material steel{210e9, 0.3, 7850};
const Motions all{true, true, true, true, true, true};

Scene one_part()
{
  Scene scene;
  scene.parts = {{"block", steel, 0, {}}};
  return scene;
}

Mesh box(const Vec3& size, const Cells& cells)
{
  Mesh mesh;
  add_box(mesh, "block", 0, {}, size, cells);
  return mesh;
}

const Field wavy = [](const Vec3& x) -> std::array<double, 6>
{
  return {std::sin(9 * x[0] + 2 * x[1]), std::cos(7 * x[1] - x[2]), x[0] * x[2], std::sin(5 * x[2]), x[0], x[1] * x[1]};
};

double norm_of(Mat A)
{
  double value = 0;
  check(MatNorm(A, NORM_INFINITY, &value));
  return value;
}

/// Largest nodal force of a motion that should need none, over the largest that its size could give.
double relative_force(Mat K, Vec u)
{
  Owned<Vec> force = zeros_like(u);
  check(MatMult(K, u, force));
  double largest = 0, size = 0;
  check(VecNorm(force, NORM_INFINITY, &largest));
  check(VecNorm(u, NORM_INFINITY, &size));
  return largest / (size * norm_of(K));
}

} // namespace

TEST_CASE("a free body feels no force in a rigid motion, and has its mass and inertia")
{
  const Scene scene = one_part();
  const Vec3 size{0.3, 0.2, 0.1};
  const auto built = build(box(size, {3, 2, 2}), scene, world);
  CHECK(built.dofs.size == 3 * 4 * 3 * 3);
  for (const auto& motion : {rigid_motion({1, 2, 3}, {}), rigid_motion({}, {1, -2, 0.5})})
    CHECK(relative_force(built.structure.K, sample(built.structure, motion)) < round_off);
  const double mass = 7850 * size[0] * size[1] * size[2];
  const auto x = sample(built.structure, rigid_motion({1, 0, 0}, {}));
  CHECK(form(built.structure.M, x, x) == approx(mass, round_off));
  // A rotation is linear in space: the elements hold it, and their mass integrates its square exactly.
  const auto rz = sample(built.structure, rigid_motion({}, {0, 0, 1}));
  CHECK(form(built.structure.M, rz, rz) == approx(mass * (size[0] * size[0] + size[1] * size[1]) / 3, round_off));
}

TEST_CASE("the matrices do not depend on the number of ranks")
{
  Scene scene = one_part();
  scene.damping = {3, 1e-6};
  scene.rigid_bodies = {{"cap", {"block:z+"}, {0.1, 0.1, 0.2}, 2, {0.1, 0.2, 0.3, 0.01, 0.02, 0.03}, all}};
  scene.springs = {{"cap", "ground", {0, 0, 1}, 1e6, 5}};
  Mesh mesh;
  add_box(mesh, "block", 0, {}, {0.3, 0.2, 0.1}, {3, 3, 3});
  scene.supports = {{"block:z-", all}};
  scene.pressures = {{"block:y+", 2e5}};
  add_points(mesh, scene);
  const auto together = build(mesh, scene, world);
  const auto alone = build(mesh, scene, PETSC_COMM_SELF);
  CHECK(together.dofs.size == alone.dofs.size);
  const auto u = sample(together.structure, wavy), v = sample(alone.structure, wavy);
  CHECK(form(together.structure.M, u, u) == approx(form(alone.structure.M, v, v), round_off));
  CHECK(form(together.structure.C, u, u) == approx(form(alone.structure.C, v, v), round_off));
  CHECK(form(together.structure.K, u, u) == approx(form(alone.structure.K, v, v), round_off));
  CHECK(work(together.structure, wavy) == approx(work(alone.structure, wavy), round_off));
}

TEST_CASE("M, C and K have one pattern, counted exactly before they are filled")
{
  Scene scene = one_part();
  scene.rigid_bodies = {{"cap", {"block:z+"}, {0.1, 0.1, 0.2}, 2, {}, all}};
  Mesh mesh = box({0.3, 0.2, 0.1}, {3, 2, 2});
  add_points(mesh, scene);
  const auto built = build(mesh, scene, world);
  std::array<double, 3> entries{};
  std::size_t k = 0;
  for (Mat A : {built.structure.M.get(), built.structure.C.get(), built.structure.K.get()})
  {
    MatInfo info;
    check(MatGetInfo(A, MAT_GLOBAL_SUM, &info));
    CHECK(info.mallocs == 0);
    CHECK(info.nz_used == info.nz_allocated);
    entries[k++] = info.nz_used;
    PetscBool known = PETSC_FALSE, symmetric = PETSC_FALSE;
    check(MatIsSymmetricKnown(A, &known, &symmetric));
    CHECK((known && symmetric));
  }
  CHECK(entries[0] == entries[1]);
  CHECK(entries[0] == entries[2]);
}

TEST_CASE("damping is alpha M + beta K, of the part where it has its own")
{
  Scene scene = one_part();
  scene.damping = {3, 1e-6};
  const Mesh mesh = box({0.3, 0.2, 0.1}, {2, 2, 2});
  const auto of_form = [&](double alpha, double beta)
  {
    const auto built = build(mesh, scene, world);
    const auto u = sample(built.structure, wavy);
    CHECK(form(built.structure.C, u, u) ==
          approx(alpha * form(built.structure.M, u, u) + beta * form(built.structure.K, u, u), round_off));
  };
  of_form(3, 1e-6);
  scene.parts[0].damping = RayleighDamping{7, 2e-6};
  of_form(7, 2e-6);
}

TEST_CASE("points, springs and dashpots give the oscillator's matrices")
{
  // K_pad = [[1.1, -0.1], [-0.1, 0.5]]: springs 1 along x, 0.4 along y, 0.2 along the diagonal (1, -1)/sqrt(2).
  const double s = std::sqrt(0.5);
  Scene scene;
  scene.points = {{"pad", {0, 0, 0}, 1, {true, true}}, {"disc", {0, 0, 0}, 0.5, {false, true}}};
  scene.springs = {{"pad", "ground", {1, 0, 0}, 1, 0.02},
                   {"pad", "ground", {0, 1, 0}, 0.4, 0.02},
                   {"ground", "pad", {s, -s, 0}, 0.2, 0},
                   {"disc", "ground", {0, 1, 0}, 1.2, 0.02},
                   {"disc", "pad", {0, 1, 0}, 5, 0.3}};
  scene.forces = {{"pad", {0, -1, 0}}};
  Mesh mesh;
  add_points(mesh, scene);
  const Partition partition{std::vector<int>{0, ranks_of(world) - 1}};
  const DofMap dofs = number_dofs(mesh, scene, partition, world);
  const Structure structure = assemble({mesh, partition, dofs}, scene, world);
  REQUIRE(dofs.size == 3); // pad x, pad y, disc y
  const double M[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 0.5}};
  const double C[3][3] = {{0.02, 0, 0}, {0, 0.32, -0.3}, {0, -0.3, 0.32}};
  const double K[3][3] = {{1.1, -0.1, 0}, {-0.1, 5.5, -5}, {0, -5, 6.2}};
  for (PetscInt i = dofs.first; i < dofs.last; ++i)
    for (PetscInt j = 0; j < 3; ++j)
    {
      double m = 0, c = 0, k = 0;
      check(MatGetValues(structure.M, 1, &i, 1, &j, &m));
      check(MatGetValues(structure.C, 1, &i, 1, &j, &c));
      check(MatGetValues(structure.K, 1, &i, 1, &j, &k));
      CHECK(m == M[i][j]);
      CHECK(c == doctest::Approx(C[i][j]).epsilon(1e-15));
      CHECK(k == doctest::Approx(K[i][j]).epsilon(1e-15));
    }
  CHECK(work(structure, rigid_motion({1, 2, 3}, {})) == -2);
  CHECK(describe(dofs.names, 2) == "point disc, node 1 at (0, 0, 0), direction y");
}

TEST_CASE("a rigid body is the exact constraint u = u_ref + theta x r")
{
  Scene scene = one_part();
  Mesh mesh = box({0.3, 0.2, 0.1}, {3, 2, 2});
  const auto unconstrained = build(mesh, scene, world);
  const Vec3 reference{0.1, 0.4, 0.3};
  const double m = 5, Ixx = 0.3, Iyy = 0.2, Izz = 0.4, Ixy = 0.05, Iyz = -0.02, Izx = 0.01;
  scene.rigid_bodies = {{"cap", {"block:z+", "block:x+"}, reference, m, {Ixx, Iyy, Izz, Ixy, Iyz, Izx}, all}};
  scene.forces = {{"block:x+", {0, 700, 0}}};
  add_points(mesh, scene);
  const auto built = build(mesh, scene, world);
  const auto& structure = built.structure;
  // The cap moves rigidly, all else is held still: the energies are those of the free block moved alike at its nodes.
  const Vec3 shift{1e-3, -2e-3, 3e-3}, turn{0.02, -0.03, 0.05};
  const auto cap = [&](const Vec3& x) -> std::array<double, 6>
  {
    const bool tied = x[2] > 0.1 - 1e-9 || x[0] > 0.3 - 1e-9;
    if (!tied) return {};
    const Vec3 u = shift + cross(turn, x - reference);
    return {u[0], u[1], u[2], turn[0], turn[1], turn[2]};
  };
  const auto u = sample(structure, cap), nodal = sample(unconstrained.structure, cap);
  CHECK(form(structure.K, u, u) == approx(form(unconstrained.structure.K, nodal, nodal), round_off));
  const double rotary = Ixx * turn[0] * turn[0] + Iyy * turn[1] * turn[1] + Izz * turn[2] * turn[2] +
                        2 * (Ixy * turn[0] * turn[1] + Iyz * turn[1] * turn[2] + Izx * turn[2] * turn[0]);
  CHECK(form(structure.M, u, u) ==
        approx(form(unconstrained.structure.M, nodal, nodal) + m * dot(shift, shift) + rotary, round_off));
  CHECK(relative_force(structure.K, sample(structure, rigid_motion({1, 2, 3}, {0.4, 0.5, 0.6}))) < round_off);
  // Its face's force arrives at the reference point with its moment: work = F . u(face centre).
  const auto rigid = rigid_motion({1, 2, 3}, {0.4, 0.5, 0.6});
  CHECK(work(structure, rigid) == approx(700 * rigid({0.3, 0.1, 0.05})[1], round_off));
}

TEST_CASE("a rigid body that may only move along its normal carries one degree of freedom")
{
  Scene scene = one_part();
  scene.rigid_bodies = {{"cap", {"block:z+"}, {0.15, 0.1, 0.2}, 5, {}, {false, false, true}}};
  scene.supports = {{"block:z-", all}, {"block:z+", {true, true}}}; // the second holds what the body holds: no quarrel
  Mesh mesh = box({0.3, 0.2, 0.1}, {3, 2, 1});
  add_points(mesh, scene);
  const auto built = build(mesh, scene, world);
  CHECK(built.dofs.size == 1);
  CHECK(describe(built.dofs.names, 0).find("rigid body cap") == 0);
}

TEST_CASE("a support on nodes of a rigid body holds the body as far as they do")
{
  Scene scene = one_part();
  Mesh mesh = box({0.3, 0.2, 0.1}, {3, 2, 2});
  const auto unconstrained = build(mesh, scene, world);
  const Vec3 reference{0.15, 0.1, 0.2};
  scene.rigid_bodies = {{"cap", {"block:z+"}, reference, 0, {}, all}};
  scene.supports = {{"block:x-", {false, false, true}}}; // an edge of the cap, about which it can still turn
  add_points(mesh, scene);
  const auto built = build(mesh, scene, world);
  const Vec3 turn{0, -0.03, 0.05}, shift{1e-3, -2e-3, -reference[0] * turn[1]};
  const auto cap = [&](const Vec3& x) -> std::array<double, 6>
  {
    if (x[2] < 0.1 - 1e-9) return {};
    const Vec3 u = shift + cross(turn, x - reference);
    return {u[0], u[1], u[2], turn[0], turn[1], turn[2]};
  };
  const auto u = sample(built.structure, cap), nodal = sample(unconstrained.structure, cap);
  CHECK(form(built.structure.K, u, u) == approx(form(unconstrained.structure.K, nodal, nodal), round_off));
  CHECK(built.dofs.size == unconstrained.dofs.size - 3 * 12 - 6 + 6 - 2); // the cap's nodes; those held; the cap's own
}

TEST_CASE("a pressure presses with p A against the outward normal, a force is shared but whole")
{
  Scene scene = one_part();
  scene.pressures = {{"block:z+", 3e5}};
  scene.forces = {{"block:x-", {10, 20, 30}}};
  const auto built = build(box({0.3, 0.2, 0.1}, {3, 2, 2}), scene, world);
  CHECK(work(built.structure, rigid_motion({1, 0, 0}, {})) == approx(10, round_off));
  CHECK(work(built.structure, rigid_motion({0, 1, 0}, {})) == approx(20, round_off));
  CHECK(work(built.structure, rigid_motion({0, 0, 1}, {})) == approx(30 - 3e5 * 0.06, round_off));
}

TEST_CASE("a probe reads the node it names")
{
  const Scene scene = one_part();
  const Mesh mesh = box({0.3, 0.2, 0.1}, {3, 2, 2});
  const auto built = build(mesh, scene, world);
  const std::vector<Probe> probes{{"tip", "block:x+", Vec3{0.31, 0.19, 0.09}, {0, 0.6, 0.8}}};
  const auto P = probe_rows(probes, mesh, built.dofs, world);
  const auto u = sample(built.structure, wavy);
  Owned<Vec> values;
  check(MatCreateVecs(P, nullptr, values.put()));
  check(MatMult(P, u, values));
  double read = 0;
  check(VecSum(values, &read));
  const auto expected = wavy({0.3, 0.2, 0.1});
  CHECK(read == approx(0.6 * expected[1] + 0.8 * expected[2], round_off));
  CHECK_THROWS_WITH_AS(probe_rows({{"tip", "block:x+", {}, {}}}, mesh, built.dofs, world),
                       doctest::Contains("9 nodes; 'at'"), Error);
}

/// Bricks that a tie and a rigid body couple far apart, shells on them, a spring between two ends.
struct Coupled
{
  Scene scene;
  Mesh mesh;
};

Coupled coupled_parts()
{
  Coupled c;
  c.scene.parts = {{"low", steel, 0, {}}, {"high", steel, 0, {}}, {"strip", steel, 0.004, {}}};
  c.scene.damping = {3, 1e-6};
  c.scene.rigid_bodies = {{"cap", {"low:x-"}, {0, 0, 0.1}, 5, {1, 1, 1}, all}};
  c.scene.points = {{"weight", {1, 0, 0.3}, 2, {true, true, true}}};
  c.scene.springs = {{"weight", "cap", {0, 0, 1}, 1e6, 3}};
  c.scene.ties = {{"high:z-", "low:z+"}};
  c.scene.supports = {{"low:x+", all}};
  c.scene.forces = {{"high:x+", {1, 2, 3}}};
  c.scene.pressures = {{"high:z+", 1e5}};
  Mesh high;
  add_box(c.mesh, "low", 0, {0, 0, 0}, {1, 0.2, 0.1}, {27, 2, 1});
  add_box(high, "high", 1, {0, 0, 0.1}, {1, 0.2, 0.2}, {24, 3, 1});
  append(c.mesh, high);
  add_strip(c.mesh, "strip", 2, {{1, 0, 0.2}, {0.3, 0, 0}, {0, 0.2, 0}, 4, 3});
  add_points(c.mesh, c.scene);
  return c;
}

TEST_CASE("the matrices are allocated exactly, and an element that is inside out is named")
{
  Coupled c = coupled_parts();
  const Built built = build(c.mesh, c.scene, world);
  for (Mat A : {built.structure.M.get(), built.structure.C.get(), built.structure.K.get()})
  {
    MatInfo info;
    check(MatGetInfo(A, MAT_LOCAL, &info));
    CHECK(info.mallocs == 0);
    CHECK(info.nz_used == info.nz_allocated);
  }
  CHECK(built.structure.elements == static_cast<std::int64_t>(c.mesh.elements.size()));
  const std::vector<int> owners = partition_mesh(c.mesh, {}, ranks_of(world)).node_rank;
  const auto is_of_last_rank = [&](const Element& element)
  { return std::ranges::all_of(nodes_of(element), [&](int node) { return owners[node] == ranks_of(world) - 1; }); };
  const auto found = std::ranges::find_if(c.mesh.elements, is_of_last_rank); // assembled by that rank alone
  REQUIRE(found != c.mesh.elements.end());
  const auto last = found - c.mesh.elements.begin();
  auto& nodes = found->nodes;
  std::swap(nodes[1], nodes[3]);
  const std::string named = "element " + std::to_string(last) + " with node " + std::to_string(nodes[0]) + " at";
  CHECK_THROWS_WITH_AS(build(c.mesh, c.scene, world), doctest::Contains(named.c_str()), Error);
}

TEST_CASE("rows of a matrix scene are read, pushed and held by row and by node")
{
  const MatrixRows rows{4, {{12, 0}, {12, 2}, {7, 0}, {-1, -1}}};
  const std::vector<Probe> probes{{"row", "dof:3", {}, {}}, {"node", "node:12", {}, {0.6, 0, 0.8}}};
  const auto P = probe_rows(probes, rows, rank_of(world) == 0 ? 4 : 0, world);
  Owned<Vec> u, read;
  check(MatCreateVecs(P, u.put(), read.put()));
  set_all_entries(u, std::vector<double>{1, 10, 100, 1000});
  check(MatMult(P, u, read));
  CHECK(all_entries(read) == std::vector<double>{1000, 8.6});
  check(VecSet(u, 0));
  add_forces(rows, {{"node:7,12", {3, 0, 1}}, {"dof:3", {5, 0, 0}}}, u);
  CHECK(all_entries(u) == std::vector<double>{1.5, 1, 1.5, 5});
  CHECK(held_rows(rows, {{"node:1-9", {true}}, {"dof:1", {true, true, true, true, true, true}}}) ==
        std::vector<PetscInt>{1, 2});
  for (const char* wrong : {"dof:4", "dof:-1", "dof:x", "7", "dof:", "dof:7b", "node:8", "dof:2-9"})
    CHECK_THROWS_AS(held_rows(rows, {{wrong, {true}}}), Error);
  CHECK_THROWS_WITH_AS(held_rows(rows, {{"node:7", {false, true}}}), doctest::Contains("no row for the motions"),
                       Error);
  CHECK_THROWS_WITH_AS(add_forces({4, {}}, {{"node:7", {1, 0, 0}}}, u), doctest::Contains("no dofs.txt"), Error);
}

TEST_CASE("contradictions name the node and both sides")
{
  Scene scene = one_part();
  Mesh mesh = box({0.3, 0.2, 0.1}, {3, 2, 2});
  const auto says = [&](const Scene& s, const std::string& text)
  {
    Mesh whole = mesh;
    add_points(whole, s);
    const auto found = message(whole, s);
    CAPTURE(found);
    CHECK(found.find(text) != std::string::npos);
  };
  SUBCASE("two bodies on one node")
  {
    scene.rigid_bodies = {{"one", {"block:z+"}, {}, 1, {}, all}, {"two", {"block:x+"}, {}, 1, {}, all}};
    says(scene, "belongs to rigid body one and to rigid body two");
  }
  SUBCASE("nothing free")
  {
    scene.supports = {{"block", all}};
    says(scene, "nothing is free");
  }
  SUBCASE("a support that holds nothing")
  {
    scene.supports = {{"block:x-", {false, false, false, true}}};
    says(scene, "support on block:x-: none of its nodes has a motion that it fixes");
  }
  SUBCASE("an element turned inside out")
  {
    std::swap(mesh.elements[4].nodes[0], mesh.elements[4].nodes[6]);
    says(scene, "part block, element 4 with node");
  }
  SUBCASE("names that are not there")
  {
    scene.supports = {{"blok:x-", all}};
    says(scene, "no point, rigid body or mesh group \"blok:x-\"; did you mean 'block:x-'?");
    scene.supports.clear();
    scene.pressures = {{"block:w+", 1}};
    says(scene, "the mesh has no such surface");
  }
}
