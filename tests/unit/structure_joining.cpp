// ranks: 1 2 3
// Joints, loads and supports: couplings, connectors, beams, bolts, gravity, moved and turned
// supports. Each against its closed form; tolerances are round-off of sums of some hundred terms.
#include "../support/approx.hpp"
#include "../support/bricks.hpp"
#include "squeal/equilibrium/equilibrium.hpp"

#include <doctest/doctest.h>
#include <numbers>

using namespace squeal;
using namespace squeal::test;

namespace
{

const MPI_Comm& world = PETSC_COMM_WORLD; // set when the session starts
constexpr double round_off = 1e-12;
const Motions all = every_motion, translations{true, true, true};
const Vec3 oblique = (1 / std::sqrt(2.)) * Vec3{1, 1, 0}, across = (1 / std::sqrt(2.)) * Vec3{-1, 1, 0};

Scene block()
{
  Scene scene;
  scene.parts = {{"block", {210e9, 0.3, 7850}, 0, {}}};
  return scene;
}

/// Points at uneven places, and a coupling with weights.
Scene cloud()
{
  Scene scene;
  const std::vector<Vec3> places{{0, 0, 0},   {0.3, 0.1, 0},     {0.1, 0.4, -0.2}, {-0.2, 0.1, 0.3},
                                 {0.5, 0, 1}, {-0.1, -0.3, 0.2}, {0.2, 0.2, 0.2}};
  Coupling coupling{"mean", {}, {0.3, -2, 1}, {}, 0, {}};
  for (std::size_t i = 0; i < places.size(); ++i)
  {
    scene.points.push_back({"p" + std::to_string(i), places[i], 1, translations});
    coupling.on.push_back(scene.points.back().name);
    coupling.weights.push_back(0.5 + 0.2 * static_cast<double>(i));
  }
  scene.couplings = {coupling};
  return scene;
}

Built built_of(const Scene& scene)
{
  Mesh mesh;
  add_points(mesh, scene);
  return build(mesh, scene, world);
}

/// x y z rx ry rz of a node, on rank 0, from all free degrees of freedom.
std::array<double, 6> motion_of(const DofMap& dofs, int node, const std::vector<double>& q)
{
  std::array<double, 6> u{};
  for (int c = 0; c < 6; ++c)
  {
    u[static_cast<std::size_t>(c)] = dofs.shift_of(6 * PetscInt{node} + c);
    for (const DofTerm& term : dofs.terms_of(6 * PetscInt{node} + c))
      u[static_cast<std::size_t>(c)] += term.factor * q[static_cast<std::size_t>(term.dof)];
  }
  return u;
}

/// Two free bodies at different places.
Scene two_bodies(const Connector& connector)
{
  Scene scene;
  scene.points = {{"a", {0, 0, 0}, 1, all}, {"b", {0.05, 0.02, -0.01}, 1, all}};
  scene.connectors = {connector};
  return scene;
}

Motions motions(std::initializer_list<std::size_t> which)
{
  Motions result{};
  for (const std::size_t motion : which) result[motion] = true;
  return result;
}

} // namespace

TEST_CASE("a coupling follows rigid motions of its nodes, and shares a force and a moment without a loss")
{
  Scene scene = cloud();
  const Vec3 force{3, -5, 7}, moment{-2, 1, 4}, at = scene.couplings[0].at;
  scene.forces = {{"mean", force, moment}};
  const Built built = built_of(scene);
  const Field turn = rigid_motion({1, -2, 0.5}, {0.3, 0.7, -0.4});
  const std::vector<double> q = all_entries(sample(built.structure, turn));
  if (rank_of(world) == 0)
  {
    const std::array<double, 6> found = motion_of(built.dofs, 7, q), wanted = turn(at);
    for (std::size_t c = 0; c < 6; ++c) CHECK(found[c] == approx(wanted[c], round_off));
  }
  for (int k = 0; k < 3; ++k)
  {
    const auto c = static_cast<std::size_t>(k);
    Vec3 axis{};
    axis[c] = 1;
    CHECK(work(built.structure, unit_rigid_motion(k)) == approx(force[c], round_off));
    CHECK(work(built.structure, rigid_motion(cross(at, axis), axis)) == approx(moment[c], round_off));
  }
}

TEST_CASE("a coupling needs nodes beside a line")
{
  Scene scene = cloud();
  scene.couplings[0].on = {"p0", "p1"};
  scene.couplings[0].weights = {};
  Mesh mesh;
  add_points(mesh, scene);
  CHECK(message(mesh, scene).find("coupling mean: its 2 nodes are on a line") == 0);
}

