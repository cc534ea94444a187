#pragma once
/// The algorithm options squeal documents, and the checks that no other one is given.
#include <mpi.h>
#include <string>
#include <vector>

namespace squeal
{

/// One line an option: name, default, meaning.
std::string option_reference();

/// Before the run, collective. Error for an option that neither squeal nor a solver of its stages could know, with the
/// nearest that is known.
void check_option_names(MPI_Comm comm);

/// After the run, collective. Error for options that nobody asked for, with the nearest known ones. Options of a stage
/// that did not run are let pass: whether it runs is found out on the way. `stages`: those that ran ("modes", …).
void check_options_used(const std::vector<std::string>& stages, MPI_Comm comm);

} // namespace squeal
