#pragma once
/// What a run will take, before its first stage.
#include "squeal/model.hpp"
#include "squeal/options.hpp"

namespace squeal
{

/// Memory of all ranks together [bytes], and time. Estimates are good to a factor of about two.
struct Forecast
{
  double matrices = 0, factor = 0, condensed_operator = 0;
  double modes = 0;        // factors and spaces of the full problem; 0 where no modes are sought
  double history = 0;      // what is recorded of every step of the transient
  double steps = 0;        // of time
  double step_seconds = 0; // one step

  double bytes() const { return matrices + factor + condensed_operator + modes + history; }
  double seconds() const { return steps * step_seconds; }
};

/// Collective. Analyses K bordered by B and counts steps; solves nothing.
Forecast forecast_of(const Model& model, const Scene& scene, const ProgramOptions& options);

/// The forecast in two lines. Not collective.
std::string text_of(const Forecast& forecast);

/// Collective. Why the run is not started without --force. It would take more than a day, or more memory than the
/// machine and this process's limits leave. Empty if it is.
std::string problem_of(const Forecast& forecast, MPI_Comm comm);

/// Why this process may not even take what the libraries need to start; empty if it may. Needs no MPI. Below it, MPI
/// fails in texts of its own, and OpenBLAS tries for ever to allocate its buffer.
std::string problem_of_address_space();

} // namespace squeal
