// ranks: 1 2 3
#include "../support/temporary_folder.hpp"
#include "squeal/mesh/build.hpp"
#include "squeal/mesh/contact_pairs.hpp"
#include "squeal/mesh/mesh_file.hpp"
#include "squeal/mesh/partition.hpp"
#include "squeal/mesh/script.hpp"
#include "squeal/mesh/shapes.hpp"

#include <doctest/doctest.h>
#include <functional>
#include <numeric>
#include <set>

using namespace squeal;

namespace
{

const MPI_Comm comm = MPI_COMM_WORLD;

/// A file of this text and extension in a folder of its own.
class TemporaryFile
{
public:
  TemporaryFile(const std::string& text, const std::string& extension) : path_(folder_.write("file" + extension, text))
  {
  }
  const std::filesystem::path& path() const { return path_; }

private:
  test::TemporaryFolder folder_;
  std::filesystem::path path_;
};

// Two unit blocks one above the other, n x n x 2 bricks each, that meet at z = 1 without sharing nodes.
const char* blocks = R"(
DefineConstant[ n = {3, Min 1, Name "Mesh/n"}, shift = 0, top_n = 0 ];
Mesh.ElementOrder = 1;
Geometry.AutoCoherence = 0;
For high In {0:1}
  x0 = high * shift; dz = 2 * high - 1; m = (high && top_n) ? top_n : n;
  p = newp; Point(p) = {x0, 0, 1}; Point(p+1) = {x0+1, 0, 1}; Point(p+2) = {x0+1, 1, 1}; Point(p+3) = {x0, 1, 1};
  l = newl; Line(l) = {p, p+1}; Line(l+1) = {p+1, p+2}; Line(l+2) = {p+2, p+3}; Line(l+3) = {p+3, p};
  Transfinite Curve {l, l+1, l+2, l+3} = m + 1;
  s = news; Curve Loop(s) = {l, l+1, l+2, l+3}; Plane Surface(s) = {s};
  Transfinite Surface {s}; Recombine Surface {s};
  out[] = Extrude {0, 0, dz} { Surface{s}; Layers{2}; Recombine; };
  If (high)
    Physical Volume("high") = {out[1]}; Physical Surface("high_face") = {s}; Physical Surface("roof") = {out[0]};
  Else
    Physical Volume("low") = {out[1]}; Physical Surface("low_face") = {s}; Physical Surface("base") = {out[0]};
  EndIf
EndFor
)";

Scene block_scene(const std::filesystem::path& file)
{
  Scene scene;
  scene.mesh = MeshSource{file, {}, 1};
  scene.parts = {{"low", {}, 0, {}}, {"high", {}, 0, {}}};
  Contact contact;
  contact.rotor = "low_face";
  contact.stator = "high_face";
  scene.contacts = {contact};
  return scene;
}

std::string problem_of(const std::function<void()>& work)
{
  try
  {
    work();
  }
  catch (const Error& error)
  {
    return error.what();
  }
  return "";
}

bool has(const std::string& text, const std::string& part)
{
  return text.find(part) != std::string::npos;
}

// An element's corners at their places in the reference cell.
std::vector<Vec3> reference(Shape shape)
{
  std::vector<Vec3> x;
  switch (shape)
  {
  case Shape::hex8:
  case Shape::hex20:
    x = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    break;
  case Shape::wedge6:
    x = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
    break;
  default:
    x = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  }
  for (const auto& [a, b] : mid_sides(shape)) x.push_back(0.5 * (x[a] + x[b]));
  return x;
}

int gmsh_type(Shape shape)
{
  switch (shape)
  {
  case Shape::hex8:
    return 5;
  case Shape::wedge6:
    return 6;
  case Shape::hex20:
    return 17;
  case Shape::tet4:
    return 4;
  default:
    return 11;
  }
}

} // namespace

