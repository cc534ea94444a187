#pragma once
/// A mesh file as libgmsh gives it, before parts and surfaces are made of it.
#include "squeal/mesh/mesh.hpp"

#include <string>
#include <vector>

namespace squeal
{

/// The elements of one type on one entity of the file.
struct FileBlock
{
  int dimension = 0; // 0 to 3
  int type = 0;      // gmsh's element type number
  std::string type_name;
  int nodes_per_element = 0;
  std::vector<int> nodes;          // indices into FileMesh::nodes
  std::vector<std::string> groups; // physical groups of the entity; one without a name is called by its number
};

struct FileMesh
{
  std::vector<Vec3> nodes; // [m]
  std::vector<FileBlock> blocks;
};

/// On one rank. Opens what libgmsh opens; meshes a geometry that brings no elements. Errors: file missing, gmsh's own
/// messages, a parameter that the .geo does not define, a build without libgmsh.
FileMesh read_mesh_file(const MeshSource& source);

/// Parts, surfaces and groups of a file, by the names the scene gives. Errors: read_mesh lists them.
Mesh mesh_of(const FileMesh& file, const Scene& scene);

/// Names in the DefineConstant lists of a .geo and of the files it includes.
std::vector<std::string> geometry_parameters(const std::filesystem::path& file);

} // namespace squeal
