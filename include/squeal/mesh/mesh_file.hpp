#pragma once
/// The content of a mesh file, before the scene's parts and surfaces are extracted from it.
#include "squeal/mesh/mesh.hpp"

#include <string>
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

struct FileMesh
{
  std::vector<Vec3> nodes; // [m]
  std::vector<ElementBlock> blocks;
};

/// Returns the content of a mesh file, or of the mesh that libgmsh generates on a geometry. To be called on one rank.
/// Throws Error for: a missing file; a failure of libgmsh, with its message; a parameter that the .geo does not define;
/// a build without libgmsh.
FileMesh read_mesh_file(const MeshSource& source);

/// Returns the names in the DefineConstant lists of a .geo file and of the files it includes.
std::vector<std::string> geometry_parameters(const std::filesystem::path& file);

} // namespace squeal
