#pragma once
/// The mesh, its contact pairs and its partition. Every rank holds the whole mesh; matrices and vectors are
/// distributed. This room includes no PETSc.
#include "squeal/scene/scene.hpp"

#include <map>
#include <mpi.h>
#include <string>
#include <vector>

namespace squeal
{

/// Shapes of elements. Nodes are ordered as gmsh numbers them: corners first, then mid-side nodes.
enum class Shape
{
  hex8,
  wedge6,
  hex20,
  tet10,
  shell4,
  shell3,
};

struct Element
{
  Shape shape{};
  int part = 0;                // index in Scene::parts
  std::array<int, 20> nodes{}; // indices in Mesh::nodes; the first node_count(shape) are used
};

/// Shapes of the faces of solids, which are those of shells too. Nodes are ordered as gmsh numbers them.
enum class FaceShape
{
  triangle3,
  quad4,
  triangle6,
  quad8,
  quad9,
};

/// A face of a named surface. Its nodes are counter-clockwise seen from outside the solid it bounds.
struct Face
{
  FaceShape shape{};
  std::array<int, 9> nodes{}; // indices in Mesh::nodes; the first node_count(shape) are used
};

/// Nodes, elements and named sets of them. Nodes of the file come first, then the scene's points, then the reference
/// points of rigid bodies.
struct Mesh
{
  std::vector<Vec3> nodes;                             // [m]
  std::vector<Element> elements;                       // in the order of the file
  std::map<std::string, std::vector<Face>> surfaces;   // of every named surface, those of shells included
  std::map<std::string, std::vector<int>> node_groups; // nodes of every named group of any dimension, ascending
  std::map<std::string, int> points;                   // node of every scene point and rigid body
};

/// Returns the scene's mesh with its points and reference points; without a mesh file it holds these points only.
/// Collective: rank 0 reads the file through libgmsh and broadcasts it. Nodes that no element uses are dropped, and
/// elements numbered inside out are renumbered.
/// Throws Error for: a missing or unreadable file; a mesh without elements; a shape that has no kernel; solid elements
/// in no part; a part, group or point that the mesh does not have.
Mesh read_mesh(const Scene& scene, MPI_Comm comm);

/// A node-to-node contact pair.
struct NodePair
{
  int a = 0;       // node of the rotor
  int b = 0;       // node of the stator
  Vec3 normal{};   // [-] unit, out of the rotor into the stator
  double area = 0; // [m2] tributary area of node a; 0 for points
  int contact = 0; // index in Scene::contacts
  double gap = 0;  // [m] distance of the nodes along the normal; 0 for a contact without a reach
};

/// Returns the contact pairs in the order of the contacts.
/// Throws Error for: a node of either surface without a partner within 1e-6 of the surface's size; partners farther
/// apart than the contact's reach; faces with nodal weights that are not all positive; a missing surface or point.
std::vector<NodePair> match_pairs(const Mesh& mesh, const std::vector<Contact>& contacts);

/// Owner of each node and of each element.
struct Partition
{
  std::vector<int> node_rank;
  std::vector<int> element_rank; // the rank that owns most of the element's nodes
};

/// Returns a partition by METIS, the same on every rank. Both nodes of a pair have the same owner. Collective.
/// Throws Error if there are more ranks than nodes.
Partition partition_mesh(const Mesh& mesh, const std::vector<NodePair>& pairs, MPI_Comm comm);

} // namespace squeal
