/// Mesh files and geometries read through libgmsh.
#include "squeal/mesh/mesh_file.hpp"

#include "squeal/base/error.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <regex>
#ifdef SQUEAL_WITH_GMSH
#include <gmsh.h>
#endif

namespace squeal
{

namespace
{

std::string content_of(const std::filesystem::path& file)
{
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Returns the text without comments, strings and what stands in braces.
/// Names and "=" remain of a DefineConstant list. std::regex is not used because it recurses once per character, and a
/// long comment would exhaust the stack.
std::string without_nested_text(const std::string& text)
{
  std::string result;
  int depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i)
  {
    const auto skip_to = [&](const char* end, std::size_t from)
    { i = std::min(text.find(end, from), text.size()) + std::strlen(end) - 1; };
    if (text.compare(i, 2, "//") == 0)
      skip_to("\n", i);
    else if (text.compare(i, 2, "/*") == 0)
      skip_to("*/", i + 2);
    else if (text[i] == '"')
      skip_to("\"", i + 1);
    else if (text[i] == '{')
      ++depth;
    else if (text[i] == '}')
      --depth;
    else if (depth == 0)
      result += text[i];
  }
  return result;
}

} // namespace

std::vector<std::string> geometry_parameters(const std::filesystem::path& file)
{
  static const std::regex include("Include\\s+\"([^\"\\n]+)\""), entry(R"((?:^|,)\s*([A-Za-z_]\w*)\s*(?==|,|$))");
  std::vector<std::string> names;
  const std::string text = content_of(file);
  for (std::sregex_iterator it(text.begin(), text.end(), include), end; it != end; ++it)
    for (std::string& name : geometry_parameters(file.parent_path() / (*it)[1].str())) names.push_back(std::move(name));
  const std::string definitions = without_nested_text(text), word = "DefineConstant";
  for (std::size_t at = definitions.find(word); at != std::string::npos; at = definitions.find(word, at + 1))
  {
    const std::size_t first = definitions.find('[', at), last = definitions.find(']', at);
    if (last == std::string::npos || first > last) break;
    const std::string list = definitions.substr(first + 1, last - first - 1);
    for (std::sregex_iterator e(list.begin(), list.end(), entry), end; e != end; ++e) names.push_back((*e)[1]);
  }
  return names;
}

#ifdef SQUEAL_WITH_GMSH

namespace
{

/// Throws Error if the geometry does not define one of the given parameters.
void check_parameters(const MeshSource& source)
{
  if (source.parameters.empty()) return;
  if (source.file.extension() != ".geo")
    throw Error(source.file.string() + ": [mesh.parameters] need a .geo geometry; a mesh file has none. Remove them");
  const std::vector<std::string> known = geometry_parameters(source.file);
  for (const auto& [name, value] : source.parameters)
    if (std::find(known.begin(), known.end(), name) == known.end())
      throw Error(source.file.string() + ": no parameter '" + name + "' in its DefineConstant lists" +
                  spelling_hint(name, known));
}

/// Initialises libgmsh without output, and finalises it at the end of the read.
/// Caveat: libgmsh keeps -setnumber values as long as the process lives, so a second mesh would see them too.
class GmshSession
{
public:
  explicit GmshSession(const std::map<std::string, double>& parameters)
  {
    std::vector<std::string> arguments = {"squeal"};
    for (const auto& [name, value] : parameters)
    {
      char digits[32];
      std::snprintf(digits, sizeof digits, "%.17g", value);
      arguments.insert(arguments.end(), {"-setnumber", name, digits});
    }
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    gmsh::initialize(static_cast<int>(argv.size()), argv.data(), false);
    gmsh::option::setNumber("General.Terminal", 0);
  }
  ~GmshSession()
  {
    try
    {
      gmsh::finalize();
    }
    catch (...)
    {
    }
  }
  GmshSession(const GmshSession&) = delete;
  GmshSession& operator=(const GmshSession&) = delete;
};

/// Reads all nodes. Returns the index of each gmsh node tag; -1 for tags that are not used.
std::vector<int> read_nodes(double scale, FileMesh& mesh)
{
  std::vector<std::size_t> tags;
  std::vector<double> coordinates, parametric;
  gmsh::model::mesh::getNodes(tags, coordinates, parametric);
  std::vector<int> index_of(tags.empty() ? 0 : *std::max_element(tags.begin(), tags.end()) + 1, -1);
  for (std::size_t i = 0; i < tags.size(); ++i)
  {
    index_of[tags[i]] = static_cast<int>(i);
    mesh.nodes.push_back({scale * coordinates[3 * i], scale * coordinates[3 * i + 1], scale * coordinates[3 * i + 2]});
  }
  return index_of;
}

/// Names of the physical groups that an entity belongs to.
std::vector<std::string> groups_of(int dimension, int entity)
{
  std::vector<int> tags;
  gmsh::model::getPhysicalGroupsForEntity(dimension, entity, tags);
  std::vector<std::string> names;
  for (const int tag : tags)
  {
    std::string name;
    gmsh::model::getPhysicalName(dimension, std::abs(tag), name);
    names.push_back(name.empty() ? std::to_string(std::abs(tag)) : name);
  }
  return names;
}

void read_blocks(const std::vector<int>& index_of, FileMesh& mesh)
{
  gmsh::vectorpair entities;
  gmsh::model::getEntities(entities);
  for (const auto& [dimension, entity] : entities)
  {
    std::vector<int> types;
    std::vector<std::vector<std::size_t>> elements, nodes;
    gmsh::model::mesh::getElements(types, elements, nodes, dimension, entity);
    for (std::size_t k = 0; k < types.size(); ++k)
    {
      ElementBlock block{dimension, types[k], {}, 0, {}, groups_of(dimension, entity)};
      int order = 0, primary = 0, d = 0;
      std::vector<double> local;
      gmsh::model::mesh::getElementProperties(types[k], block.type_name, d, order, block.nodes_per_element, local,
                                              primary);
      for (const std::size_t tag : nodes[k]) block.nodes.push_back(index_of[tag]);
      mesh.blocks.push_back(std::move(block));
    }
  }
}

/// Whether the file brought elements of surfaces or volumes.
bool has_elements()
{
  for (const int dimension : {2, 3})
  {
    std::vector<int> types;
    std::vector<std::vector<std::size_t>> elements, nodes;
    gmsh::model::mesh::getElements(types, elements, nodes, dimension);
    if (!types.empty()) return true;
  }
  return false;
}

FileMesh read_with_gmsh(const MeshSource& source)
{
  const GmshSession session(source.parameters);
  gmsh::open(source.file.string());
  if (!has_elements()) gmsh::model::mesh::generate(3);
  std::string problem;
  gmsh::logger::getLastError(problem);
  if (!problem.empty()) throw Error(problem);
  FileMesh mesh;
  read_blocks(read_nodes(source.scale, mesh), mesh);
  return mesh;
}

} // namespace

FileMesh read_mesh_file(const MeshSource& source)
{
  const std::string name = source.file.string();
  if (!std::filesystem::is_regular_file(source.file)) throw Error(name + ": no such mesh file");
  check_parameters(source);
  std::string problem;
  try
  {
    return read_with_gmsh(source);
  }
  catch (const std::string& text) // libgmsh before 4.9 throws strings
  {
    problem = text;
  }
  catch (const std::exception& error)
  {
    problem = error.what();
  }
  throw Error(name + ": gmsh cannot read or mesh it: " + problem);
}

#else

FileMesh read_mesh_file(const MeshSource& source)
{
  throw Error(source.file.string() + ": this squeal was built without libgmsh and reads no meshes; rebuild with "
                                     "-DSQUEAL_GMSH=ON, or give matrices or points");
}

#endif

} // namespace squeal
