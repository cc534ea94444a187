/// Mesh files and geometries, read by the mesher.
#include "squeal/mesh/mesh_file.hpp"

#include "mesher_process.hpp"
#include "squeal/base/error.hpp"
#include "squeal/mesh/script.hpp"

#include <algorithm>

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
  MesherTask task{source.file.string(), {}, source.parameters};
  const bool trusted = source.statements == Statements::any;
  const bool geometry = trusted ? source.file.extension() == ".geo" : is_script(source.file);
  if (!is_file(source.file)) throw Error(shortened(source.file) + ": no such mesh file");
  if (geometry)
  {
    const Script script = read_script(source.file, source.statements);
    task.script = script.text;
    check_parameters(source, script.parameters);
  }
  else if (!source.parameters.empty())
    throw Error(task.file + ": [mesh.parameters] need a .geo geometry; a mesh file has none. Remove them");
  return task;
}

/// Puts the file's own name in the place of the one that gmsh was given.
std::string with_name(std::string text, const std::string& file)
{
  const std::string given = "/proc/self/fd/" + std::to_string(script_descriptor);
  for (std::size_t at = text.find(given); at != std::string::npos; at = text.find(given, at + file.size()))
    text.replace(at, given.size(), file);
  return text;
}

} // namespace

#ifdef SQUEAL_WITH_GMSH

FileMesh read_mesh_file(const MeshSource& source)
{
  const std::string name = source.file.string();
  MesherAnswer answer = run_mesher(task_of(source));
  if (!answer.problem.empty()) throw Error(name + ": gmsh cannot read or mesh it: " + with_name(answer.problem, name));
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
