#pragma once
/// Entries of a distributed matrix as (row, column, value), in MUMPS's format. Indices are of type int and count from
/// one; entries of the same place are added up.
#include "squeal/base/petsc.hpp"

#include <vector>

namespace squeal
{

struct Triplets
{
  std::vector<int> row, column;
  std::vector<double> value;
};

/// This rank's share of the lower triangle, diagonal included.
Triplets lower_triangle(Mat symmetric);

/// Appends this rank's rows of B; its first row becomes row `offset` + 1.
void append_rows(Mat B, PetscInt offset, Triplets& entries);

/// The entries of all ranks on rank 0, none elsewhere. Collective. Throws Error on all ranks if there are more than
/// MPI can gather.
Triplets gather(Triplets entries, MPI_Comm comm);

} // namespace squeal
