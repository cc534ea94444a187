#pragma once
/// The stages of a run, in the order in which they run, and their names.
#include "squeal/attractors/attractors.hpp"
#include "squeal/base/words.hpp"
#include "squeal/branch/brake_branch.hpp"
#include "squeal/contact/interface.hpp"
#include "squeal/settled/settled_motion.hpp"
#include "squeal/study/response.hpp"
#include "squeal/study/robustness.hpp"
#include "squeal/study/sensitivity.hpp"
#include "squeal/study/sweep.hpp"
#include "squeal/transient/sliding_point.hpp"

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace squeal
{

/// A stage of a run.
enum class Stage
{
  model,
  equilibrium,
  modes,
  estimate,
  response,
  transient,
  cycle,
  settled,
  attractors,
  branch,
  sensitivity,
  sweep,
  robustness,
};

template <> inline constexpr std::array words_of<Stage> = {
    "model",   "equilibrium", "modes",  "estimate",    "response", "transient", "cycle",
    "settled", "attractors",  "branch", "sensitivity", "sweep",    "robustness"};

// All results of a run, and its files (report/results_folder.hpp) with the printed table. Every number comes with its
// unit and with what it is worth (residual, backward error, defect).

/// A part of the scene with what it weighs.
struct PartMass
{
  std::string name;
  double mass = 0; // [kg] of its elements
};

/// The size of the model.
struct ModelSummary
{
  PetscInt dofs = 0;
  long elements = 0;
  int pairs = 0, ranks = 1;
  bool slides = false;     // a drive moves a contact along its surface
  double memory_bytes = 0; // largest resident size so far, all ranks together
  double length = 0;       // [m] of the longest side of the box around the mesh; 0 on a matrix scene
  Vec3 size{};             // [m] of that box
  std::vector<PartMass> parts;
  double rounding_hz = 0;            // 1e-6 sqrt(|K|/|M|) / 2 pi: slower modes are lost in rounding
  std::vector<std::string> warnings; // of values that are hardly meant
  std::vector<Coverage> coverage;    // one a contact; empty on a matrix scene
};

/// The time and memory of a stage.
struct Timing
{
  Stage stage{};
  double seconds = 0;           // by the clock on the wall
  double processor_seconds = 0; // of rank 0, its waiting for others included: a busy machine does not stretch it
};

/// A bolt at the equilibrium.
struct BoltResult
{
  std::string name;
  double tension = 0;    // [N]
  double shortening = 0; // [m] of its shank
};

/// A branch, and the stability of sliding along its range.
struct BranchStudy : BrakeBranch // its events include those of sliding
{
  Sweep beside; // by rising parameter
};

/// Each result is written once, and no stage reads it here. A stage that did not run has the outcome "off" (by the
/// scene) or "skipped", with the reason.
struct Report
{
  std::string run;             // the identity that every file of the run carries
  std::string program;         // as the shell called it; its word `report` is a tool
  std::string command;         // by which it was called, as a shell takes it
  std::filesystem::path place; // of its results
  std::string ended_by;        // "by SIGTERM" where the run was asked to end; empty: it was not
  int exit_code = -1;          // -1: the run goes on
  ModelSummary model;
  SlidingPoint point;
  std::vector<ContactResultant> contacts; // of the equilibrium, one a contact of the scene; empty on a matrix scene
  double displacement = 0;                // [m] largest one of the equilibrium
  std::vector<double> equilibrium_probes; // [m] at the equilibrium, one a probe
  std::vector<BoltResult> bolts;          // at the equilibrium
  Response response;
  Trajectory transient;
  Motion motion;
  Attractors attractors;
  BranchStudy branch;
  Sensitivity sensitivity;
  Sweep sweep;
  std::vector<Timing> timings; // in order
  Robustness robustness;
};

/// The estimate of the followed mode.
const Estimate& followed_estimate(const Report& report);

/// Normal reactions of the closed pairs [N].
std::vector<double> closed_reactions(const Equilibrium& equilibrium);

/// The outcome of every stage but the model, in the order in which they run.
std::array<std::pair<Stage, Outcome>, 12> outcomes_of(const Report& report);

/// One sentence that says what is heard, and whether it lasts: the first row of the table. Of rank 0, as the four
/// below.
std::string heard(const Report& report, const Scene& scene);

/// A command that a shell takes, and that goes on from the results of this run.
std::string next_command(const Report& report, const Scene& scene);

/// The length of the printed table.
enum class TableLength
{
  brief, // some twenty lines
  full,  // all results that a person reads
};

/// The table a person reads, line by line.
std::string table(const Report& report, const Scene& scene, TableLength length);

/// The whole report as JSON: SI units, null for what is not a number.
std::string report_json(const Report& report, const Scene& scene);

/// The page inputs/RESULTS.md: every result and data set with its unit and meaning.
std::string result_page();

/// Rank 0 prints the table.
void print_table(const Report& report, const Scene& scene, TableLength length, MPI_Comm comm);

/// Collective. Writes what was asked for into `output`: the scene with every default, and the options.
void write_request(const Scene& scene, const std::string& run, const std::filesystem::path& output, MPI_Comm comm);

/// Collective. Writes all results into `output`, each file whole or not at all. Error: what could not be written.
void write_results(const Report& report, const Scene& scene, const Model& model, const std::filesystem::path& output,
                   MPI_Comm comm);

/// Name and version of squeal, its commit, and of the libraries it runs on.
std::vector<std::pair<std::string, std::string>> versions();

} // namespace squeal
