// ranks: 1 2 3
#include "../support/blocks.hpp"
#include "squeal/mesh/mesh_file.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <doctest/doctest.h>
#include <numeric>

using namespace squeal;
using namespace squeal::test;

namespace
{

const MPI_Comm comm = MPI_COMM_WORLD;

// An element's corners at their places in the reference cell.
std::vector<Vec3> reference(Shape shape)
{
  std::vector<Vec3> x;
  switch (shape)
  {
  case Shape::hex8:
  case Shape::hex20:
  case Shape::hex27:
    x = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    break;
  case Shape::wedge6:
  case Shape::wedge15:
  case Shape::wedge18:
    x = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
    break;
  case Shape::pyramid5:
  case Shape::pyramid13:
  case Shape::pyramid14:
    x = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}};
    break;
  default:
    x = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  }
  for (const std::vector<int>& corners : middles_of(shape))
  {
    Vec3 at{};
    for (const int corner : corners) at = at + 1. / static_cast<double>(corners.size()) * x[corner];
    x.push_back(at);
  }
  return x;
}

const std::map<Shape, double> volumes = {
    {Shape::hex8, 1},           {Shape::hex20, 1},        {Shape::hex27, 1},         {Shape::wedge6, 1. / 2},
    {Shape::wedge15, 1. / 2},   {Shape::wedge18, 1. / 2}, {Shape::pyramid5, 1. / 3}, {Shape::pyramid13, 1. / 3},
    {Shape::pyramid14, 1. / 3}, {Shape::tet10, 1. / 6},   {Shape::tet4, 1. / 6}};

} // namespace

TEST_CASE("corner faces enclose the reference cell, outward")
{
  for (const auto& [shape, expected] : volumes)
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
  for (const auto& [shape, volume] : volumes)
  {
    FileMesh file;
    file.nodes = reference(shape);
    ElementBlock block{3, gmsh_type(shape), "", node_count(shape), {}, {"body"}};
    Element inside_out{shape, 0, {}};
    std::iota(inside_out.nodes.begin(), inside_out.nodes.end(), 0);
    mirror(inside_out);
    block.nodes.assign(inside_out.nodes.begin(), inside_out.nodes.begin() + node_count(shape));
    file.blocks = {block};
    Scene scene;
    scene.parts = {{"body", {}, 0, {}}};
    const Mesh mesh = build_mesh(file, scene);
    const Element& mended = mesh.elements.at(0);
    const auto x = [&](int i) { return mesh.nodes[mended.nodes[i]]; };
    const int corners = corner_count(shape);
    const bool quadrilateral = corners == 8 || corners == 5; // first face
    CHECK(dot(cross(x(1) - x(0), x(quadrilateral ? 3 : 2) - x(0)), x(quadrilateral ? 4 : 3) - x(0)) == 1);
    for (int i = corners; const std::vector<int>& of : middles_of(shape)) // coordinates are halves: exact
    {
      Vec3 at{};
      for (const int corner : of) at = at + 1. / static_cast<double>(of.size()) * x(corner);
      CHECK(norm(x(i++) - at) == 0);
    }
  }
}

TEST_CASE("faces look out of the solid they bound")
{
  const TemporaryFile file(blocks, ".geo");
  const Mesh mesh = read_everywhere(block_scene(file.path()));
  const std::map<std::string, double> outward = {{"low_face", 1}, {"base", -1}, {"high_face", -1}, {"roof", 1}};
  for (const auto& [name, sign] : outward)
    for (const Face& face : mesh.surfaces.at(name))
    {
      const auto x = [&](int i) { return mesh.nodes[face.nodes[i]]; };
      CHECK(cross(x(1) - x(0), x(2) - x(0))[2] * sign > 0);
    }
}

TEST_CASE("a wrong name is answered with the nearest right one")
{
  const TemporaryFile file(blocks, ".geo");
  const auto problem = [&](auto change)
  {
    Scene scene = block_scene(file.path());
    change(scene);
    return problem_of([&] { read_everywhere(scene); });
  };
  CHECK(has(problem([](Scene& s) { s.parts[0].name = "lowe"; }), "did you mean 'low'?"));
  CHECK(has(problem([](Scene& s) { s.mesh->parameters["shif"] = 1; }), "did you mean 'shift'?"));
  CHECK(has(problem([](Scene& s) { s.parts.pop_back(); }), "in physical group 'high'"));
  CHECK(has(problem([](Scene& s) { s.parts[0].thickness = 1; }), "remove the thickness"));
  CHECK(has(problem([](Scene& s) { s.mesh->file += ".gone"; }), "no such mesh file"));
  const Mesh mesh = read_everywhere(block_scene(file.path()));
  CHECK(has(problem_of([&] { (void)named_faces(mesh, "low_fase", "contact"); }), "did you mean 'low_face'?"));
  CHECK(has(problem_of([&] { (void)named_nodes(mesh, "bas", "support"); }), "did you mean 'base'?"));
}

TEST_CASE("a group of two dimensions holds no support: all of its volume would be held")
{
  const TemporaryFile file(std::string(blocks) + "Physical Volume(\"roof\", 77) = {2};\n", ".geo");
  const Mesh mesh = read_everywhere(block_scene(file.path()));
  CHECK(mesh.surfaces.at("roof").size() == 9); // as a surface it has one meaning
  CHECK(has(problem_of([&] { (void)named_nodes(mesh, "roof", "support"); }), "\"roof\" names surfaces and volumes"));
}

TEST_CASE("gmsh's own words reach the message")
{
  const TemporaryFile file("Point(1) = {0, 0} 1;\n", ".geo");
  CHECK(has(problem_of([&] { read_everywhere(block_scene(file.path())); }), "syntax error"));
}

TEST_CASE("an empty mesh is an error, and 4-node tetrahedra are read")
{
  const TemporaryFile empty("Point(1) = {0, 0, 0};\n", ".geo");
  CHECK(has(problem_of([&] { read_everywhere(block_scene(empty.path())); }), "no elements"));
  const TemporaryFile tets("SetFactory(\"OpenCASCADE\"); Box(1) = {0, 0, 0, 1, 1, 1};\n"
                           "Physical Volume(\"low\") = {1}; Mesh.MeshSizeMin = 1;\n",
                           ".geo");
  Scene scene = block_scene(tets.path());
  scene.parts.pop_back();
  scene.contacts.clear();
  const Mesh mesh = read_everywhere(scene);
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
  CHECK(scan_mesh_input(outer.path()).parameters == std::vector<std::string>{"deep", "a", "d", "e"});
}

TEST_CASE("a geometry is meshed with its parameters, and every rank has the same mesh")
{
  const TemporaryFile file(blocks, ".geo");
  Scene scene = block_scene(file.path());
  scene.mesh->parameters = {{"n", 4}};
  scene.mesh->scale = 0.5;
  scene.points = {{"weight", {0, 0, 7}, 1, {}}};
  const Mesh mesh = read_everywhere(scene);
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
