// ranks: 1 2 3
// The contact rows of a mesh by what they must read of known motions: openings, slidings, drives, frames.
#include "squeal/contact/interface.hpp"
#include "../support/bricks.hpp"

#include <algorithm>
#include <doctest/doctest.h>

using namespace squeal;
using namespace squeal::test;

namespace
{

const MPI_Comm& world = PETSC_COMM_WORLD; // set when the session starts
constexpr double round_off = 1e-12;
const Motions all{true, true, true, true, true, true};

/// A pad on a disc, both blocks, meeting in the plane z = 0 with nodes of their own.
struct Stack
{
  Scene scene;
  Mesh mesh;
  std::vector<ContactPair> pairs;
};

Stack stack()
{
  Stack s;
  s.scene.parts = {{"disc", {210e9, 0.3, 7850}, 0, {}}, {"pad", {1e9, 0.2, 2000}, 0, {}}};
  s.scene.friction.coefficient = 0.3;
  s.scene.contacts = {{"disc:z+", "pad:z-", 1e-4, {}, {}, Rotation{{0, 0, 1}, {0, 0, 0}, 20}, {}}};
  add_box(s.mesh, "disc", 0, {0.1, 0.1, -0.1}, {0.3, 0.2, 0}, {2, 2, 1});
  Mesh pad; // built apart, so that coincident nodes stay apart
  add_box(pad, "pad", 1, {0.1, 0.1, 0}, {0.3, 0.2, 0.1}, {2, 2, 1});
  const auto shift = static_cast<int>(s.mesh.nodes.size());
  s.mesh.nodes.insert(s.mesh.nodes.end(), pad.nodes.begin(), pad.nodes.end());
  for (Element element : pad.elements)
  {
    for (int& node : element.nodes) node += shift;
    s.mesh.elements.push_back(element);
  }
  for (auto [name, nodes] : pad.node_groups)
  {
    for (int& node : nodes) node += shift;
    s.mesh.node_groups[name] = nodes;
  }
  for (auto [name, faces] : pad.surfaces)
  {
    for (Face& face : faces)
      for (int& node : face.nodes) node += shift;
    s.mesh.surfaces[name] = faces;
  }
  s.pairs = make_pairs(s.mesh, s.scene).pairs;
  return s;
}

struct Joined
{
  Structure structure;
  Interface interface;
};

Joined join(const Stack& s)
{
  const Partition partition = partition_mesh(s.mesh, s.pairs, ranks_of(world));
  const DofMap dofs = number_dofs(s.mesh, s.scene, partition, world);
  Joined joined{assemble({s.mesh, partition, dofs}, s.scene, world), {}};
  joined.interface = make_interface(s.pairs, s.scene, dofs, world);
  return joined;
}

/// A motion of the pad alone: the disc's nodes stay.
Owned<Vec> sample_pad(const Structure& structure, const Field& motion)
{
  auto u = sample(structure, motion);
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(u, &first, &last));
  for (PetscInt dof = first; dof < last; ++dof)
    if (describe(structure.names, dof).find("part pad") != 0) check(VecSetValue(u, dof, 0, INSERT_VALUES));
  check(VecAssemblyBegin(u));
  check(VecAssemblyEnd(u));
  return u;
}

} // namespace

TEST_CASE("a pad that lifts opens every gap, one that rides with its disc none")
{
  const auto joined = join(stack());
  const Interface& interface = joined.interface;
  REQUIRE(interface.pairs == 9);
  REQUIRE(interface.directions == 2);
  const auto lifting = sample_pad(joined.structure, rigid_motion({0, 0, 2}, {}));
  const auto riding = sample(joined.structure, rigid_motion({1, 2, 3}, {0.4, 0.5, 0.6}));
  const auto lifted = relative(interface, lifting), ridden = relative(interface, riding);
  const std::array<Vec, 2> both = {riding, lifting};
  CHECK(relative(interface, both) == std::vector{ridden, lifted}); // in one message
  for (std::size_t i = 0; i < interface.size(); ++i)
  {
    CHECK(lifted[i] == doctest::Approx(i % 3 == 0 ? 2 : 0).epsilon(round_off));
    CHECK(std::abs(ridden[i]) < round_off);
  }
  CHECK(interface.gap == std::vector<double>(9, 1e-4));
}

