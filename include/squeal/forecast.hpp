#pragma once
/// The forecast of a run's memory and time, before its first stage (src/README.md, section 8.9).
#include "squeal/model.hpp"
#include "squeal/options.hpp"
#include "squeal/report/report.hpp"

#include <vector>

namespace squeal
{

/// The resident memory of all ranks together at its peak in a stage.
struct StageForecast
{
  Stage stage;
  double bytes = 0;
};

/// For this number of ranks.
struct Forecast
{
  double held = 0;                   // [bytes] resident already: libraries, mesh and matrices of all ranks
  std::vector<StageForecast> stages; // those that will run
  double steps = 0;                  // of time
  double step_seconds = 0;           // one step
  double factor_seconds = 0;         // one factor of K
  bool several_ranks = false;
  FactorKind factor = FactorKind::automatic; // of K bordered by B, and what it takes of a rank [bytes]
  double factor_share = 0, factor_limit = 0; // limit: of a supernodal one

  double bytes() const;
  double seconds_of_steps() const { return steps * step_seconds; }
};

/// Collective. Analyses K bordered by B and counts steps; solves nothing.
Forecast forecast_of(const Model& model, const Scene& scene, const ProgramOptions& options);

/// How the matrices will be factored, in a line.
std::string factor_text(const Forecast& forecast);

/// The forecast in a line each of the factor, memory and time.
std::string text_of(const Forecast& forecast);

/// Collective. Why the run is not started without --force: it would take more memory than the machine leaves, or more
/// than a day. Empty if it is.
std::string problem_of(const Forecast& forecast, MPI_Comm comm);

} // namespace squeal
