#pragma once
/// The mesh and look-ups in it. Rank 0 reads the file; then every rank holds the whole mesh. This room includes no
/// PETSc.
#include "squeal/mesh/file_mesh.hpp"
#include "squeal/scene/scene.hpp"

#include <map>
#include <mpi.h>
#include <string>
#include <vector>

namespace squeal
{

/// Shapes of elements and their faces. Nodes are ordered as gmsh numbers them: corners, mid-side nodes, middles.
/// Elements are solids, or shells if they are faces.
enum class Shape
{
  line2,
  line3,
  triangle3,
  quad4,
  triangle6,
  quad8,
  quad9,
  tet4,
  tet10,
  pyramid5,
  pyramid13,
  pyramid14,
  wedge6,
  wedge15,
  wedge18,
  hex8,
  hex20,
  hex27,
};

/// An element of a part.
struct Element
{
  Shape shape{};
  int part = 0;                // index in Scene::parts
  std::array<int, 27> nodes{}; // indices in Mesh::nodes; the first node_count(shape) are used
};

/// A face of a named surface. Its nodes are counter-clockwise seen from outside the solid it bounds.
struct Face
{
  Shape shape{};
  std::array<int, 9> nodes{}; // indices in Mesh::nodes; the first node_count(shape) are used
  bool of_shell = false;      // counter-clockwise as the shell's nodes are, which may be seen from either side
};

/// A row of a superelement's matrices: a motion of a node.
struct SuperelementRow
{
  int node = 0;            // index in Mesh::nodes
  int motion = 0;          // of motion_words
  bool coordinate = false; // a modal coordinate, which this motion of a node of its own carries
};

/// Nodes, elements and named sets of them. Nodes of the file come first, then the scene's points, then the reference
/// points of rigid bodies and couplings. Nodes within beams follow, and what carries modal coordinates of
/// superelements.
struct Mesh
{
  std::vector<Vec3> nodes;                                 // [m]
  std::vector<Element> elements;                           // in the order of the file
  std::map<std::string, std::vector<Face>> surfaces;       // of every named surface, those of shells included
  std::map<std::string, std::vector<int>> node_groups;     // nodes of every named group of any dimension, ascending
  std::map<std::string, std::vector<int>> dimensions;      // of every named group: 1 has curves, 3 solids, ascending
  std::map<int, std::vector<Vec3>> normals;                // [-] at the nodes of each shell, by its place in elements
  std::map<std::string, int> points;                       // node of every scene point, rigid body and coupling
  std::vector<std::vector<int>> beams;                     // nodes of each of the scene's, from end to end
  std::vector<std::vector<SuperelementRow>> superelements; // in the scene's order
  std::vector<NodeWeights> parents; // of nodes that the last division made, the last of the file; on rank 0
};

/// Returns the scene's mesh with its points and reference points; without a mesh file it holds these points only.
/// Reads the file through libgmsh; not collective. Nodes that no element uses are dropped, and elements numbered inside
/// out are renumbered. Throws Error for a missing or unreadable file, a mesh without elements, a shape that has no
/// kernel, and solid elements in no part. It does so for a part or a body's surface that the mesh does not have.
Mesh read_mesh(const Scene& scene);

/// Puts points, reference points and the nodes of beams where the scene has them.
void place_points(const Scene& scene, Mesh& mesh);

/// Look-up of nodes and surfaces by the names that a scene uses. `user` says in messages which table of the scene asks,
/// such as "spring" or "probe tip". Every function throws Error for an unknown name, with the nearest known one. The
/// mesh must be whole.
///
/// Returns the node of a point, rigid body or coupling.
int point_node(const Mesh& mesh, const std::string& name, const std::string& user);

/// Returns the node of a point, rigid body or coupling, or else the nodes of a group, ascending.
/// Throws Error for a group of several dimensions, as of a surface and a volume of one name.
std::vector<int> named_nodes(const Mesh& mesh, const std::string& name, const std::string& user);

/// Returns the faces of a surface.
const std::vector<Face>& named_faces(const Mesh& mesh, const std::string& name, const std::string& user);

/// The part of a named surface, by its first face, or the point of that name. Empty: it bounds no part.
std::string part_of(const Scene& scene, const Mesh& mesh, const std::string& surface);

/// For every contact the place of the scene's rotor that drives it; -1: none. Throws Error where a rotor is the stator.
std::vector<int> rotors_of_contacts(const Scene& scene, const Mesh& mesh);

/// Returns "node 12 at (x, y, z)" for messages.
std::string node_text(int node, const Vec3& position);

/// Diagonal of the box round places [m]. Not collective.
double diagonal_of(const std::vector<Vec3>& nodes);

/// Gives every rank the mesh that rank 0 has. Collective.
void broadcast_mesh(Mesh& mesh, MPI_Comm comm);

/// The axes 1, 2 and 3 of a frame at a place. Throws Error for one on the axis of a cylinder; `user` says whose frame
/// it is. Not collective.
std::array<Vec3, 3> axes_at(const Frame& frame, const Vec3& place, const std::string& user);

} // namespace squeal
