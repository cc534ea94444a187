#pragma once
/// Entries of a distributed matrix as (row, column, value), numbered from one.
#include "squeal/base/petsc.hpp"

#include <vector>

namespace squeal
{

struct Triplets
{
  enum class Part
  {
    pattern, // no values
    everything,
  };

  std::vector<int> row, column;
  std::vector<double> value;
};

/// This rank's share of the lower triangle, diagonal included.
Triplets lower_triangle(Mat symmetric);

/// The same, appended.
void append_lower_triangle(Mat symmetric, Triplets& mine);

/// This rank's rows of B, below row `offset`.
void append_rows(Mat B, int offset, Triplets& mine);

/// The entries of all ranks on rank 0; nothing elsewhere. Collective.
Triplets gathered(Triplets mine, Triplets::Part part, MPI_Comm comm);

} // namespace squeal
