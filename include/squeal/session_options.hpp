#pragma once
/// Options of PETSc's session, which PETSc obeys while it starts. They are checked before PETSc starts, because it ends
/// the process at the first value that it does not take. Nothing here needs PETSc or MPI.
#include <string>

namespace squeal
{

/// Whether this is an option of the session that squeal passes on; `name` without its dash.
bool is_session_option(const std::string& name);

/// Whether a solver asks for an option of this name only where it solves, and prints by it: modes_pep_view.
bool is_solver_view(const std::string& name);

/// What is wrong with the value of a session option, or of one by which a solver prints; empty if nothing is.
std::string problem_of_session_option(const std::string& name, const std::string& value);

/// The file that such an option writes; empty if it writes none.
std::string file_written_by(const std::string& name, const std::string& value);

/// Whether its value is a file of more options.
bool names_options_file(const std::string& name);

/// A line for each session option: name and value.
std::string session_option_reference();

} // namespace squeal
