#pragma once
/// Statements of a mesh or a geometry about itself before gmsh reads it. Not collective.
#include <filesystem>
#include <string>
#include <vector>

namespace squeal
{

/// The files that gmsh will read, and what it can be given.
struct MeshInput
{
  std::vector<std::string> parameters;      // names in DefineConstant lists; none of a mesh
  std::vector<std::filesystem::path> files; // the mesh or geometry, then what it includes or merges by name
};

/// Returns whether gmsh runs the file as a script: by its ending, since a file with another one is a mesh or a shape.
bool is_geometry(const std::filesystem::path& file);

/// Scans a geometry and the files that it includes; those that are missing are left to gmsh. Throws Error if `file`
/// itself is no file that can be read.
MeshInput scan_mesh_input(const std::filesystem::path& file);

/// Throws Error if the first bytes do not fit the ending: gmsh would run the file as a script.
void check_first_bytes(const std::filesystem::path& file);

} // namespace squeal
