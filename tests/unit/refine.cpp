// ranks: 1 2
// Division of meshes: every element fills its parent, neighbours agree, groups and surfaces are carried over.
#include "../support/blocks.hpp"
#include "squeal/mesh/contact_pairs.hpp"
#include "squeal/mesh/mesh_file.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <doctest/doctest.h>
#include <numeric>
#include <set>

using namespace squeal;
using namespace squeal::test;

namespace
{

// Corners of an element that is neither straight nor regular, of gmsh's type.
struct Reference
{
  Shape shape;
  int gmsh_type;
  std::vector<Vec3> corners;
};

const std::vector<Vec3> brick = {{0, 0, 0},     {1, 0.1, 0}, {1.1, 1, 0.1}, {0, 1, 0},
                                 {0.1, 0, 0.9}, {1, 0, 1},   {1, 1, 1.2},   {0, 0.9, 1}};
const std::vector<Vec3> prism = {{0, 0, 0}, {1, 0, 0.1}, {0.2, 1, 0}, {0, 0.1, 1}, {1.1, 0, 1}, {0, 1, 0.9}};
const std::vector<Vec3> pyramid = {{0, 0, 0}, {1, 0.1, 0}, {1.1, 1, 0.1}, {0, 1, 0}, {0.4, 0.5, 0.9}};
const std::vector<Vec3> simplex = {{0, 0, 0}, {1, 0.1, 0}, {0.3, 1, 0}, {0.2, 0.1, 0.8}};
const std::vector<Reference> references = {{Shape::hex8, 5, brick},
                                           {Shape::hex20, 17, brick},
                                           {Shape::hex27, 12, brick},
                                           {Shape::wedge6, 6, prism},
                                           {Shape::wedge15, 18, prism},
                                           {Shape::wedge18, 13, prism},
                                           {Shape::pyramid5, 7, pyramid},
                                           {Shape::pyramid13, 19, pyramid},
                                           {Shape::pyramid14, 14, pyramid},
                                           {Shape::tet10, 11, simplex},
                                           {Shape::tet4, 4, simplex},
                                           {Shape::quad4, 3, {{0, 0, 0}, {1, 0, 0}, {1.1, 1, 0}, {0, 0.9, 0}}},
                                           {Shape::triangle3, 2, {{0, 0, 0}, {1, 0, 0}, {0.2, 1, 0}}}};

// One element whose mid-sides are off the middle.
FileMesh single(const Reference& reference)
{
  FileMesh file;
  file.nodes = reference.corners;
  for (const std::vector<int>& corners : middles_of(reference.shape))
  {
    const auto k = static_cast<double>(file.nodes.size());
    Vec3 at = 0.03 * Vec3{std::sin(k), std::cos(k), std::sin(2 * k)};
    for (const int corner : corners) at = at + 1. / static_cast<double>(corners.size()) * file.nodes[corner];
    file.nodes.push_back(at);
  }
  ElementBlock block{
      is_shell(reference.shape) ? 2 : 3, reference.gmsh_type, "", node_count(reference.shape), {}, {"body"}};
  block.nodes.resize(file.nodes.size());
  std::iota(block.nodes.begin(), block.nodes.end(), 0);
  file.blocks = {block};
  return file;
}

Mesh mesh_of(const FileMesh& file, bool shell)
{
  Scene scene;
  scene.parts = {{"body", {}, 0, {}}};
  if (shell) scene.parts[0].thickness = 1;
  return build_mesh(file, scene);
}

// Integrals of 1 and of x y over the elements; fails where one is inside out.
std::array<double, 2> moments(const Mesh& mesh)
{
  std::array<double, 2> sum{};
  for (const Element& element : mesh.elements)
  {
    const NodePositions X = position_matrix(positions_of(mesh, nodes_of(element)));
    for (const auto& [xi, weight, at] : mass_rule(element.shape))
    {
      Eigen::Matrix3d J = X * at.dN.transpose();
      if (is_shell(element.shape)) J.col(2) = Eigen::Vector3d::UnitZ();
      const double volume = weight * J.determinant();
      CHECK(volume > 0);
      const Eigen::Vector3d x = X * at.N;
      sum[0] += volume;
      sum[1] += volume * x(0) * x(1);
    }
  }
  return sum;
}

} // namespace

TEST_CASE("children fill their parent, curved as it is")
{
  for (const Reference& reference : references)
  {
    CAPTURE(reference.gmsh_type);
    FileMesh file = single(reference);
    const bool shell = is_shell(reference.shape);
    const auto whole = moments(mesh_of(file, shell));
    refine(file, 1);
    const Mesh divided = mesh_of(file, shell);
    CHECK(divided.elements.size() == (shell ? 4 : corner_count(reference.shape) == 5 ? 10 : 8));
    const auto parts = moments(divided);
    // The rule of a curved parent is not exact; that of its children has 1/64 of the error and less.
    const double inexact = middles_of(reference.shape).empty() ? 1e-14 : 2e-4;
    CHECK(parts[0] == doctest::Approx(whole[0]).epsilon(inexact));
    if (!middles_of(reference.shape).empty()) continue;
    refine(file, 1);
    const auto again = moments(mesh_of(file, shell));
    CHECK(again[0] == doctest::Approx(parts[0]).epsilon(1e-14));
    CHECK(again[1] == doctest::Approx(parts[1]).epsilon(0.02)); // by the rule of the mass, on smaller elements
  }
}

