// ranks: 1 2 3
#include "../support/blocks.hpp"
#include "../support/bricks.hpp"
#include "squeal/mesh/contact_pairs.hpp"

#include <algorithm>
#include <doctest/doctest.h>
#include <set>

using namespace squeal;
using namespace squeal::test;

namespace
{

const MPI_Comm comm = MPI_COMM_WORLD;

} // namespace

TEST_CASE("matching blocks pair node by node: coincident, normal upward, areas that sum to the surface")
{
  const TemporaryFile file(blocks, ".geo");
  const Scene scene = block_scene(file.path());
  const Mesh mesh = read_everywhere(scene);
  const std::vector<ContactPair> pairs = make_pairs(mesh, scene).pairs;
  CHECK(pairs.size() == 16);
  double area = 0;
  std::set<int> used;
  for (const ContactPair& pair : pairs)
  {
    CHECK(norm(mesh.nodes[pair.rotor_node] - mesh.nodes[pair.stator_node]) < 1e-12);
    CHECK(norm(pair.normal - Vec3{0, 0, 1}) < 1e-12);
    area += pair.area;
    used.insert({pair.rotor_node, pair.stator_node});
  }
  CHECK(area == doctest::Approx(1).epsilon(1e-12));
  CHECK(used.size() == 2 * pairs.size());
}

TEST_CASE("surfaces that face each other on a part of them touch there, and the rest is told")
{
  const TemporaryFile file(std::string("shift = 0.25;\n") + blocks, ".geo");
  const Scene scene = block_scene(file.path());
  const ContactPairs contact = make_pairs(read_everywhere(scene), scene);
  double area = 0;
  for (const ContactPair& pair : contact.pairs) area += pair.area;
  CHECK(area == doctest::Approx(0.75).epsilon(1e-12));
  CHECK(contact.coverage[0].covered == doctest::Approx(0.75).epsilon(1e-12));
  CHECK(contact.coverage[0].area == doctest::Approx(1).epsilon(1e-12));
  CHECK(contact.coverage[0].uncovered_at[0] > 1); // the stator hangs over at x = 1
}

TEST_CASE("surfaces that do not meet say how far they are apart and where, or that they look elsewhere")
{
  const TemporaryFile file(std::string("shift = 1.25;\n") + blocks, ".geo");
  Scene scene = block_scene(file.path());
  Mesh mesh = read_everywhere(scene);
  CHECK(has(problem_of([&] { make_pairs(mesh, scene); }), "no face of one is opposite a face of the other"));
  scene.contacts[0].stator = "base"; // below the low block, which looks down as the high one's face does
  scene.contacts[0].rotor = "roof";
  CHECK(has(problem_of([&] { make_pairs(mesh, scene); }), "no face of one"));
}

TEST_CASE("with a reach, partners face each other along the normal, and their distance is the pair's gap")
{
  const TemporaryFile file(blocks, ".geo");
  Scene scene = block_scene(file.path());
  Mesh mesh = read_everywhere(scene);
  Contact& contact = scene.contacts[0];
  const Vec3 up = make_pairs(mesh, scene).pairs.front().normal;
  for (const int node : mesh.node_groups.at(contact.stator)) mesh.nodes[node] = mesh.nodes[node] + 0.01 * up;
  const std::string apart = problem_of([&] { make_pairs(mesh, scene); });
  CHECK(has(apart, "at least 0.01 m apart"));
  CHECK(has(apart, "give the contact a reach"));
  contact.normal = up;
  contact.reach = 0.02;
  for (const ContactPair& pair : make_pairs(mesh, scene).pairs) CHECK(pair.gap == doctest::Approx(0.01).epsilon(1e-12));
  contact.reach = 0.005;
  CHECK(has(problem_of([&] { make_pairs(mesh, scene); }), "give the contact a reach"));
  contact.normal = -1 * up;
  CHECK(has(problem_of([&] { make_pairs(mesh, scene); }), "turn it"));
  contact.normal.reset();
  contact.reach = 0.02;
  CHECK(make_pairs(mesh, scene).pairs.front().gap == doctest::Approx(0.01).epsilon(1e-12));
  for (const int node : mesh.node_groups.at(contact.stator)) mesh.nodes[node] = mesh.nodes[node] - 0.015 * up;
  const std::string inside = problem_of([&] { make_pairs(mesh, scene); });
  CHECK(has(inside, "0.005 m inside the rotor"));
}

TEST_CASE("a finer stator has a pair a node, a finer rotor too where it is the slave")
{
  const TemporaryFile file(std::string("n = 2; top_n = 4;\n") + blocks, ".geo");
  Scene scene = block_scene(file.path());
  const Mesh mesh = read_everywhere(scene);
  CHECK(make_pairs(mesh, scene).pairs.size() == 25);
  scene.contacts[0].slave = SlaveSide::rotor;
  CHECK(make_pairs(mesh, scene).pairs.size() == 9);
}

