// ranks: 1
// What a geometry says about itself before gmsh reads it, and contents that do not fit their ending.
#include "../support/temporary_folder.hpp"
#include "squeal/mesh/mesh_file.hpp"

#include <doctest/doctest.h>

using namespace squeal;

namespace
{

/// Why the first bytes of a file are refused; empty if they fit.
std::string problem_of(const std::string& text, const std::string& name)
{
  const test::TemporaryFolder folder;
  try
  {
    check_first_bytes(folder.write(name, text));
    return {};
  }
  catch (const Error& error)
  {
    return error.what();
  }
}

} // namespace

TEST_CASE("a geometry's files are those that it includes or merges by name, each once")
{
  const test::TemporaryFolder folder;
  const auto part = folder.write("part.inc", "DefineConstant[ m = 2 ]; Include 'outer.geo'; Merge \"mesh.msh\";");
  const auto mesh = folder.write("mesh.msh", "$MeshFormat\nInclude \"part.inc\";");
  const auto shape = folder.write("shape.step", "ISO-10303");
  const auto outer = folder.write("outer.geo", "Include \"part.inc\"; // Merge \"hidden.msh\";\n"
                                               "/* Include \"x.inc\"; */ v() = ShapeFromFile(\"shape.step\");\n"
                                               "Merge \"missing.msh\";");
  folder.write("hidden.msh", "$MeshFormat\n");
  folder.write("x.inc", "x = 1;");
  const MeshInput input = scan_mesh_input(outer);
  CHECK(input.files == std::vector<std::filesystem::path>{outer, part, mesh, shape});
  CHECK(input.parameters == std::vector<std::string>{"m"});
  const auto options = folder.write("mesh.msh.opt", "Mesh.ElementOrder = 2;");
  CHECK(scan_mesh_input(mesh).files == std::vector<std::filesystem::path>{mesh, options});
  CHECK_THROWS_AS(scan_mesh_input(folder.path / "missing.geo"), Error);
}

TEST_CASE("text without end is scanned to the end of the file")
{
  const test::TemporaryFolder folder;
  for (const char* text : {"DefineConstant[ a = 1 ]; /* open", "DefineConstant[ a = 1 ]; // open",
                           "DefineConstant[ a = 1 ]; \"open", "DefineConstant[ a = {1, 2", "DefineConstant[ a"})
  {
    CAPTURE(text);
    CHECK(scan_mesh_input(folder.write("shape.geo", text)).parameters == std::vector<std::string>{"a"});
  }
  CHECK(scan_mesh_input(folder.write("shape.geo", "")).parameters.empty());
}

TEST_CASE("a file that gmsh would take for a script although its name says otherwise is refused")
{
  for (const char* name : {"a.msh", "a.MSH", "a.unv", "a.vtk", "a.step", "a.med"})
  {
    CAPTURE(name);
    CHECK(problem_of("SystemCall \"id\";", name).find("gmsh would run it as a script") != std::string::npos);
  }
  CHECK(problem_of(" $MeshFormat\n", "innocent.msh") != "");
  CHECK(problem_of("", "innocent.msh") != "");
  CHECK(problem_of("$MeshFormat\n", "shape.msh") == "");
  CHECK(problem_of("    -1\n", "shape.unv") == "");
  CHECK(problem_of("GRID", "shape.bdf") == "");
}
