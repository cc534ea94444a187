#pragma once
/// Options of the PETSc and SLEPc objects that solve within the stages. They follow a few prefixes; the library of the
/// object knows what may stand behind each.
#include "squeal/options.hpp"

#include <array>

namespace squeal
{

/// A prefix of options and the solver that takes them.
struct SolverPrefix
{
  const char* text;   // of the options, behind the dash
  const char* object; // the prefix that the solver object has
  Stage stage;        // that the object works in
};

inline constexpr std::array solver_prefixes = {SolverPrefix{"modes_pep_", "modes_", Stage::modes},
                                               SolverPrefix{"modes_st_", "modes_", Stage::modes},
                                               SolverPrefix{"cycle_snes_", "cycle_", Stage::cycle}};

/// The prefix of an option's name, which stands without its dash; null if it has none of these.
const SolverPrefix* solver_prefix_of(const std::string& name);

/// Tries the options on objects that are thrown away and solve small problems, so that the stages themselves find
/// nothing wrong later. Collective. Error: a value that PETSc or SLEPc does not take or fails with, or an option that
/// the object does not ask for. Error, too: an option of a solver that `options` leave out.
void check_solver_options(const ProgramOptions& options, MPI_Comm comm);

} // namespace squeal