TEST_CASE("corner faces enclose the reference cell, outward")
{
  const std::map<Shape, double> volume = {
      {Shape::hex8, 1}, {Shape::wedge6, 1. / 2}, {Shape::hex20, 1}, {Shape::tet10, 1. / 6}, {Shape::tet4, 1. / 6}};
  for (const auto& [shape, expected] : volume)
  {
    const std::vector<Vec3> x = reference(shape);
    double sum = 0; // divergence theorem, faces cut into triangles
    for (const auto& face : corner_faces(shape))
      for (int i = 1; i < 3 && face[i + 1] >= 0; ++i) sum += dot(x[face[0]], cross(x[face[i]], x[face[i + 1]])) / 6;
    CHECK(sum == doctest::Approx(expected).epsilon(1e-14)); // round-off of a few products
  }
}

TEST_CASE("a solid numbered inside out is mended, mid-sides too")
{
  for (const Shape shape : {Shape::hex8, Shape::wedge6, Shape::hex20, Shape::tet10, Shape::tet4})
  {
    FileMesh file;
    file.nodes = reference(shape);
    ElementBlock block{3, gmsh_type(shape), "", node_count(shape), {}, {"body"}};
    block.nodes = mirrored_order(shape);
    file.blocks = {block};
    Scene scene;
    scene.parts = {{"body", {}, 0, {}}};
    const Mesh mesh = build_mesh(file, scene);
    const Element& mended = mesh.elements.at(0);
    const auto x = [&](int i) { return mesh.nodes[mended.nodes[i]]; };
    CHECK(dot(cross(x(1) - x(0), x(shape == Shape::hex8 || shape == Shape::hex20 ? 3 : 2) - x(0)),
              x(corner_count(shape) == 8 ? 4 : 3) - x(0)) == 1);
    for (std::size_t i = 0; i < mid_sides(shape).size(); ++i) // coordinates are halves: exact
    {
      const auto [a, b] = mid_sides(shape)[i];
      CHECK(norm(x(corner_count(shape) + static_cast<int>(i)) - 0.5 * (x(a) + x(b))) == 0);
    }
  }
}

TEST_CASE("faces look out of the solid they bound")
{
  const TemporaryFile file(blocks, ".geo");
  const Mesh mesh = read_mesh(block_scene(file.path()), comm);
  const std::map<std::string, double> outward = {{"low_face", 1}, {"base", -1}, {"high_face", -1}, {"roof", 1}};
  for (const auto& [name, sign] : outward)
    for (const Face& face : mesh.surfaces.at(name))
    {
      const auto x = [&](int i) { return mesh.nodes[face.nodes[i]]; };
      CHECK(cross(x(1) - x(0), x(2) - x(0))[2] * sign > 0);
    }
}

TEST_CASE("matching blocks pair node by node: coincident, normal upward, areas that sum to the surface")
{
  const TemporaryFile file(blocks, ".geo");
  const Scene scene = block_scene(file.path());
  const Mesh mesh = read_mesh(scene, comm);
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
  const ContactPairs contact = make_pairs(read_mesh(scene, comm), scene);
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
  Mesh mesh = read_mesh(scene, comm);
  CHECK(has(problem_of([&] { make_pairs(mesh, scene); }), "no face of one lies opposite a face of the other"));
  scene.contacts[0].stator = "base"; // below the low block, which looks down as the high one's face does
  scene.contacts[0].rotor = "roof";
  CHECK(has(problem_of([&] { make_pairs(mesh, scene); }), "no face of one"));
}

TEST_CASE("with a reach, partners face each other along the normal, and their distance is the pair's gap")
{
  const TemporaryFile file(blocks, ".geo");
  Scene scene = block_scene(file.path());
  Mesh mesh = read_mesh(scene, comm);
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
  const Mesh mesh = read_mesh(scene, comm);
  CHECK(make_pairs(mesh, scene).pairs.size() == 25);
  scene.contacts[0].slave = SlaveSide::rotor;
  CHECK(make_pairs(mesh, scene).pairs.size() == 9);
}

