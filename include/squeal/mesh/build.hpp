#pragma once
/// Extraction of the scene's mesh from the content of a mesh file. Not collective.
#include "squeal/mesh/mesh_file.hpp"

namespace squeal
{

/// Returns the parts, surfaces and groups of a file under the names that the scene gives. Throws Error as read_mesh.
Mesh build_mesh(const FileMesh& file, const Scene& scene);

} // namespace squeal
