// ranks: 1
// A geometry may hold listed statements only, and gmsh sees nothing that the scanner has not understood.
#include "squeal/mesh/script.hpp"
#include "../support/temporary_folder.hpp"

#include <doctest/doctest.h>

using namespace squeal;

namespace
{

/// What is wrong with a geometry of this text; empty if it may be run.
std::string problem_of(const std::string& text, const std::string& name = "shape.geo")
{
  const test::TemporaryFolder folder;
  const auto file = folder.write(name, text);
  try
  {
    if (is_script(file)) read_script(file, Statements::listed);
    return {};
  }
  catch (const Error& error)
  {
    return error.what();
  }
}

bool has(const std::string& text, const std::string& part)
{
  return text.find(part) != std::string::npos;
}

} // namespace

TEST_CASE("statements of geometry, sizes, groups, constants and loops may be run")
{
  const char* allowed[] = {
      "lc = 0.1; Point(1) = {0, 0, 0, lc}; p[] += {1}; n = #p[]; x = p[0] * 2e-3 + .5;",
      "For i In {1:3} Point(i) = {i, 0, 0}; EndFor For (1:2) q = newp; EndFor",
      "a = 1; If (a == 1 && !Exists(b)) c = 2; ElseIf (a > 2) c = 3; Else c = 4; EndIf",
      "Macro Corner p = newp; Point(p) = {x, y, 0}; Return x = 0; y = 1; Call Corner;",
      "Macro Corner x = 1; Return Call \"Corner\";",
      "SetFactory('OpenCASCADE'); Box(1) = {0, 0, 0, 1, 1, 1}; v() = BooleanFragments{ Volume{1}; Delete; }{};",
      "DefineConstant[ n = {3, Min 1, Max 9, Step 1, Name \"Mesh/n\"}, m = 2 ]; x = n + m;",
      "x~{1} = 2; y = x~{1}; z(0) = 3; w[{0, 1}] = {1, 2}; x += 1; x++;",
      "Physical Volume(\"disc\", 3) = {1}; Physical Surface('face') -= {2};",
      "Field[1] = Distance; Field[1].PointsList = {1}; Field[2] = MathEval; Field[2].F = \"0.1 + x^2\"; Background "
      "Field = 2;",
      "Mesh.ElementOrder = 2; Mesh.MeshSizeMax = 0.1; Geometry.OCCTargetUnit = \"M\"; General.Terminal = 1; Mesh 3;",
      "Transfinite Curve{1, 2} = 5 Using Progression 1.1; Transfinite Surface{:} Left; Recombine Surface{:};",
      "out[] = Extrude {0, 0, 1} { Surface{1}; Layers{ {2, 3}, {0.5, 1} }; Recombine; }; Coherence;",
      "Periodic Surface {2} = {1} Translate {0, 0, 1}; Characteristic Length { 1 } = 0.1; Color Red { Surface{1}; }",
      "General.Color.Text = White; Mesh.Color.Points = {255, 0, 0}; Geometry.Color.Surfaces = Geometry.Color.Points;",
      "Characteristic Length { PointsOf{ Volume{:}; } } = 1; p() = Point In BoundingBox{0, 0, 0, 1, 1, 1};",
      "bb() = BoundingBox Surface { 1 }; Extrude { Surface{1}; } Using Wire {1}; Rotate {{0, 0, 1}, {0, 0, 0}, -Pi/4} "
      "{ Point{3}; }",
      "Function Hole x[t] = newreg; Surface Loop(x[t]) = {1}; Return t = 1; Call Hole; Physical Volume (t) = x[0];",
      "Macro A x = 1; Return Macro B Call A; Call A; Return Call B;",
      "OptimizeMesh \"Gmsh\"; SetOrder 2; Coherence Mesh; Show {Volume{1};} Hide {:}; Recursive Delete { Volume{2}; }",
      "Error(\"n is %g\", 3); Printf(\"a > b\"); // SystemCall \"x\"\n/* Save \"y\"; */",
  };
  for (const char* text : allowed)
  {
    CAPTURE(text);
    CHECK(problem_of(text) == "");
  }
}

