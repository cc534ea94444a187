#pragma once
/// Words of the command line, read before PETSc starts: squeal's own arguments, tools, and options of PETSc's database
/// with those of PETSC_OPTIONS. PETSc itself would end the process at the first value that it does not take.
#include "squeal/base/run_control.hpp"
#include "squeal/scene/described.hpp"

namespace squeal
{

inline constexpr const char* scene_file = "scene.toml"; // of a scene that is a folder

/// A page that the program writes.
enum class ReferencePage
{
  none,
  keys,
  results,
};

template <> inline constexpr std::array words_of<ReferencePage> = {"", "keys", "results"};

/// The requests of the command line.
struct Arguments
{
  std::filesystem::path scene, output;
  std::vector<std::string> overrides;
  RunLimits limits;
  std::string section;          // of the keys that --help shows; empty: all of the help
  std::string program, command; // as a shell takes them; the command begins with the program
  bool verbose = false, restart = false, dry_run = false, resolve = false, help = false, version = false,
       allow_scripts = false, force = false;
  ReferencePage reference{};        // to print
  bool options_in_variable = false; // PETSC_OPTIONS
  std::string problem;              // said after MPI is up, once
};

/// Whether a path is named as a scene file is, or is a folder that holds one.
bool is_scene(const std::filesystem::path& path);

/// Takes squeal's own arguments out of argv; what stays is PETSc's.
Arguments take_arguments(int& argc, char** argv);

/// A line for each argument.
std::string argument_reference();

/// A table of Markdown with a row for each argument.
std::string argument_page();

/// Goes on as the tool that the first word names; returns where it names none. Tools are files of tools/ beside the
/// program's folder or of its installation. A scene of this name in the working folder comes first.
void become_tool(int argc, char** argv);

/// The words for PETSc.
struct GivenOptions
{
  std::vector<std::string> words;     // with those of a file in place of -options_file FILE
  bool from_variable = false;         // whether PETSC_OPTIONS holds any
  std::vector<std::string> written{}; // files that PETSc will write
  std::string problem;                // empty, or why PETSc must not see them
};

/// Words of the variable PETSC_OPTIONS come first, so that the command line prevails.
GivenOptions given_options(int argc, char** argv);

/// Whether a solver asks for an option of this name only where it solves, and prints by it: modes_pep_view.
bool is_printing_option(const std::string& name);

/// A line for each session option: name and value.
std::string session_option_reference();

} // namespace squeal