TEST_CASE("a surface with a solid on both sides cannot be in contact")
{
  std::string text = blocks;
  text.replace(text.find("Geometry.AutoCoherence = 0;"), 27, "");
  const TemporaryFile file(text + "\nCoherence;\n", ".geo");
  const std::string problem = problem_of([&] { read_mesh(block_scene(file.path()), comm); });
  CHECK(has(problem, "solid on both sides"));
  CHECK(has(problem, "own copy"));
}

TEST_CASE("a wrong name is answered with the nearest right one")
{
  const TemporaryFile file(blocks, ".geo");
  const auto problem = [&](auto change)
  {
    Scene scene = block_scene(file.path());
    change(scene);
    return problem_of([&] { read_mesh(scene, comm); });
  };
  CHECK(has(problem([](Scene& s) { s.parts[0].name = "lowe"; }), "did you mean 'low'?"));
  CHECK(has(problem([](Scene& s) { s.contacts[0].rotor = "low_fase"; }), "did you mean 'low_face'?"));
  CHECK(has(problem([](Scene& s) { s.mesh->parameters["shif"] = 1; }), "did you mean 'shift'?"));
  CHECK(has(problem([](Scene& s) { s.supports = {{"bas", {}}}; }), "did you mean 'base'?"));
  CHECK(has(problem([](Scene& s) { s.parts.pop_back(); }), "in physical group 'high'"));
  CHECK(has(problem([](Scene& s) { s.parts[0].thickness = 1; }), "remove the thickness"));
  CHECK(has(problem([](Scene& s) { s.mesh->file += ".gone"; }), "no such mesh file"));
}

TEST_CASE("gmsh's own words reach the message")
{
  const TemporaryFile file("Point(1) = {0, 0} 1;\n", ".geo");
  CHECK(has(problem_of([&] { read_mesh(block_scene(file.path()), comm); }), "syntax error"));
}

TEST_CASE("an empty mesh is an error, and 4-node tetrahedra are read")
{
  const TemporaryFile empty("Point(1) = {0, 0, 0};\n", ".geo");
  CHECK(has(problem_of([&] { read_mesh(block_scene(empty.path()), comm); }), "no elements"));
  const TemporaryFile tets("SetFactory(\"OpenCASCADE\"); Box(1) = {0, 0, 0, 1, 1, 1};\n"
                           "Physical Volume(\"low\") = {1}; Mesh.MeshSizeMin = 1;\n",
                           ".geo");
  Scene scene = block_scene(tets.path());
  scene.parts.pop_back();
  scene.contacts.clear();
  const Mesh mesh = read_mesh(scene, comm);
  double volume = 0;
  for (const Element& element : mesh.elements)
  {
    REQUIRE(element.shape == Shape::tet4);
    const auto x = [&](int i) { return mesh.nodes[element.nodes[i]]; };
    volume += dot(x(3) - x(0), cross(x(1) - x(0), x(2) - x(0))) / 6;
  }
  CHECK(volume == doctest::Approx(1).epsilon(1e-12));
}

TEST_CASE("parameters are found in lists, with braces, comments and includes")
{
  const TemporaryFile inner("DefineConstant[ deep = 1 ];", ".geo");
  const TemporaryFile outer("Include \"" + inner.path().string() +
                                "\";\nDefineConstant[ a = {1, Min 0, Name \"b = 2\"} // c = 3\n, d, e=4*(1+2) ]; /*" +
                                std::string(1000000, 'x') + "*/",
                            ".geo");
  if (rank_of(comm) != 0) return; // the file is rank 0's
  CHECK(read_script(outer.path(), Statements::listed).parameters == std::vector<std::string>{"deep", "a", "d", "e"});
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
  const std::vector<ContactPair> pairs = make_pairs(read_mesh(scene, comm), scene).pairs;
  CHECK(pairs.size() == 1);
  CHECK(pairs[0].rotor_node == 0);
  CHECK(pairs[0].stator_node == 1);
  CHECK(pairs[0].normal == Vec3{0, 0, 1});
}

