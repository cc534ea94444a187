#pragma once
/// All algorithm options of squeal: one struct a stage, each described in its own room; read and refused together.
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/algebra/pencil_factor.hpp"
#include "squeal/attractors/attractors.hpp"
#include "squeal/cycle/options.hpp"
#include "squeal/report/stage.hpp"
#include "squeal/settled/motion.hpp"
#include "squeal/study/response.hpp"
#include "squeal/study/robustness.hpp"
#include "squeal/transient/estimate.hpp"
#include "squeal/transient/transient.hpp"

namespace squeal
{

/// The options of all stages.
struct ProgramOptions
{
  FactorOptions factor; // handed on to equilibrium and step
  PencilOptions pencil; // handed on to modes
  EquilibriumOptions equilibrium;
  ModesOptions modes;
  EstimateOptions estimate;
  StepOptions step; // of the transient and of the cycle
  CycleOptions cycle;
  SettledOptions settled;
  AttractorOptions attractors;
  SweepOptions sweep;
  bool force = false; // --force: run whatever the forecast says
  RobustnessOptions robustness;
  ResponseOptions response;
};

OptionList options_of(ProgramOptions& options);

/// What is wrong with the name of an option, which stands without its dash. Empty if squeal, a solver of its stages or
/// PETSc's session may know it. Needs no PETSc.
std::string problem_of_option_name(const std::string& name);

/// A line for each option: name, meaning, default.
std::string option_reference();

/// A table of Markdown with a row for each option.
std::string option_page();

/// The options of PETSc's database. Collective. Error: a value that an option does not take. Names are checked before
/// PETSc starts (squeal/session_options.hpp).
ProgramOptions read_program_options(MPI_Comm comm);

/// After the stages, before their results are published; collective. Error: an option of a solver object that nobody
/// asked for though its stage ran. Options of other stages are let pass, since a run finds out on its way which stages
/// it needs.
void check_options_used(const std::vector<Stage>& stages_run, MPI_Comm comm);

} // namespace squeal
