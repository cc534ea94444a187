#pragma once
/// MUMPS's factor, spread over all ranks, of a positive definite A bordered by rows B that are not eliminated:
///     A = L D L' and B A^-1 B' (Schur complement),
/// for models whose factor one rank cannot hold. A solve falls in two halves as Cholesky's does; right-hand sides and
/// the Schur complement are whole on rank 0.
#include "mumps.hpp"

namespace squeal
{

class Distributed
{
public:
  /// Collective. `mine`: this rank's share of the lower triangle of A and, from row dofs + 1 on, of B; `position`: of
  /// every degree of freedom in the order of elimination, read on rank 0.
  Distributed(Triplets mine, const std::vector<int>& position, int dofs, int border, MPI_Comm comm);

  /// A is not positive definite: the factor is of no use.
  bool failed() const { return failed_; }

  /// B A^-1 B', once, its lower triangle by columns; gives its storage away. On rank 0.
  std::vector<double> take_corner();

  /// B A^-1 b of `columns` right-hand sides, `dofs` long each; keeps the first half. Collective, all of it on rank 0.
  std::vector<double> forward(const std::vector<double>& b, int columns);

  /// A^-1 (b - B' lambda) into x. Collective, all of it on rank 0.
  void backward(const std::vector<double>& lambda, std::vector<double>& x);

  double entries() const; // all ranks'

private:
  void solve_half(int half);

  int dofs_, border_, columns_ = 0;
  bool here_, failed_ = false;
  Mumps mumps_;
  std::vector<double> corner_, right_, reduced_; // right_: columns, dofs_ + border_ long
};

/// What a Distributed of this matrix holds at its largest, all ranks together [bytes]. Collective.
double distributed_memory(Triplets mine, const std::vector<int>& position, int dofs, int border, MPI_Comm comm);

} // namespace squeal
