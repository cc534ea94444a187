#pragma once
/// MUMPS's factor, spread over all ranks, of a positive definite A bordered by rows B that are not eliminated:
///     A = L D L' and the Schur complement B A^-1 B',
/// for models whose factor one rank cannot hold. A solve has the two halves of Cholesky's (cholesky.hpp). Right-hand
/// sides and the Schur complement are whole on rank 0.
#include "mumps.hpp"

namespace squeal
{

/// This rank's entries of A bordered by B, and the order of elimination.
struct BorderedEntries
{
  Triplets lower;                      // the lower triangle of A and, from row dofs + 1 on, B
  const std::vector<int>& elimination; // the position of each degree of freedom, from zero; read on rank 0
  int dofs = 0, border = 0;            // rows of A, of B
  MPI_Comm comm = MPI_COMM_NULL;
};

class MumpsFactor
{
public:
  /// Collective.
  explicit MumpsFactor(BorderedEntries entries);

  /// Whether A is not positive definite; the factor is then not to be used.
  bool failed() const { return failed_; }

  /// B A^-1 B' by columns, of which the lower triangle is set; on rank 0. Moves its storage out: call it once.
  std::vector<double> take_schur_complement();

  /// B A^-1 b of `columns` right-hand sides, `dofs` long each; keeps the first half. Collective, all of it on rank 0.
  std::vector<double> forward(const std::vector<double>& b, int columns);

  /// A^-1 (b - B' lambda) into x. Collective, all of it on rank 0.
  void backward(const std::vector<double>& lambda, std::vector<double>& x);

  /// Entries of the factor, on all ranks together.
  double entries() const;

private:
  void solve_half(int half);

  int dofs_, border_, columns_ = 0;
  bool on_rank_zero_, failed_ = false;
  Mumps mumps_;
  std::vector<double> schur_complement_;
  std::vector<double> right_;   // right-hand sides and then solutions, dofs_ + border_ long each
  std::vector<double> reduced_; // the same of the border
};

/// The largest memory that a MumpsFactor of these entries takes, all ranks together [bytes]. Collective.
double mumps_factor_memory(BorderedEntries entries);

} // namespace squeal
