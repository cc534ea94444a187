#pragma once
/// Requests that reach a run from outside while it computes. By a signal or the time limit it ends in order, or makes a
/// checkpoint. One process is one run, as for signals: its control is the process's own.
#include "squeal/base/finally.hpp"

#include <mpi.h>
#include <string>

namespace squeal
{

/// Thrown by all ranks together where a stage that cannot end halfway is asked to. It is no Error: the run's results so
/// far stand.
struct Interrupted
{
};

/// Limits that end a run by itself, and how often it makes checkpoints.
struct RunLimits
{
  double time_limit = 0;            // [s] from the start of the process; 0: none
  double checkpoint_interval = 600; // [s]
};

/// The rank that mpirun or srun gave this process; empty if neither started it. Known before MPI is up.
const std::string& launched_rank();

/// From here on a rank whose launcher dies ends with it: mpirun's or srun's ranks have no business without it. A run
/// of one process outlives its shell.
void end_with_launcher();

/// From here on SIGTERM, SIGINT, SIGHUP, SIGUSR1, SIGUSR2 and SIGXCPU are requests to end. They stay so to the end of
/// the process: one that comes after the results are written does not take the exit code from them.
void begin_run_control(const RunLimits& limits);

/// Whether the run is asked to end, agreed by all ranks. Collective, and cheap enough to be asked after every time
/// step. Of fewer ranks than work together nothing is ever asked.
bool end_is_asked(MPI_Comm comm);

/// After parts of the ranks have worked by themselves: throws Interrupted if any of them was asked to end. Collective
/// of all ranks.
void join_parts(MPI_Comm comm);

/// Whether this rank knows of a request to end: a signal, or the time limit by its own clock. For waiting that other
/// ranks have no part in.
bool is_asked_here();

/// Throws Interrupted if the run is asked to end. Collective.
void end_if_asked(MPI_Comm comm);

/// Whether a checkpoint has been due since the last call of checkpoint_made. The same on all ranks.
bool checkpoint_is_due();

/// Whether a tenth of the time between checkpoints has passed since the last one: what ends now is then worth one.
/// Decided by rank 0's clock; collective.
bool checkpoint_is_worth_it(MPI_Comm comm);
/// Notes that a checkpoint was made; the next is due a period later.
void checkpoint_made();

/// "by SIGTERM" or "by the time limit"; empty while nobody asked. The same on all ranks once end_is_asked() has said
/// so.
std::string who_asked_to_end();

/// While one lives, nothing is asked: for short work without which what is known would be lost. By all ranks.
Finally undisturbed();

/// While one lives, a SIGTERM waits: METIS would take it for an error of its own. Not collective.
Finally without_sigterm();

} // namespace squeal