TEST_CASE("a statement that reaches a file, a process or the environment is named with its line")
{
  const char* refused[] = {
      "SystemCall \"id\";",
      "SystemCall Str(\"i\", \"d\");",
      "NonBlockingSystemCall 'id';",
      "System \"id\";",
      "OnelabRun(\"getdp\", \"x\");",
      "Save \"out.msh\";",
      "Print \"out.png\";",
      "Printf(\"x\") > \"out\";",
      "Printf(\"x\") >> \"out\";",
      "Error(\"x\") > \"out\";",
      "CreateDir \"out\";",
      "x[] = ListFromFile[\"/etc/passwd\"];",
      "x = GetEnv(\"HOME\");",
      "x = GetValue(\"number?\", 1);",
      "Plugin(MathEval).Run;",
      "Field[1] = ExternalProcess; Field[1].CommandLine = \"id\";",
      "Field[1] = Structured;",
      "Solver.Executable0 = \"id\";",
      "General.ErrorFileName = \"out\";",
      "General.Color.Text = GetEnv(\"HOME\");",
      "Geometry.DoubleClickedPointCommand = \"SystemCall 'id';\";",
      "View \"v\" { };",
      "Exit;",
      "Sleep 1000;",
      "Unheard \"of\";",
      "x = Unheard(\"of\");",
      // a word that the script defines is no statement for that
      "SystemCall = 1; SystemCall \"id\";",
      "Unheard = 1; Unheard \"of\";",
      "Unheard = 1; x = Unheard(\"of\");",
      "Macro Unheard x = 1; Return Unheard \"of\";",
      "DefineConstant[ SystemCall = 1 ]; SystemCall \"id\";",
      "Include Str(\"a\", \"b\");",
      // macros that would never end
      "Macro A Call A; Return Call A;",
      "Macro A x = 1; Call B; Return Function B If (x) Call A; EndIf Return Call A;",
      "Macro A Call Str(\"A\"); Return",
      // the ends of comments and texts as gmsh sees them
      "// x \r /*\n SystemCall \"id\"; // */",
      "x = 1; /* */ SystemCall \"id\"; /* */",
      "If (0) a = 1; EndIf SystemCall \"id\";",
      "a = '\"'; SystemCall \"id\"; b = '\"';",
  };
  for (const char* text : refused)
  {
    CAPTURE(text);
    const std::string problem = problem_of("x = 1;\n" + std::string(text));
    CHECK(has(problem, "shape.geo, line "));
  }
  CHECK(has(problem_of("x = 1;\n\nSystemCall \"id > PWNED\";"), "line 3: the statement  SystemCall \"id > PWNED\";"));
}

TEST_CASE("texts, names and files have bounds")
{
  CHECK(has(problem_of("x = \"" + std::string(1100, 'a') + "\";"), "more than 1000 characters"));
  CHECK(has(problem_of("a = \"/*\"; b = \"*/ EndIf\";"), "may take for a part"));
  CHECK(has(problem_of("a = \"x\ny\";"), "end of its line"));
  CHECK(has(problem_of("x = \"open"), "has no end"));
  CHECK(has(problem_of("/* open"), "has no end"));
  CHECK(has(problem_of(std::string(30000, 'a') + " = 1;"), "30000 characters"));
  CHECK(has(problem_of("x = {1, 2); "), "has no partner"));
  CHECK(has(problem_of(std::string("x = 1; \0 y = 2;", 15)), "byte 0x00"));
  CHECK(has(problem_of("Include \"" + std::string(900, 'a') + "\";"), "no such"));
  CHECK(problem_of("x = " + std::string(200000, '(') + "1" + std::string(200000, ')') + ";") == "");
}

TEST_CASE("included files are held to the same, and an endless inclusion ends")
{
  const test::TemporaryFolder folder;
  const auto problem = [&](const std::string& text)
  {
    try
    {
      read_script(folder.write("outer.geo", text), Statements::listed);
      return std::string();
    }
    catch (const Error& error)
    {
      return std::string(error.what());
    }
  };
  folder.write("good.inc", "y = 2; // a comment");
  folder.write("bad.inc", "y = 2;\nSystemCall \"id\";");
  folder.write("deep.inc", "Include \"bad.inc\";");
  folder.write("mesh.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n");
  folder.write("fake.msh", "SystemCall \"id\";");
  CHECK(problem("x = 1; Include \"good.inc\"; z = x + y;") == "");
  CHECK(problem("Merge \"mesh.msh\";") == "");
  CHECK(has(problem("Include \"bad.inc\";"), "bad.inc, line 2"));
  CHECK(has(problem("Include \"deep.inc\";"), "bad.inc, line 2"));
  CHECK(has(problem("Merge \"fake.msh\";"), "fake.msh"));
  CHECK(has(problem("Include \"outer.geo\";"), "includes itself"));
  CHECK(has(problem("Include \"/dev/zero\";"), "no such"));
  CHECK(has(problem("Include \".\";"), "no such"));
  const auto script =
      read_script(folder.write("lines.geo", "x = 1;\nInclude \"good.inc\";\nz = 3;"), Statements::listed);
  CHECK(script.text == "x = 1 ; y = 2 ; \n\nz = 3 ; \n");
}

TEST_CASE("a file that gmsh would take for a script although its name says otherwise is refused")
{
  CHECK(has(problem_of("SystemCall \"id\";", "innocent.msh"), "gmsh would run it as a script"));
  CHECK(has(problem_of(" $MeshFormat\n", "innocent.msh"), "gmsh would run it as a script"));
  CHECK(has(problem_of("x = 1;", "shape.pro"), "ending"));
  CHECK(has(problem_of("x = 1;", "shape.py"), "ending"));
  CHECK(has(problem_of("x = 1;", "shape.geo.gz"), "ending"));
  CHECK(has(problem_of("$MeshFormat\n", "shape.geo"), "a mesh ends in .msh"));
  CHECK(problem_of("$MeshFormat\n", "shape.msh") == "");
  const test::TemporaryFolder folder;
  folder.write("shape.msh.opt", "SystemCall \"id\";");
  CHECK_THROWS_AS(is_script(folder.write("shape.msh", "$MeshFormat\n")), Error);
}
