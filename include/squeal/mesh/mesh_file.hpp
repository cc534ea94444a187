#pragma once
/// Mesh files and geometries, read by gmsh in a process of its own.
#include "squeal/mesh/file_mesh.hpp"
#include "squeal/mesh/mesh.hpp"

#include <string>
#include <vector>

namespace squeal
{

/// Returns the content of a mesh file, or of the mesh that gmsh generates on a geometry, in metres. To be called on
/// one rank. Throws Error for a missing file, for a content that does not fit the ending of the name, and for a file
/// that starts programs. It does so for a failure or a crash of gmsh, with its message. It does so for a parameter that
/// the .geo does not define, and in a build without libgmsh.
FileMesh read_mesh_file(const MeshSource& source);

/// Returns the parts, surfaces and groups of a file under the names that the scene gives. Throws Error as read_mesh.
Mesh build_mesh(const FileMesh& file, const Scene& scene);

} // namespace squeal