TEST_CASE("reactions act on pad and disc, equal and opposite")
{
  const auto joined = join(stack());
  std::vector<double> r(joined.interface.size());
  for (std::size_t i = 0; i < r.size(); ++i) r[i] = 1 + static_cast<double>(i % 7);
  auto force = zeros_like(joined.structure.load);
  add_reactions(joined.interface, r, force);
  double on_pad = 0, in_all = 0, normal = 0;
  check(VecDot(force, sample_pad(joined.structure, rigid_motion({0, 0, 1}, {})), &on_pad));
  check(VecDot(force, sample(joined.structure, rigid_motion({1, 1, 1}, {1, 1, 1})), &in_all));
  for (std::size_t i = 0; i < r.size(); i += 3) normal += r[i];
  CHECK(on_pad == doctest::Approx(normal).epsilon(round_off));
  CHECK(std::abs(in_all) < round_off * normal);
}

TEST_CASE("a disc that turns drags along rate axis x arm: its own motion slides by -v_d")
{
  auto s = stack();
  const auto check_drive = [&]
  {
    const auto joined = join(s);
    const auto& interface = joined.interface;
    // Pad moving as the disc's surface: B_t v = v_d, so that s = 0.
    const auto riding = relative(interface, sample_pad(joined.structure, rigid_motion({}, {0, 0, 20})));
    for (std::size_t i = 0; i < 9; ++i)
      for (std::size_t k = 0; k < 2; ++k)
        CHECK(interface.drive[2 * i + k] == doctest::Approx(riding[3 * i + 1 + k]).epsilon(round_off));
    return drive_directions(interface);
  };
  const auto along = check_drive();
  for (std::size_t i = 0; i < 9; ++i)
  {
    CHECK(along[2 * i] == doctest::Approx(1).epsilon(round_off)); // t1 lies along the drive
    CHECK(std::abs(along[2 * i + 1]) < round_off);
  }
  s.scene.contacts[0].tangents = {{3, 0, 1}, {0, -2, 0}}; // made unit and tangential, kept in sense
  const auto given = check_drive();
  const Vec3 at = join(s).interface.geometry[4].position, v = cross(Vec3{0, 0, 1}, at);
  CHECK(given[8] == doctest::Approx(v[0] / norm(v)).epsilon(round_off));
  CHECK(given[9] == doctest::Approx(-v[1] / norm(v)).epsilon(round_off));
}

TEST_CASE("one tangent is plane friction along it")
{
  auto s = stack();
  s.scene.contacts[0].rotation.reset();
  s.scene.contacts[0].velocity = {3, 4, 5};
  s.scene.contacts[0].tangents = {{1, 0, 0}};
  const auto joined = join(s);
  CHECK(joined.interface.directions == 1);
  CHECK(joined.interface.drive == std::vector<double>(9, 3));
  const auto moved = relative(joined.interface, sample_pad(joined.structure, rigid_motion({7, 8, 9}, {})));
  for (std::size_t i = 0; i < moved.size(); i += 2)
  {
    CHECK(moved[i] == doctest::Approx(9).epsilon(round_off));
    CHECK(moved[i + 1] == doctest::Approx(7).epsilon(round_off));
  }
}

TEST_CASE("a contact has its own friction, and without a drive its pairs stick")
{
  auto s = stack();
  CHECK_FALSE(has_undriven_pairs(join(s).interface));
  s.scene.contacts[0].rotation->centre = {0.1, 0.1, 0}; // a corner pair sits on the axis
  const Interface on_axis = join(s).interface;
  std::size_t undriven = 0;
  for (std::size_t i = 0; i < on_axis.gap.size(); ++i) undriven += is_undriven(on_axis, i);
  CHECK(undriven == 1);
  s.scene.contacts[0].friction = FrictionLaw{0.1, true, 0.2, 3};
  const Interface own = join(s).interface;
  CHECK(own.friction.common.coefficient == 0.3);
  for (std::size_t i = 0; i < own.gap.size(); ++i)
  {
    CHECK(own.friction.has_own(i));
    CHECK(own.friction.of(i).coefficient == 0.1);
    CHECK(own.friction.of(i).static_coefficient == 0.2);
  }
  s.scene.contacts[0].friction = FrictionLaw{0}; // a smooth stop
  CHECK_FALSE(has_undriven_pairs(join(s).interface));
}

TEST_CASE("a pair that cannot part is refused")
{
  auto s = stack();
  s.scene.supports = {{"disc", all}, {"pad:z-", {false, false, true}}};
  CHECK_THROWS_WITH_AS(join(s), doctest::Contains("cannot move along its normal"), Error);
  s.scene.supports.clear();
  s.scene.rigid_bodies = {{"both", {"disc:z+", "pad:z-"}, {0.7, 0.1, 0.3}, 1, {}, all}}; // one body on both sides
  add_points(s.mesh, s.scene);
  CHECK_THROWS_WITH_AS(join(s), doctest::Contains("cannot move along its normal"), Error);
}
