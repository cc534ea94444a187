#pragma once
/// Options of PETSc's database as words, of PETSC_OPTIONS and of the command line, looked through before PETSc starts:
/// it ends the process at the first value that it does not take. Nothing here needs PETSc or MPI.
#include <string>
#include <vector>

namespace squeal
{

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
