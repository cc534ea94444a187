#pragma once
/// What a run leaves behind: report.json, fields.h5 + fields.xdmf, history.h5, scene.toml (resolved), options.txt, and
/// the printed table. Every number comes with its unit and with what it is worth (residual, backward error, defect).
#include "squeal/cycle/fidelity.hpp"
#include "squeal/model.hpp"

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace squeal
{

struct Timing
{
  std::string stage;
  double seconds = 0;           // by the clock on the wall
  double processor_seconds = 0; // of rank 0, its waiting for others included: a busy machine does not stretch it
};

/// All results of a run. A stage that did not run has outcome "off" (by the scene) or "skipped", with the reason.
struct Report
{
  PetscInt dofs = 0;
  long elements = 0;
  int pairs = 0, ranks = 1;
  double memory_bytes = 0; // largest resident size so far, all ranks together
  double rounding_hz = 0;  // 1e-6 sqrt(|K|/|M|) / 2 pi: slower modes are taken for rigid motions
  Equilibrium equilibrium;
  std::vector<double> contact_forces;     // [N] sum of r_n of each contact of the scene; empty on a matrix scene
  std::vector<double> contact_torques;    // [N m] with which each brakes its rotation: sum of r_t.v_d over the rate
  std::vector<double> equilibrium_probes; // [m] at the equilibrium, one a probe
  Modes modes;
  Estimate estimate;
  Trajectory transient;
  LimitCycle cycle;
  Fidelity fidelity;           // of the cycle
  std::vector<Timing> timings; // in order
};

/// Rank 0 prints the table a person reads.
void print_summary(const Report& report, const Scene& scene, MPI_Comm comm);

/// Collective. Writes everything into `output`, each file whole or not at all. Error: what could not be written.
void write_results(const Report& report, const Scene& scene, const Model& model, const std::filesystem::path& output,
                   MPI_Comm comm);

} // namespace squeal
