#pragma once
/// Progress of a long stage, printed by rank 0 at every tenth of the work or every half minute. The remaining time
/// takes all parts of the work as equal.
#include <chrono>
#include <mpi.h>
#include <string>

namespace squeal
{

/// The progress of one stage.
class Progress
{
public:
  /// `total` is the expected amount of work, in steps or periods. Only rank 0 of MPI_COMM_WORLD prints.
  Progress(MPI_Comm comm, std::string stage, double total);

  /// Prints that `done` of the work is done, with a note such as the residual.
  void update(double done, const std::string& note);

private:
  bool prints_ = false;
  std::string stage_;
  double total_ = 0; // steps or periods
  int tenth_ = -1;   // of the last line printed
  std::chrono::steady_clock::time_point start_, last_;
};

} // namespace squeal