TEST_CASE("a bushing takes no energy from rigid motions, whatever its matrix, place and frame")
{
  if (ranks_of(world) > 2) return; // of two nodes
  Connector bushing{"a", "b"};
  bushing.frame = {oblique, across, {}};
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) bushing.stiffness.push_back(i == j ? 7 + i : 0.3 * (i + j));
  bushing.loss_factor = 0.2;
  Scene scene = two_bodies(bushing);
  scene.damping.loss_frequency = 100;
  const Built built = built_of(scene);
  const Structure& s = built.structure;
  const Field rigid = rigid_motion({1, -2, 0.5}, {0.3, 0.7, -0.4});
  CHECK(largest_of_product(s.K, sample(s, rigid)) < round_off);
  const Field apart = [](const Vec3& x) -> std::array<double, 6> {
    return x == Vec3{} ? std::array<double, 6>{} : std::array<double, 6>{1, 1, 0};
  };
  const Owned<Vec> u = sample(s, apart); // by sqrt(2) along axis_1
  CHECK(form(s.K, u, u) == approx(2 * 7, round_off));
  CHECK(form(s.K_loss, u, u) == approx(0.2 * 2 * 7, round_off));
}

TEST_CASE("a hinge, a slot and a cylinder leave their own motions alone")
{
  if (ranks_of(world) > 2) return; // of two nodes
  const std::vector<std::pair<Motions, PetscInt>> joints{
      {motions({0, 1, 2, 4, 5}), 7}, {motions({1, 2, 3, 4, 5}), 7}, {motions({1, 2, 4, 5}), 8}};
  for (const auto& [locked, count] : joints)
  {
    Connector joint{"a", "b"};
    joint.frame = {oblique, across, {}};
    joint.locked = locked;
    const Built built = built_of(two_bodies(joint));
    CHECK(built.dofs.size == count);
    const std::vector<double> q = all_entries(sample(built.structure,
                                                     [](const Vec3& x) -> std::array<double, 6>
                                                     { return {x[0], 2, -1, 0.3 + x[0], x[1], 5 + x[1]}; }));
    if (rank_of(world) != 0) continue;
    const std::array<double, 6> a = motion_of(built.dofs, 0, q), b = motion_of(built.dofs, 1, q);
    const Vec3 half = 0.5 * Vec3{0.05, 0.02, -0.01};
    const Vec3 turn{b[3] - a[3], b[4] - a[4], b[5] - a[5]};
    const Vec3 apart =
        Vec3{b[0] - a[0], b[1] - a[1], b[2] - a[2]} - cross({b[3], b[4], b[5]}, half) - cross({a[3], a[4], a[5]}, half);
    const std::array<Vec3, 3> axes{oblique, across, Vec3{0, 0, 1}};
    for (std::size_t c = 0; c < 3; ++c)
    {
      CHECK((std::abs(dot(axes[c], apart)) < round_off) == locked[c]);
      CHECK((std::abs(dot(axes[c], turn)) < round_off) == locked[3 + c]);
    }
  }
}

TEST_CASE("springs and masses on a group are shared by its nodes")
{
  Scene scene = block();
  Mesh mesh;
  add_box(mesh, "block", 0, {}, {0.3, 0.2, 0.1}, {3, 2, 2});
  const Built bare = build(mesh, scene, world);
  scene.springs = {{"block:z-", "ground", {0, 0, 1}, 1e6, 50}};
  scene.masses = {{"block:z+", 3}};
  const Built built = build(mesh, scene, world);
  const Owned<Vec> up = sample(built.structure, unit_rigid_motion(2)),
                   along = sample(built.structure, unit_rigid_motion(0));
  CHECK(form(built.structure.K, up, up) == approx(1e6, 1e-9)); // rounding of K, whose entries are of 1e10 N/m
  CHECK(form(built.structure.C, up, up) == approx(50, round_off));
  CHECK(form(built.structure.M, along, along) == approx(form(bare.structure.M, along, along) + 3, round_off));
  scene.springs = {{"block:z-", "block:z+", {0, 0, 1}, 1e6, 0}};
  CHECK(message(mesh, scene).find("both ends are groups") != std::string::npos);
}

