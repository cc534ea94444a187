#pragma once
/// The points of a sweep as a list of numbers, for other groups of ranks.
#include "squeal/base/broadcast.hpp"
#include "squeal/base/checkpoint.hpp"
#include "squeal/study/sweep.hpp"

namespace squeal
{

/// The points and the thresholds.
void describe(Checkpoint& checkpoint, Sweep& sweep);

/// Copies a value of one rank to every rank. Collective.
template <class Value> Value of_rank(int rank, Value value, MPI_Comm comm)
{
  Checkpoint written;
  describe(written, value);
  std::vector<double> numbers = written.numbers();
  broadcast(numbers, comm, rank);
  Checkpoint read(std::move(numbers));
  describe(read, value);
  return value;
}

} // namespace squeal
