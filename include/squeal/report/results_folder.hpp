#pragma once
/// The results of a run as one whole. Stages write into PLACE/.partial. When the run ends, that folder becomes
/// PLACE/.finished, and its files take the place of the earlier ones, the report last. What a run that is killed
/// meanwhile leaves there, the next run moves. Files of another origin stay.
#include "squeal/base/words.hpp"
#include "squeal/scene/scene.hpp"

#include <array>
#include <mpi.h>

namespace squeal
{

/// The files of a results folder.
enum class ResultFile
{
  report,
  history,
  sweep,
  robustness,
  fields,
  field_places, // how ParaView finds its way in the fields
  resolved_scene,
  options,
  checkpoints, // a folder
};

template <> inline constexpr std::array words_of<ResultFile> = {"report.json",    "history.h5",  "sweep.csv",
                                                                "robustness.csv", "fields.h5",   "fields.xdmf",
                                                                "resolved.toml",  "options.txt", "checkpoint"};

/// The fate of the checkpoints of a run that ends.
enum class Checkpoints
{
  removed,
  kept, // it can go on
};

/// The place of the results, where one run is at work.
class ResultsFolder
{
public:
  /// Makes and locks the folder; what a run that was killed left there is moved if it is whole, else removed.
  /// Collective. Error: the folder cannot be written, or another run is at work in it. Error: it holds a folder of a
  /// result's name that no run has made.
  ResultsFolder(const std::filesystem::path& place, MPI_Comm comm);

  /// Without publish, leaves everything as it was before, but for checkpoints and what keep_finished keeps.
  ~ResultsFolder();
  ResultsFolder(const ResultsFolder&) = delete;
  ResultsFolder& operator=(const ResultsFolder&) = delete;

  const std::filesystem::path& place() const { return place_; }
  const std::filesystem::path& partial() const { return partial_; } // to write to
  const std::string& run() const { return run_; }                   // the identity that every file of the run carries

  std::filesystem::path checkpoints() const { return place_ / word(ResultFile::checkpoints); }

  /// Moves the results to their place. Collective.
  void publish(Checkpoints checkpoints);

  /// Leaves the partial folder where it is if a stage has written its results. Returns the end of a sentence that says
  /// so, or nothing.
  std::string keep_finished();

private:
  // on rank 0
  void make();
  std::string lock(); // returns who holds it; empty: it is this process now
  void move_finished();
  void undo();

  MPI_Comm comm_;
  std::filesystem::path place_, partial_;
  std::string run_;
  int file_ = -1; // holds a lock as long as the process lives; the system frees that of one that died
  bool made_ = false, published_ = false, kept_ = false;
};

/// The files and folders that the scene names as inputs, its own file first. Files that a geometry includes or merges
/// are among them, but for names that a geometry computes. Of one rank; reads the geometry. Error: it may not be run.
std::vector<std::filesystem::path> inputs_of(const Scene& scene);

/// Whether two names are of one file, which may not exist yet.
bool is_same_file(const std::filesystem::path& a, const std::filesystem::path& b);

/// Error: an output of the scene, or a result here, would fall on what the run reads, another output or a folder.
void check_outputs(const Scene& scene, const std::vector<std::filesystem::path>& inputs,
                   const std::filesystem::path& place);

} // namespace squeal
