#include "squeal/base/progress.hpp"

#include <algorithm>
#include <cstdio>

namespace squeal
{

Progress::Progress(MPI_Comm comm, std::string stage, double total)
    : stage_(std::move(stage)), total_(std::max(total, 1e-300)), start_(std::chrono::steady_clock::now()), last_(start_)
{
  int rank = 0, world_rank = 0;
  MPI_Comm_rank(comm, &rank);
  MPI_Comm_rank(MPI_COMM_WORLD, &world_rank); // work on a communicator of each rank is printed by one of them
  prints_ = rank == 0 && world_rank == 0;
}

void Progress::update(double done, const std::string& note)
{
  if (!prints_) return;
  const auto now = std::chrono::steady_clock::now();
  const double fraction = std::clamp(done / total_, 0.0, 0.99); // the stage has not ended yet
  const double elapsed = std::chrono::duration<double>(now - start_).count();
  const double remaining = fraction > 0 ? elapsed * (1 - fraction) / fraction : 0;
  const int tenth = static_cast<int>(10 * fraction + 1e-9);
  if (tenth == tenth_ && now - last_ < std::chrono::seconds(30)) return;
  std::printf("  %-11s %3.0f %%  %6.1f s  %4.0f s left  %s\n", stage_.c_str(), 100 * fraction, elapsed, remaining,
              note.c_str());
  tenth_ = tenth;
  last_ = now;
  std::fflush(stdout);
}

} // namespace squeal
