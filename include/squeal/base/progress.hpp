#pragma once
/// Progress of a long stage on rank 0: a bar with the time left on a terminal, a plain line every tenth or
/// half minute in a batch log.
#include <chrono>
#include <mpi.h>
#include <string>

namespace squeal
{

class Progress
{
public:
  /// `total`: units of work expected (steps, periods); silent on every rank but 0.
  Progress(MPI_Comm comm, std::string stage, double total);
  ~Progress(); // ends the bar's line
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `done` units so far; `note`: what a reader wants to see now, such as a residual.
  void update(double done, const std::string& note);

private:
  bool speaks_ = false, terminal_ = false, open_line_ = false;
  std::string stage_;
  double total_ = 0;
  int tenth_ = -1;
  std::chrono::steady_clock::time_point start_, last_;
};

} // namespace squeal
