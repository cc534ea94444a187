/// Mesh files and geometries, read by the mesher.
#include "squeal/mesh/mesh_file.hpp"

#include "mesher_process.hpp"
#include "squeal/base/error.hpp"
#include "squeal/mesh/mesh_input.hpp"

#include <algorithm>
#include <cstdio>

namespace squeal
{

namespace
{

/// Throws Error if the geometry does not define one of the given parameters.
void check_parameters(const MeshSource& source, const std::vector<std::string>& known)
{
  for (const auto& [name, value] : source.parameters)
    if (std::find(known.begin(), known.end(), name) == known.end())
      throw Error(source.file.string() + ": no parameter '" + name + "' in its DefineConstant lists" +
                  spelling_hint(name, known));
}

/// Throws Error for a file that the mesher must not see.
MesherTask task_of(const MeshSource& source)
{
  const MeshInput input = scan_mesh_input(source.file);
  if (source.statements == Statements::listed) check_first_bytes(source.file);
  if (is_geometry(source.file))
    check_parameters(source, input.parameters);
  else if (!source.parameters.empty())
    throw Error(source.file.string() + ": [mesh.parameters] need a .geo geometry; a mesh file has none. Remove them");
  const bool trusted = source.statements == Statements::any;
  return {source.file.string(), trusted ? MesherRights::free : MesherRights::shut_in, source.parameters};
}

/// Throws the mesher's error. A file that cannot be opened may be one that the script wanted to write.
[[noreturn]] void fail(const MeshSource& source, const std::string& problem)
{
  const bool refused = source.statements == Statements::listed && problem.find("open file") != std::string::npos;
  throw Error(source.file.string() + ": gmsh cannot read or mesh it: " + problem +
              (refused ? "; no file is written unless --allow-scripts is given" : ""));
}

} // namespace

#ifdef SQUEAL_WITH_GMSH

FileMesh read_mesh_file(const MeshSource& source)
{
  const std::string name = source.file.string();
  MesherAnswer answer = run_mesher(task_of(source));
  if (!answer.left_open.empty())
    std::printf("  %s is not shut in on this system: %s\n", name.c_str(), answer.left_open.c_str());
  if (!answer.problem.empty()) fail(source, answer.problem);
  for (Vec3& node : answer.mesh.nodes) node = source.scale * node;
  return std::move(answer.mesh);
}

#else

FileMesh read_mesh_file(const MeshSource& source)
{
  throw Error(source.file.string() + ": this squeal was built without libgmsh and reads no meshes; rebuild with "
                                     "-DSQUEAL_GMSH=ON, or give matrices or points");
}

#endif

} // namespace squeal
