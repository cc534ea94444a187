#pragma once
/// Options of the PETSc, SLEPc and MUMPS objects that solve within the stages. They follow a few prefixes; the library
/// of the object knows what may stand behind each.
#include "squeal/report/stage.hpp"

#include <array>
#include <string>

namespace squeal
{

/// A prefix of options, and the stage in which the object behind it works.
struct SolverPrefix
{
  const char* text; // without the dash
  Stage stage;
};

inline constexpr std::array solver_prefixes = {SolverPrefix{"factor_mat_mumps_", Stage::equilibrium},
                                               SolverPrefix{"modes_mat_mumps_", Stage::modes},
                                               SolverPrefix{"modes_real_eps_", Stage::modes},
                                               SolverPrefix{"modes_real_st_", Stage::modes},
                                               SolverPrefix{"modes_pep_", Stage::modes},
                                               SolverPrefix{"modes_st_", Stage::modes},
                                               SolverPrefix{"cycle_snes_", Stage::cycle},
                                               SolverPrefix{"cycle_ksp_", Stage::cycle},
                                               SolverPrefix{"cycle_pc_", Stage::cycle}};

/// The prefix of an option's name, which stands without its dash; null if it has none of these.
const SolverPrefix* solver_prefix_of(const std::string& name);

/// Why a type of solver may not be given: it needs more than an operator, and ends the process without it. Empty: it
/// may.
std::string problem_of_solver_type(const std::string& name, const std::string& value);

} // namespace squeal
