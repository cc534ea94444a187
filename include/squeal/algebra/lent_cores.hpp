#pragma once
/// How many cores dense algebra takes: those of ranks that wait for rank 0 (src/README.md, section 8.8), or one.
#include "squeal/base/petsc.hpp"

namespace squeal
{

/// While it lives, this rank's BLAS has one thread: in products of a few hundred rows threads wait for each other about
/// as long as they work, and for seconds where other programs want the cores. Nothing changes with BLAS libraries other
/// than OpenBLAS.
Finally one_thread();

/// work() on rank 0, on matrices of `rows` rows. From 500 rows on its BLAS has a thread for each rank of its node, as
/// far as rank 0 may use their cores. The others sleep until it has ended. Nothing changes with BLAS libraries other
/// than OpenBLAS. Collective. Error on every rank: what it throws.
void on_rank_zero_with_lent_cores(MPI_Comm comm, std::size_t rows, const std::function<void()>& work);

} // namespace squeal
