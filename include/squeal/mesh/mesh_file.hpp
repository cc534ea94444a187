#pragma once
/// Mesh files and geometries, read by gmsh in a process of its own.
#include "squeal/mesh/file_mesh.hpp"
#include "squeal/mesh/mesh.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace squeal
{

/// Returns the content of a mesh file, or of the mesh that gmsh generates on a geometry, in metres. To be called on
/// one rank. Throws Error for a missing file, for a content that does not fit the ending of the name, and for a file
/// that starts programs. It does so for a failure or a crash of gmsh, with its message. It does so for a parameter that
/// the .geo does not define, and in a build without libgmsh.
FileMesh read_mesh_file(const MeshSource& source);

/// Divides every element so many times: lines in 2, faces in 4, solids in 8, by their shape functions. New nodes follow
/// those that are there. Elements that squeal has no shape for stay. Throws Error for more than memory holds.
void refine(FileMesh& mesh, int times);

/// Returns the parts, surfaces and groups of a file under the names that the scene gives. Throws Error as read_mesh.
Mesh build_mesh(const FileMesh& file, const Scene& scene);

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
