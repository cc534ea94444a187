#pragma once
/// The mesh, whole on every rank (topology only; matrices and vectors are distributed), and its partition. No PETSc.
#include "squeal/scene/scene.hpp"

#include <map>
#include <mpi.h>
#include <string>
#include <vector>

namespace squeal
{

/// Node order: corners then mid-sides, as gmsh numbers them (hex20 and tet10: gmsh's own mid-side order).
enum class Shape
{
  hex8,
  wedge6,
  hex20,
  tet10,
  shell4,
  shell3,
};

int node_count(Shape shape);
bool is_shell(Shape shape);

struct Element
{
  Shape shape{};
  int part = 0; // index in Scene::parts
  std::array<int, 20> nodes{};
};

enum class FaceShape
{
  triangle3,
  quad4,
  triangle6,
  quad8,
  quad9,
};

int node_count(FaceShape shape);

/// A face of a named surface, numbered counter-clockwise seen from outside the solid it bounds.
struct Face
{
  FaceShape shape{};
  std::array<int, 9> nodes{};
};

struct Mesh
{
  std::vector<Vec3> nodes; // [m]; the mesh's own, then the scene's points, then the rigid bodies' reference points
  std::vector<Element> elements;
  std::map<std::string, std::vector<Face>> surfaces;   // named surfaces, those of shells too
  std::map<std::string, std::vector<int>> node_groups; // nodes of every named group of any dimension, ascending
  std::map<std::string, int> points;                   // node of every scene point and rigid body
};

/// Collective: rank 0 reads (libgmsh), every rank receives. Adds points and reference points. A scene without a mesh
/// gives a Mesh of points only. Unused nodes are dropped; a node order that turns a solid inside out is mended.
/// Errors: file missing or unreadable, no elements, a part or group the mesh does not have (with the nearest name it
/// has), an element shape that is not on offer, elements that no part claims.
Mesh read_mesh(const Scene& scene, MPI_Comm comm);

/// Nodes that face each other in contact. `normal` out of the rotor (a) into the stator (b).
struct NodePair
{
  int a = 0, b = 0; // nodes of rotor and stator
  Vec3 normal{};    // unit
  double area = 0;  // [m2] tributary; 0 for points
  int contact = 0;  // index in Scene::contacts
  double gap = 0;   // [m] by which the nodes stand apart; 0 without a reach
};

/// Pairs in order of the scene's contacts. Errors: nodes of either surface without a partner within 1e-6 of the
/// surface's size (how many, the farthest distance and where), partners beyond the contact's reach, faces whose
/// consistent nodal weights are not all positive (6-node triangles, 8-node quads), a missing surface or point.
std::vector<NodePair> match_pairs(const Mesh& mesh, const std::vector<Contact>& contacts);

/// Which rank owns each node and each element. METIS on the node graph with both nodes of a pair as one vertex, so
/// that a pair never straddles ranks; an element goes to the rank that owns most of its nodes.
struct Partition
{
  std::vector<int> node_rank, element_rank;
};

/// Collective; the same on every rank. Errors: more ranks than nodes.
Partition partition_mesh(const Mesh& mesh, const std::vector<NodePair>& pairs, MPI_Comm comm);

} // namespace squeal
