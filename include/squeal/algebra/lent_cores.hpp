#pragma once
/// How many cores dense algebra takes: those of ranks that wait for rank 0 (src/README.md, section 8.8), or one.
#include "squeal/base/petsc.hpp"

namespace squeal
{

/// While it lives, rank 0's BLAS has a thread for each rank of its node, as far as rank 0 may use their cores. The
/// others sleep at the end of their object's life until rank 0's ends. Nothing changes for matrices of fewer than 500
/// rows, nor with BLAS libraries other than OpenBLAS. Collective.
class LentCores
{
public:
  LentCores(MPI_Comm comm, std::size_t rows);
  LentCores(const LentCores&) = delete;
  LentCores& operator=(const LentCores&) = delete;
  ~LentCores();

private:
  MPI_Comm comm_;   // null: nothing changes
  int threads_ = 0; // of BLAS before; 0: they were left alone
};

/// While it lives, this rank's BLAS has one thread: in products of a few hundred rows threads wait for each other about
/// as long as they work, and for seconds where other programs want the cores. Nothing changes with BLAS libraries other
/// than OpenBLAS.
Finally one_thread();

/// work() on rank 0, on matrices of `rows` rows, with the cores of the others. Error on every rank: what it throws.
template <class Work> void on_rank_zero_with_lent_cores(MPI_Comm comm, std::size_t rows, Work work)
{
  on_every_rank(comm,
                [&]
                {
                  const LentCores cores(comm, rows);
                  if (rank_of(comm) == 0) work();
                });
}

} // namespace squeal
