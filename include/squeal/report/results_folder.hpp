#pragma once
/// The results of a run as one whole. Stages write into a folder beside the results' place, PLACE.partial. It takes
/// that place in one move when the run ends. Earlier results stay until then.
///
/// PLACE may be a working folder, a mount point, or a folder whose parent is read-only. Then the files themselves are
/// moved: report.json goes first and comes last. Other files than results stay in PLACE.
#include "squeal/report/result_files.hpp"
#include "squeal/scene/scene.hpp"

#include <mpi.h>

namespace squeal
{

/// The file that holds a lock on a folder as long as its process lives; the system frees the lock of one that died.
class FolderLock
{
public:
  FolderLock() = default;
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

  /// Locks a folder for the run. Returns who holds it; empty: it is this process now.
  std::string take(const std::filesystem::path& folder, const std::string& run);

private:
  int file_ = -1;
};

/// Whether the run keeps checkpoints.
enum class Checkpoints
{
  removed,
  published,
};

/// Whether the run starts anew.
enum class Beginning
{
  afresh,
  from_checkpoints,
};

/// The place of the results and the folder that takes it.
class ResultsFolder
{
public:
  /// Makes and locks the partial folder; what a run that was killed left there is removed, but for the checkpoints to
  /// go on from. Where it left none, those of the results in the place are taken. Collective. Error: the folder cannot
  /// be written, or another run is at work in it.
  ResultsFolder(const std::filesystem::path& place, Beginning beginning, MPI_Comm comm);

  /// Without publish, leaves everything as it was before, but for checkpoints and what keep_finished keeps.
  ~ResultsFolder();
  ResultsFolder(const ResultsFolder&) = delete;
  ResultsFolder& operator=(const ResultsFolder&) = delete;

  const std::filesystem::path& place() const { return place_; }
  const std::filesystem::path& partial() const { return partial_; } // to write to
  const std::string& run() const { return run_; }                   // the identity that every file of the run carries

  /// Where a file of the user's own name is written meanwhile: in the partial folder if it belongs into the place.
  std::filesystem::path meanwhile(const std::filesystem::path& file) const;

  /// From here on the checkpoints outlive a failure; before, those copied from the place are removed again.
  void accept_checkpoints() { copied_ = false; }

  std::filesystem::path checkpoints() const { return partial_ / word(ResultFile::checkpoints); }

  /// Moves the results to their place, with their checkpoints if the run can go on. Collective.
  void publish(Checkpoints checkpoints);

  /// Leaves the partial folder where it is if a stage has written its results. Returns the end of a sentence that says
  /// so, or nothing.
  std::string keep_finished();

private:
  void make(Beginning beginning); // on rank 0
  void move_whole();              // on rank 0
  void move_by_file();            // on rank 0
  void replace_earlier();         // on rank 0
  void undo();                    // on rank 0

  MPI_Comm comm_;
  std::filesystem::path place_, partial_;
  std::string run_;
  std::vector<std::filesystem::path> made_; // folders above the partial one, outermost first
  FolderLock lock_;
  bool published_ = false, kept_ = false, copied_ = false;
};

/// The files and folders that the scene names as inputs, its own file first. Files that a geometry includes or merges
/// are among them, but for names that a geometry computes. Of one rank; reads the geometry. Error: it may not be run.
std::vector<std::filesystem::path> inputs_of(const Scene& scene);

/// Whether two names are of one file, which may not exist yet.
bool is_same_file(const std::filesystem::path& a, const std::filesystem::path& b);

/// Error: an output of the scene, or a result in this place, would fall on what the run reads, or on a folder that no
/// run has made.
void check_outputs(const Scene& scene, const std::vector<std::filesystem::path>& inputs,
                   const std::filesystem::path& place);

/// Whether a run into the place, an absolute path, uses the name of this file while it works.
bool is_used_meanwhile(const std::filesystem::path& file, const std::filesystem::path& place);

} // namespace squeal
