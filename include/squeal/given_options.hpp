#pragma once
/// The places that PETSc takes options from: files .petscrc of the home and the working folder, petscrc,
/// PETSC_OPTIONS, and the command line. Each may name files by -options_file.
#include <string>
#include <vector>

namespace squeal
{

/// What was found in all places.
struct GivenOptions
{
  std::vector<std::string> sources; // other than the command line: "PETSC_OPTIONS", "file .petscrc"
  std::string problem;              // empty, or why PETSc must not see them
  std::vector<std::string> written; // files that PETSc will write
};

/// Looks through the command line, PETSC_OPTIONS, the files .petscrc and those of -options_file. Needs no PETSc.
GivenOptions given_options(int argc, char** argv);

} // namespace squeal
