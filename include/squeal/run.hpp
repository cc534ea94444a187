#pragma once
/// The whole method, once: model, equilibrium, modes, estimate, transient, cycle, settled motion, studies, report.
#include "squeal/options.hpp"
#include "squeal/report/results_folder.hpp"

namespace squeal
{

/// How the program ends where nothing is thrown. An error ends it with 1.
enum class ExitCode : int
{
  converged = 0,     // every stage that ran gave what it promises
  not_converged = 2, // one did not, and the report says which
  interrupted = 3,   // the run was asked to end, and --restart goes on
};

/// Runs the chain, writes the results of each stage when it ends, and publishes the whole. Collective. Bad input and
/// failed calls are thrown as Error on every rank; earlier results then stay.
ExitCode run(Scene scene, const ProgramOptions& options, ResultsFolder& results, MPI_Comm comm);

/// Checks scene and mesh and prints what the model would be; computes and writes nothing. Collective. Throws Error as
/// run does.
void dry_run(Scene scene, const ProgramOptions& options, MPI_Comm comm);

} // namespace squeal