TEST_CASE("gravity acts on all masses")
{
  Scene scene = block();
  scene.rigid_bodies = {{"cap", {"block:z+"}, {0.1, 0.1, 0.2}, 2, {}, all}};
  scene.points = {{"free", {1, 0, 0}, 3, translations}};
  scene.gravity = {1, -2, -9.81};
  Mesh mesh;
  add_box(mesh, "block", 0, {}, {0.3, 0.2, 0.1}, {3, 2, 2});
  add_points(mesh, scene);
  const Built built = build(mesh, scene, world);
  const double mass = 7850 * 0.3 * 0.2 * 0.1 + 2 + 3;
  for (int c = 0; c < 3; ++c)
    CHECK(work(built.structure, unit_rigid_motion(c)) ==
          approx(mass * scene.gravity[static_cast<std::size_t>(c)], round_off));
}

TEST_CASE("supports that move all sides of a body in a turned frame take its inside along")
{
  Scene scene = block();
  Mesh mesh;
  add_box(mesh, "block", 0, {}, {0.3, 0.2, 0.1}, {3, 3, 3});
  const Vec3 moved{1e-3, 2e-3, -1e-3};
  for (const char* side : {"x-", "x+", "y-", "y+", "z-", "z+"})
    scene.supports.push_back({std::string("block:") + side, translations, {oblique, across, {}}, moved, {}});
  const Built built = build(mesh, scene, world);
  CHECK(built.dofs.size == 3 * 2 * 2 * 2);
  const Vec3 whole = moved[0] * oblique + moved[1] * across + moved[2] * Vec3{0, 0, 1};
  const Owned<Vec> u = sample(built.structure, rigid_motion(whole, {})), force = zeros_like(u);
  check(MatMult(built.structure.K, u, force));
  check(VecAXPY(force, -1, built.structure.load));
  double left = 0, size = 0;
  check(VecNorm(force, NORM_INFINITY, &left));
  check(VecNorm(built.structure.load, NORM_INFINITY, &size));
  CHECK(left < round_off * size);
  if (rank_of(world) == 0)
    for (std::size_t c = 0; c < 3; ++c)
      CHECK(built.dofs.shift_of(static_cast<PetscInt>(c)) == approx(whole[c], round_off));
}

TEST_CASE("a support in a cylindrical frame holds one direction at each node")
{
  Scene scene = block();
  Mesh mesh;
  add_box(mesh, "block", 0, {}, {0.3, 0.2, 0.1}, {3, 2, 2});
  const Vec3 centre{-0.1, -0.2, 0};
  scene.supports = {{"block:z-", motions({1}), {{1, 0, 0}, {0, 1, 0}, Axis{{0, 0, 1}, centre}}, {}, {}}};
  const Built built = build(mesh, scene, world);
  CHECK(built.dofs.size == 3 * 4 * 3 * 3 - 4 * 3);
  const Field radial = [&](const Vec3& x) -> std::array<double, 6>
  { return {x[0] - centre[0], x[1] - centre[1], 0, 0, 0, 0}; };
  const std::vector<double> q = all_entries(sample(built.structure, radial));
  for (std::size_t node = 0; node < mesh.nodes.size() && rank_of(world) == 0; ++node)
    for (std::size_t c = 0; c < 3; ++c)
      CHECK(std::abs(motion_of(built.dofs, static_cast<int>(node), q)[c] - radial(mesh.nodes[node])[c]) < round_off);
  scene.supports[0].frame.cylinder->centre = {0.1, 0.1, 0};
  CHECK(message(mesh, scene).find("support on block:z-: (0.1, 0.1, 0) is on the axis of its cylinder") == 0);
}

TEST_CASE("orthotropic axes about a cylinder are those of each element's middle")
{
  Scene turned = block();
  turned.parts[0].material.orthotropy = Orthotropy{{9e9, 4e9, 2e9}, {0.2, 0.1, 0.3}, {1e9, 2e9, 3e9}};
  Scene plain = turned;
  Mesh mesh; // one element, whose middle is along (1, 1, 0) from the axis
  add_box(mesh, "block", 0, {}, {0.2, 0.2, 0.1}, {1, 1, 1});
  turned.parts[0].material.orthotropy->cylinder = Axis{{0, 0, 1}, {}};
  plain.parts[0].material.orthotropy->axis_1 = oblique;
  plain.parts[0].material.orthotropy->axis_2 = across;
  const Built a = build(mesh, turned, world), b = build(mesh, plain, world);
  const Field bent = [](const Vec3& x) -> std::array<double, 6> { return {x[0] * x[1], x[2], x[0] * x[0], 0, 0, 0}; };
  const Owned<Vec> u = sample(a.structure, bent), v = sample(b.structure, bent);
  CHECK(form(a.structure.K, u, u) == approx(form(b.structure.K, v, v), round_off));
}

