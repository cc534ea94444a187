#pragma once
/// Geometry scripts: what gmsh is allowed to run of them.
///
/// gmsh's language can run commands, write files and read any file. gmsh takes every file for a script that it does
/// not recognise. A scene's geometry comes from anywhere. Hence gmsh never sees the file itself but a text made of the
/// scanned tokens. It has no comments, included files in their places, and listed words only. Not collective.
#include "squeal/scene/scene.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace squeal
{

/// A geometry as gmsh may run it.
struct Script
{
  std::string text;                         // on the lines of the file
  std::vector<std::string> parameters;      // names in its DefineConstant lists
  std::vector<std::filesystem::path> files; // the geometry and what it includes or merges
};

/// Reads a geometry and the files that it includes. Throws Error, with file and line, for a statement that may not be
/// run and for a file that cannot be read. With Statements::any, `text` is empty and files that are missing are passed.
Script read_script(const std::filesystem::path& file, Statements statements);

/// Returns whether gmsh takes the file for a script. Throws Error if its content does not fit its ending, since gmsh
/// would then take it for a script. It also does if its ending belongs to no format that holds a mesh or a geometry.
bool is_script(const std::filesystem::path& file);

} // namespace squeal