TEST_CASE("shells of either numbering face what they touch, patch by patch")
{
  Mesh mesh;
  add_box(mesh, "low", 0, {0, 0, 0}, {3, 1, 1}, {6, 2, 1});
  for (const double x : {0., 2.}) // two plates apart
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j)
      {
        const double a = x + 0.5 * i, b = 0.5 * j;
        const auto at = [&](double dx, double dy) { return node_at(mesh, {a + dx, b + dy, 1.25}); };
        std::array<int, 4> corners{at(0, 0), at(0.5, 0), at(0.5, 0.5), at(0, 0.5)};
        if ((i + j + (x > 0)) % 2 == 1) std::reverse(corners.begin(), corners.end());
        Face face{Shape::quad4, {}, true};
        Element shell{Shape::quad4, 1, {}};
        std::copy(corners.begin(), corners.end(), face.nodes.begin());
        std::copy(corners.begin(), corners.end(), shell.nodes.begin());
        mesh.elements.push_back(shell);
        mesh.surfaces["plates"].push_back(face);
        add_to_group(mesh, "plates", corners);
      }
  Scene scene;
  scene.parts = {{"low", {}, 0, {}}, {"plates", {}, 0.5, {}}};
  Contact contact;
  contact.rotor = "low:z+";
  contact.stator = "plates";
  contact.reach = 0.5;
  scene.contacts = {contact};
  const ContactPairs pairs = make_pairs(mesh, scene);
  CHECK(pairs.pairs.size() == 18);
  for (const ContactPair& pair : pairs.pairs) CHECK(norm(pair.normal - Vec3{0, 0, 1}) < 1e-12);
  CHECK(pairs.coverage[0].covered == doctest::Approx(2).epsilon(1e-12));
}

TEST_CASE("a surface with a solid on both sides cannot be in contact")
{
  std::string text = blocks;
  text.replace(text.find("Geometry.AutoCoherence = 0;"), 27, "");
  const TemporaryFile file(text + "\nCoherence;\n", ".geo");
  const std::string problem = problem_of([&] { read_everywhere(block_scene(file.path())); });
  CHECK(has(problem, "solid on both sides"));
  CHECK(has(problem, "own copy"));
}

TEST_CASE("a scene of points needs no mesh, and its pair is the two points")
{
  Scene scene;
  scene.points = {{"disc", {0, 0, 0}, 1, {}}, {"pad", {0, 0, 1}, 1, {}}};
  Contact contact;
  contact.rotor = "disc";
  contact.stator = "pad";
  contact.normal = Vec3{0, 0, 2};
  scene.contacts = {contact};
  const std::vector<ContactPair> pairs = make_pairs(read_everywhere(scene), scene).pairs;
  CHECK(pairs.size() == 1);
  CHECK(pairs[0].rotor_node == 0);
  CHECK(pairs[0].stator_node == 1);
  CHECK(pairs[0].normal == Vec3{0, 0, 1});
}

TEST_CASE("the partition keeps pairs together, is balanced, and the same on every rank and every time")
{
  const TemporaryFile file(std::string("n = 12;\n") + blocks, ".geo");
  const Scene scene = block_scene(file.path());
  const Mesh mesh = read_everywhere(scene);
  const std::vector<ContactPair> pairs = make_pairs(mesh, scene).pairs;
  const Partition partition = partition_mesh(mesh, pairs, ranks_of(comm));
  for (const ContactPair& pair : pairs)
    CHECK(partition.node_rank[pair.rotor_node] == partition.node_rank[pair.stator_node]);
  std::vector<double> share(ranks_of(comm));
  for (const int rank : partition.node_rank) share[rank] += 1. * ranks_of(comm) / mesh.nodes.size();
  for (const double s : share) CHECK(s == doctest::Approx(1).epsilon(0.1)); // METIS allows 3 % and pairs are coarse
  CHECK(partition_mesh(mesh, pairs, ranks_of(comm)).node_rank == partition.node_rank);
  std::vector<int> first = partition.node_rank;
  MPI_Bcast(first.data(), static_cast<int>(first.size()), MPI_INT, 0, comm);
  CHECK(first == partition.node_rank);
}

TEST_CASE("few points go to ranks without leaving one empty, and too few are refused")
{
  Mesh mesh;
  mesh.nodes.resize(4);
  std::set<int> used;
  for (const int rank : partition_mesh(mesh, {}, ranks_of(comm)).node_rank) used.insert(rank);
  CHECK(static_cast<int>(used.size()) == ranks_of(comm));
  mesh.nodes.resize(1);
  if (ranks_of(comm) > 1) CHECK_THROWS_AS(partition_mesh(mesh, {}, ranks_of(comm)), Error);
}