TEST_CASE("a beam is free in rigid motions, and has its mass and bending")
{
  Scene scene;
  scene.points = {{"a", {0.1, 0.2, 0.3}, 0, all}, {"b", {0.3, 0.1, 0.6}, 0, all}};
  Beam beam{"pin", "a", "b"};
  beam.young = 210e9;
  beam.poisson = 0.3;
  beam.density = 7850;
  beam.diameter = 0.01;
  beam.shear_factor = 0.9;
  beam.elements = 4;
  scene.beams = {beam};
  const Built built = built_of(scene);
  CHECK(built.dofs.size == 5 * 6);
  const Structure& s = built.structure;
  const double pi = std::numbers::pi, length = norm(Vec3{0.2, -0.1, 0.3}), area = pi * 1e-4 / 4;
  for (int k = 0; k < 6; ++k)
    CHECK(largest_of_product(s.K, sample(s, unit_rigid_motion(k))) < 1e-7); // rounding of 2e8 N/m
  const Owned<Vec> up = sample(s, unit_rigid_motion(2));
  CHECK(form(s.M, up, up) == approx(7850 * area * length, round_off));
  // w = kappa x^2/2 across it
  const Vec3 along = (1 / length) * Vec3{0.2, -0.1, 0.3}, normal = (1 / std::sqrt(5.)) * Vec3{1, 2, 0};
  const Vec3 turn = cross(along, normal);
  const Field bent = [&](const Vec3& x) -> std::array<double, 6>
  {
    const double at = dot(x - scene.points[0].at, along), w = at * at / 2;
    return {w * normal[0], w * normal[1], w * normal[2], at * turn[0], at * turn[1], at * turn[2]};
  };
  const Owned<Vec> u = sample(s, bent);
  CHECK(form(s.K, u, u) == approx(210e9 * pi * 1e-8 / 64 * length, 1e-9));
}

namespace
{

/// A bar of 4 x 4 x 8 cells, clamped at both ends, with the nodes of a section in its middle.
struct Bar
{
  Scene scene = block();
  Mesh mesh{};

  Bar()
  {
    scene.parts[0].material.poisson = 0;
    scene.supports = {{"block:z-", translations}, {"block:z+", translations}};
    scene.bolts = {{"bolt", "middle", "", {0, 0, 1}, 20e3}};
    add_box(mesh, "block", 0, {}, {0.02, 0.02, 0.1}, {2, 2, 8});
    cut(0.02);
  }

  /// Puts the nodes at half of the length up to a width into the section.
  void cut(double width)
  {
    std::vector<int>& nodes = mesh.node_groups["middle"];
    nodes.clear();
    for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
      if (std::abs(mesh.nodes[i][2] - 0.05) < 1e-9 && mesh.nodes[i][0] < width + 1e-9)
        nodes.push_back(static_cast<int>(i));
  }
};

} // namespace

TEST_CASE("a bolt is shortened until it has its tension, and keeps that length")
{
  Bar bar;
  Built built = build(bar.mesh, bar.scene, world);
  Structure& s = built.structure;
  s.path.push_back({"bolts", copy_of(s.load.get()), 1, {0}});
  s.path.push_back({"load", shared(s.load.get()), 1, {}});
  const Interface nothing = make_interface({}, bar.scene, built.dofs, world);
  tighten(s, nothing);
  const double stiffness = 210e9 * 4e-4 / 0.1;
  CHECK(s.bolts[0].shortening == approx(20e3 / stiffness, 1e-9));
  const Equilibrium found = find_equilibrium(s, nothing, {});
  CHECK(tension_of(s.bolts[0], found.u) == approx(20e3, 1e-9));
  // the lower half is drawn out to its end by half of the shortening
  const std::vector<double> u = all_entries(found.u);
  if (rank_of(world) == 0)
    CHECK(motion_of(built.dofs, bar.mesh.node_groups["middle"].front(), u)[2] ==
          approx(s.bolts[0].shortening / 2, 1e-9));
}

TEST_CASE("a section that does not cut the shank through is refused, and one that a contact reads")
{
  Bar bar;
  bar.cut(0.01);
  CHECK(message(bar.mesh, bar.scene).find("bolt bolt: the section 'middle' does not cut the shank through") == 0);
  bar.cut(-1);
  CHECK(message(bar.mesh, bar.scene).find("has no face between two solid elements") != std::string::npos);
  bar.cut(0.02);
  Contact contact;
  contact.rotor = "block:x-";
  contact.stator = "other";
  bar.scene.contacts = {contact};
  CHECK(message(bar.mesh, bar.scene).find("of its section is in the contact of 'block:x-' too") != std::string::npos);
}
