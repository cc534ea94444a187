#pragma once
/// Mesh files and geometries, read by gmsh in a process of its own.
#include "squeal/mesh/file_mesh.hpp"
#include "squeal/mesh/mesh.hpp"

#include <string>
#include <vector>

namespace squeal
{

/// Returns the content of a mesh file, or of the mesh that gmsh generates on a geometry, in metres. To be called on one
/// rank. Throws Error for: a missing file; a content that does not fit the ending of the name; a statement that a
/// geometry may not hold; a failure or a crash of gmsh, with its message; a parameter that the .geo does not define;
/// a build without libgmsh.
FileMesh read_mesh_file(const MeshSource& source);

} // namespace squeal
