#pragma once
/// The content of a mesh file, before the scene's parts and surfaces are extracted from it. In this form it goes from
/// the mesher to the program. This header knows no MPI, because the mesher knows none. Not collective.
#include "squeal/base/vec3.hpp"

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace squeal
{

/// The elements of one type on one geometrical entity of the file.
struct ElementBlock
{
  int dimension = 0; // 0 to 3
  int type = 0;      // gmsh's number of the element type
  std::string type_name;
  int nodes_per_element = 0;
  std::vector<int> nodes;          // indices in FileMesh::nodes, element by element
  std::vector<std::string> groups; // physical groups of the entity; a group without a name is named by its number
};

/// Nodes with their weights in a sum, ascending.
using NodeWeights = std::vector<std::pair<int, double>>;

/// Nodes and elements of a file.
struct FileMesh
{
  std::vector<Vec3> nodes; // in the unit of the file
  std::vector<ElementBlock> blocks;
  std::vector<NodeWeights> parents{};    // of the last nodes, which the last division made of those before
  std::map<NodeWeights, Vec3> middles{}; // of straight edges and faces, where the geometry has them elsewhere
};

/// The answer of the mesher: a mesh, or why there is none.
struct MesherAnswer
{
  FileMesh mesh;
  std::string problem;   // empty if there is a mesh
  std::string left_open; // by a kernel that cannot shut the mesher in; empty if all is shut
};

/// Returns an answer as bytes of CBOR.
std::string packed(const MesherAnswer& answer);

/// Returns the answer that was packed. Throws std::exception if the bytes are not a whole one.
MesherAnswer unpacked(const std::string& bytes);

/// First arguments of the mesher: it starts no program, opens no connection and writes no file, or gmsh runs all that
/// it is given.
inline constexpr const char *shut_in_mesher = "shut-in", *free_mesher = "free";

/// The descriptor that the mesher writes its answer to.
inline constexpr int answer_descriptor = 3;

} // namespace squeal
