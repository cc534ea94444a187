#include "squeal/algebra/lent_cores.hpp"

#include <algorithm>
#include <chrono>
#include <dlfcn.h>
#include <thread>

#ifdef __linux__
#include <sched.h>
#endif

namespace squeal
{

namespace
{

/// Cores that this process may run on.
int allowed_cores()
{
#ifdef __linux__
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof set, &set) == 0) return CPU_COUNT(&set);
#endif
  return 1;
}

int ranks_of_node(MPI_Comm comm)
{
  MPI_Comm node = MPI_COMM_NULL;
  MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &node);
  int ranks = 1;
  MPI_Comm_size(node, &ranks);
  MPI_Comm_free(&node);
  return ranks;
}

template <class Function> Function* function_of_blas(const char* name)
{
  return reinterpret_cast<Function*>(dlsym(RTLD_DEFAULT, name));
}

/// 0: BLAS does not tell.
int threads_of_blas()
{
  auto* const get = function_of_blas<int()>("openblas_get_num_threads");
  return get ? get() : 0;
}

void set_threads(int threads)
{
  if (auto* const set = function_of_blas<void(int)>("openblas_set_num_threads")) set(threads);
}

/// Sleeps until rank 0 has come here: MPI's own waiting would take the core. Collective.
void wait_for_rank_zero(MPI_Comm comm)
{
  MPI_Request here = MPI_REQUEST_NULL;
  MPI_Ibarrier(comm, &here);
  if (rank_of(comm) == 0)
  {
    MPI_Wait(&here, MPI_STATUS_IGNORE);
    return;
  }
  constexpr auto pause = std::chrono::microseconds(200);
  int done = 0;
  for (MPI_Test(&here, &done, MPI_STATUS_IGNORE); !done; MPI_Test(&here, &done, MPI_STATUS_IGNORE))
    std::this_thread::sleep_for(pause);
}

} // namespace

void on_rank_zero_with_lent_cores(MPI_Comm comm, std::size_t rows, const std::function<void()>& work)
{
  if (ranks_of(comm) == 1 || rows < 500) return on_rank_zero(comm, work);
  const int threads = std::min(ranks_of_node(comm), allowed_cores()), before = threads_of_blas();
  const bool more = rank_of(comm) == 0 && before > 0 && before < threads;
  const auto with_cores = [&]
  {
    if (more) set_threads(threads);
    const Finally end(
        [&]
        {
          if (more) set_threads(before);
          wait_for_rank_zero(comm);
        });
    if (rank_of(comm) == 0) work();
  };
  on_every_rank(comm, with_cores);
}

Finally one_thread()
{
  const int before = threads_of_blas();
  if (before > 1) set_threads(1);
  return Finally(
      [before]
      {
        if (before > 1) set_threads(before);
      });
}

} // namespace squeal