TEST_CASE("the parents of a new node give its place by weights that add up to one")
{
  for (const Reference& reference : references)
  {
    CAPTURE(reference.gmsh_type);
    FileMesh file = single(reference);
    const std::size_t before = file.nodes.size();
    refine(file, 1);
    const Mesh mesh = mesh_of(file, is_shell(reference.shape));
    REQUIRE(mesh.parents.size() + before == mesh.nodes.size());
    for (std::size_t i = 0; i < mesh.parents.size(); ++i)
    {
      Vec3 at{};
      double sum = 0;
      for (const auto& [node, weight] : mesh.parents[i])
      {
        at = at + weight * mesh.nodes[static_cast<std::size_t>(node)];
        sum += weight;
      }
      if (corner_count(reference.shape) != 5)
        CHECK(sum == 1); // of multiples of powers of two
      else
        CHECK(std::abs(sum - 1) < 1e-14);
      CHECK(norm(at - mesh.nodes[before + i]) < 1e-14);
    }
  }
}

TEST_CASE("a middle on the geometry takes the place of that of the straight side, in the first division")
{
  FileMesh file = single(references[0]);
  const Vec3 edge{0.5, -0.1, 0.05}, face{0.5, 0.5, -0.1};
  file.middles = {{{{0, 0.5}, {1, 0.5}}, edge}, {{{0, 0.25}, {1, 0.25}, {2, 0.25}, {3, 0.25}}, face}};
  refine(file, 1);
  int moved = 0;
  for (std::size_t i = 0; i < file.parents.size(); ++i)
  {
    Vec3 at{};
    for (const auto& [node, weight] : file.parents[i]) at = at + weight * file.nodes[static_cast<std::size_t>(node)];
    const Vec3& place = file.nodes[brick.size() + i];
    if (place == edge || place == face)
      ++moved;
    else
      CHECK(norm(at - place) < 1e-14);
  }
  CHECK(moved == 2);
}

TEST_CASE("neighbours share their new nodes, and surfaces and groups are carried over")
{
  const TemporaryFile file(blocks, ".geo");
  Scene scene = block_scene(file.path());
  const Mesh coarse = read_everywhere(scene);
  scene.mesh->refine = 1;
  const Mesh fine = read_everywhere(scene);
  CHECK(coarse.nodes.size() == 2 * 4 * 4 * 3);
  CHECK(fine.nodes.size() == 2 * 7 * 7 * 5); // any node that neighbours did not share would be one more
  CHECK(fine.elements.size() == 8 * coarse.elements.size());
  CHECK(std::equal(coarse.nodes.begin(), coarse.nodes.end(), fine.nodes.begin()));
  for (const auto& [name, z] : {std::pair{"low_face", 1.}, {"high_face", 1.}, {"roof", 2.}, {"base", 0.}})
  {
    CAPTURE(name);
    CHECK(fine.surfaces.at(name).size() == 4 * 9);
    CHECK(fine.node_groups.at(name).size() == 7 * 7);
    for (const int node : fine.node_groups.at(name)) CHECK(fine.nodes[node][2] == doctest::Approx(z).epsilon(1e-12));
  }
  const ContactPairs pairs = make_pairs(fine, scene);
  CHECK(pairs.pairs.size() == 7 * 7);
  double area = 0;
  for (const ContactPair& pair : pairs.pairs) area += pair.area;
  CHECK(area == doctest::Approx(1).epsilon(1e-12));
}

TEST_CASE("quadratic tetrahedra of gmsh are divided without gaps")
{
  std::string text = blocks;
  text.replace(text.find("Mesh.ElementOrder = 1"), 21, "Mesh.ElementOrder = 2; Mesh.SecondOrderIncomplete = 1");
  for (const std::string bricks : {"Transfinite Surface {s}; Recombine Surface {s};", " Recombine;", ":1"}) // one block
    text.replace(text.find(bricks), bricks.size(), bricks == ":1" ? ":0" : "");
  const TemporaryFile file(text, ".geo");
  Scene scene = block_scene(file.path());
  scene.parts.pop_back();
  scene.contacts.clear();
  const Mesh coarse = read_everywhere(scene);
  scene.mesh->refine = 1;
  const Mesh fine = read_everywhere(scene);
  REQUIRE(coarse.elements.at(0).shape == Shape::tet10);
  CHECK(fine.elements.size() == 8 * coarse.elements.size());
  // Euler's formula of a ball, corners - edges + faces - solids = 1; a gap would change it.
  std::set<int> corners;
  std::set<std::pair<int, int>> edges;
  std::set<std::array<int, 3>> faces;
  for (const Element& e : fine.elements)
  {
    for (int i = 0; i < 4; ++i) corners.insert(e.nodes[i]);
    for (const auto& ends : middles_of(e.shape)) edges.insert(std::minmax(e.nodes[ends[0]], e.nodes[ends[1]]));
    for (const auto& face : corner_faces(e.shape))
    {
      std::array<int, 3> key{e.nodes[face[0]], e.nodes[face[1]], e.nodes[face[2]]};
      std::ranges::sort(key);
      faces.insert(key);
    }
  }
  const auto n = [](const auto& set) { return static_cast<long>(set.size()); };
  CHECK(n(corners) - n(edges) + n(faces) - n(fine.elements) == 1);
  CHECK(n(corners) == static_cast<long>(coarse.nodes.size())); // every old node, mid-sides too, is a corner now
  CHECK(n(corners) + n(edges) == static_cast<long>(fine.nodes.size()));
}
