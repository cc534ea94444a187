#pragma once
/// Arguments of the command line that are squeal's own, taken before PETSc starts.
#include "squeal/base/run_control.hpp"
#include "squeal/report/report.hpp"

namespace squeal
{

inline constexpr const char* scene_file = "scene.toml"; // of a scene that is a folder

/// The requests of the command line.
struct Arguments
{
  std::filesystem::path scene, output;
  std::vector<std::string> overrides;
  RunLimits limits;
  std::string section;          // of the keys that --help shows; empty: all of the help
  std::string program, command; // as a shell takes them; the command begins with the program
  TableLength length{};
  bool restart = false, dry_run = false, help = false, version = false, allow_scripts = false, force = false;
  std::string reference;            // page to print; empty: none
  bool options_in_variable = false; // PETSC_OPTIONS
  std::string problem;              // said after MPI is up, once
};

/// Whether a folder holds the file of a scene.
bool is_scene_folder(const std::filesystem::path& folder);

/// Takes squeal's own arguments out of argv; what stays is PETSc's.
Arguments take_arguments(int& argc, char** argv);

/// A line for each argument.
std::string argument_reference();

/// A table of Markdown with a row for each argument.
std::string argument_page();

} // namespace squeal