TEST_CASE("the partition keeps pairs together, is balanced, and the same on every rank and every time")
{
  const TemporaryFile file(std::string("n = 12;\n") + blocks, ".geo");
  const Scene scene = block_scene(file.path());
  const Mesh mesh = read_mesh(scene, comm);
  const std::vector<ContactPair> pairs = make_pairs(mesh, scene).pairs;
  const Partition partition = partition_mesh(mesh, pairs, comm);
  for (const ContactPair& pair : pairs)
    CHECK(partition.node_rank[pair.rotor_node] == partition.node_rank[pair.stator_node]);
  std::vector<double> share(ranks_of(comm));
  for (const int rank : partition.node_rank) share[rank] += 1. * ranks_of(comm) / mesh.nodes.size();
  for (const double s : share) CHECK(s == doctest::Approx(1).epsilon(0.1)); // METIS allows 3 % and pairs are coarse
  for (std::size_t e = 0; e < mesh.elements.size(); ++e)
  {
    const auto& nodes = mesh.elements[e].nodes;
    CHECK(std::any_of(nodes.begin(), nodes.begin() + 8,
                      [&](int n) { return partition.node_rank[n] == partition.element_rank[e]; }));
  }
  CHECK(partition_mesh(mesh, pairs, comm).node_rank == partition.node_rank);
  std::vector<int> first = partition.node_rank;
  MPI_Bcast(first.data(), static_cast<int>(first.size()), MPI_INT, 0, comm);
  CHECK(first == partition.node_rank);
}

TEST_CASE("few points go to ranks without leaving one empty, and too few are refused")
{
  Mesh mesh;
  mesh.nodes.resize(4);
  std::set<int> used;
  for (const int rank : partition_mesh(mesh, {}, comm).node_rank) used.insert(rank);
  CHECK(static_cast<int>(used.size()) == ranks_of(comm));
  mesh.nodes.resize(1);
  if (ranks_of(comm) > 1) CHECK_THROWS_AS(partition_mesh(mesh, {}, comm), Error);
}

TEST_CASE("a geometry is meshed with its parameters, and every rank has the same mesh")
{
  const TemporaryFile file(blocks, ".geo");
  Scene scene = block_scene(file.path());
  scene.mesh->parameters = {{"n", 4}};
  scene.mesh->scale = 0.5;
  scene.points = {{"weight", {0, 0, 7}, 1, {}}};
  const Mesh mesh = read_mesh(scene, comm);
  CHECK(mesh.elements.size() == 2 * 4 * 4 * 2);
  CHECK(mesh.nodes.size() == 2 * 5 * 5 * 3 + 1);
  CHECK(mesh.points.at("weight") == static_cast<int>(mesh.nodes.size()) - 1);
  CHECK(mesh.nodes.back() == Vec3{0, 0, 7}); // points are in metres already
  CHECK(mesh.surfaces.at("low_face").size() == 16);
  CHECK(mesh.node_groups.at("low").size() == 75);
  double highest = 0;
  for (const int node : mesh.node_groups.at("high")) highest = std::max(highest, mesh.nodes[node][2]);
  CHECK(highest == doctest::Approx(1).epsilon(1e-14)); // 2 units of half a metre

  std::vector<double> sums;
  for (int k = 0; k < 3; ++k)
  {
    double sum = 0;
    for (std::size_t i = 0; i < mesh.nodes.size(); ++i) sum += static_cast<double>(i + 1) * mesh.nodes[i][k];
    for (const Element& element : mesh.elements)
      sum += std::accumulate(element.nodes.begin(), element.nodes.end(), element.part);
    sums.push_back(sum);
  }
  std::vector<double> first = sums;
  MPI_Bcast(first.data(), 3, MPI_DOUBLE, 0, comm);
  CHECK(sums == first); // copies: bit for bit
}
