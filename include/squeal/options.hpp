#pragma once
/// All options of squeal in one table, read and refused together; and the prefixes by which PETSc's, SLEPc's and
/// MUMPS's objects take theirs.
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/arguments.hpp"
#include "squeal/cycle/limit_cycle.hpp"
#include "squeal/report/report.hpp"
#include "squeal/settled/motion.hpp"
#include "squeal/study/response.hpp"
#include "squeal/transient/transient.hpp"

namespace squeal
{

/// The options of all stages.
struct ProgramOptions
{
  FactorOptions factor; // handed on to equilibrium and step
  EquilibriumOptions equilibrium;
  ModesOptions modes;
  StepOptions step; // of the transient and of the cycle
  CycleOptions cycle;
  SettledOptions settled;
  ResponseOptions response;
  Arguments arguments; // by which the program was called
};

/// The options of squeal's own, bound to their members, whose initialisers are the defaults.
SceneKeys options_of(ProgramOptions& options);

/// A prefix of options, and the stage in which the object behind it works.
struct SolverPrefix
{
  const char* text; // without the dash
  Stage stage;
};

inline constexpr std::array solver_prefixes = {SolverPrefix{"factor_mat_mumps_", Stage::equilibrium},
                                               SolverPrefix{"modes_mat_mumps_", Stage::modes},
                                               SolverPrefix{"modes_pep_", Stage::modes},
                                               SolverPrefix{"modes_st_", Stage::modes},
                                               SolverPrefix{"cycle_snes_", Stage::cycle},
                                               SolverPrefix{"cycle_ksp_", Stage::cycle},
                                               SolverPrefix{"cycle_pc_", Stage::cycle}};

/// The prefix of an option's name, which stands without its dash; null if it has none of these.
const SolverPrefix* solver_prefix_of(const std::string& name);

/// Why the name of an option, which stands without its dash, is neither squeal's nor one of a prefix. Needs no PETSc.
std::string problem_of_option_name(const std::string& name);

/// A line for each option: name, meaning, default.
std::string option_reference();

/// A table of Markdown with a row for each option.
std::string option_page();

/// The options of PETSc's database. Collective. Error: a value that an option does not take. Names are checked before
/// PETSc starts (squeal/arguments.hpp).
ProgramOptions read_program_options(MPI_Comm comm);

/// After the stages, before their results are published; collective. Error: an option of a solver object that nobody
/// asked for though its stage ran. Options of other stages are let pass, since a run finds out on its way which stages
/// it needs.
void check_options_used(const std::vector<Stage>& stages_run, MPI_Comm comm);

} // namespace squeal
