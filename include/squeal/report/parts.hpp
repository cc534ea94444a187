#pragma once
/// The files of a run, one writer each; all but write_fields run on rank 0 alone.
#include "squeal/report/report.hpp"

#include <limits>

namespace squeal
{

/// The whole report as JSON text: SI units, null for what is not a number.
std::string report_json(const Report& report, const Scene& scene);

/// The table a person reads.
std::string summary(const Report& report, const Scene& scene);

/// Name and version of squeal and of the libraries it runs on.
std::vector<std::pair<std::string, std::string>> versions();

/// history.h5: energies, powers, probes and contact counts against time, groups "transient" and "cycle".
void write_history(const Report& report, const Scene& scene, const std::filesystem::path& file);

/// Collective. fields.h5 and fields.xdmf: mesh, equilibrium, unstable modes, one period of the cycle.
void write_fields(const Report& report, const Scene& scene, const Model& model, const std::filesystem::path& output,
                  MPI_Comm comm);

/// Over the closed pairs [N]; zeros when none is.
struct NormalForces
{
  int closed = 0;
  double sum = 0, least = 0, greatest = 0;
};

NormalForces normal_forces(const Equilibrium& equilibrium);

/// What theta and the step do to the followed mode by the theory of the scheme, relative; NaN without a mode.
struct StepBias
{
  double growth = std::numeric_limits<double>::quiet_NaN();
  double frequency = std::numeric_limits<double>::quiet_NaN();
};

StepBias transient_bias(const Report& report);
StepBias cycle_bias(const Report& report);

/// The part of the normal force that alternates from step to step: rms of its second difference / 4, over its mean.
double chatter(const History& history);

/// Sentences for whoever would be misled by a stage's numbers; none is the rule.
struct Verdicts
{
  std::vector<std::string> equilibrium, modes, estimate, transient, cycle;
};

Verdicts verdicts_of(const Report& report);

} // namespace squeal
