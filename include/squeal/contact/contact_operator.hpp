#pragma once
/// The condensed operator W of the contact solvers, symmetric, over the rows of all pairs (src/README.md, section 4.4).
/// How it is stored is known to this type alone. Solvers use its products, the blocks of its diagonal, and its rows
/// added up pair by pair.
///
/// Ranks share a large W: each has some columns of its lower triangle, and sweeps over some of the pairs. They solve
/// contact together, from the same numbers. A small W is rank 0's alone.
///
/// The near field (section 4.7) holds the blocks that matter during sweeps, in single precision. Of a row it lacks the
/// smallest ones, whose sizes add up to a hundredth of the pair's own block. What it leaves out is met by a product
/// with W after the sweeps, so that each such round can gain a factor of a hundred.
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/contact/interface.hpp"
#include "squeal/contact/pair_law.hpp"

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace squeal
{

/// The large blocks of W in the rows of a pair, by runs of neighbouring columns.
struct NearRow
{
  struct Run
  {
    std::size_t first, count; // of w's entries
    std::size_t begin;        // of its values, the pair's rows one after the other
  };
  std::vector<Run> runs{};
  std::vector<float> values{};
};

/// Pairs that the ranks sweep over side by side, each over its own ones.
struct Turn
{
  std::vector<std::size_t> order{}; // pairs, rank by rank
  std::vector<int> counts{};        // pairs of each rank
  std::size_t begin = 0, end = 0;   // of this rank's, in `order`

  std::span<const std::size_t> own() const { return std::span(order).subspan(begin, end - begin); }
};

/// All pairs, on this rank alone.
Turn all_pairs(std::size_t pairs);

/// All but its size is rank 0's, or of all ranks that share it.
class ContactOperator
{
public:
  /// The part of a pair's own block that the near field may lack in its row. A larger one makes sweeps cheaper and
  /// products with W more frequent.
  static constexpr double left_out = 1e-2;

  ContactOperator() = default;

  /// `columns`: this rank's ones (column_shares), each from the first one's row on; what is above the diagonal is not
  /// read. On one rank all of a symmetric W. Collective.
  ContactOperator(std::vector<double> columns, int pairs, int directions, MPI_Comm comm);

  std::size_t pairs() const { return diagonal_.size(); }
  int directions() const { return directions_; }
  std::size_t size() const { return PairRows<std::size_t>(directions_).rows_of(pairs()); } // rows

  /// W_ii
  const PairBlock& diagonal(std::size_t pair) const { return diagonal_[pair]; }
  const NaturalScale& scale(std::size_t pair) const { return scale_[pair]; }

  /// The ranks that share W; MPI_COMM_NULL: rank 0 has it alone.
  MPI_Comm shared_by() const { return shared_by_; }

  /// y = W x. Collective of the ranks that share W.
  void multiply(std::span<const double> x, std::span<double> y) const;
  /// y = W x on rank 0 alone, which has all entries.
  void multiply_alone(std::span<const double> x, std::span<double> y) const;

  /// Gathers shared entries on rank 0, which keeps them all besides. Collective.
  void hold_whole() const;
  /// All entries by rows, on rank 0: after hold_whole.
  std::span<const double> entries() const { return shared_by_ == MPI_COMM_NULL ? columns_ : whole_; }

  /// w += W dr of a change dr of one pair's reaction. Rank 0 has all entries.
  void add_product(std::size_t pair, const PairVector& change, std::span<double> w) const;

  /// Adds that product of the near field, in the rows of this rank's pairs. Small operators have no near field.
  void add_product(std::size_t pair, const PairVector& change, std::span<float> w) const;
  bool has_near_field() const { return !near_.empty(); }

  /// The turns in which ranks sweep over all pairs: all at once, in each over slices that push each other little.
  const std::vector<Turn>& turns() const { return turns_; }

  /// The largest eigenvalue of R W R, R the diagonal matrix of these roots, by power iteration: a lower bound.
  /// Collective of the ranks that share W.
  double largest_eigenvalue(std::span<const double> roots, int iterations) const;

private:
  void set_diagonal(const CondensedStrip& own, MPI_Comm comm);
  void set_near_field(const CondensedStrip& own, MPI_Comm comm);

  int directions_ = 0;
  std::size_t first_ = 0, last_ = 0; // columns of this rank
  std::vector<double> columns_;
  MPI_Comm shared_by_ = MPI_COMM_NULL;
  mutable std::vector<double> whole_; // of a shared W, on rank 0
  mutable bool held_whole_ = false;   // the same on all ranks
  std::vector<PairBlock> diagonal_;
  std::vector<NaturalScale> scale_;
  std::vector<NearRow> near_; // of every pair, in the columns of this rank's pairs; empty: W is small
  std::vector<Turn> turns_;
};

/// The first column of each rank and the end: equal parts of the lower triangle, of whole pairs.
std::vector<std::size_t> column_shares(std::size_t rows, MPI_Comm comm);

/// From a dense symmetric W, stored by rows. Error: the number of its entries does not fit.
ContactOperator make_contact_operator(std::vector<double> W, int pairs, int directions);

/// scale B A^-1 B' of the factor of A bordered by B, with `added` on its diagonal, unless that is empty. Collective.
ContactOperator make_contact_operator(const Factor& factor, double scale, const std::vector<double>& added, int pairs,
                                      int directions, MPI_Comm comm);

// The factor of a matrix A bordered by the rows B of the pairs. The condensed contact operator W = scale B A^-1 B'
// comes from it (src/README.md, sections 4.4 and 8.4).

/// A factored, bordered by the interface's B. Collective.
/// Error: A singular, naming (`describe`) the offending degree of freedom by the names of rank 0 of A's ranks.
Factor factor_held(Mat A, const Interface& interface, const DofNames& names, const FactorOptions& options);

/// A symmetric matrix A, bordered by the interface's B, and whether it is positive definite.
struct Factored
{
  Factor factor; // of no use where `loose` is set
  /// The degree of freedom that moves most in a motion x whose resistance is below rounding; none: A is definite.
  std::optional<PetscInt> loose;
  bool indefinite = false; // in that motion x'A x < 0
  double resistance = 0;   // x'A x / x' diag(A) x, the least that inverse iteration found
};

/// Factors A bordered by B, after inverse iteration where A is not definite. Collective. Error: memory runs out.
Factored factor_positive(Mat A, const Interface& interface, const FactorOptions& options);

// Forces on rows of the pairs by what they do to the structure.

/// z with B'z nearest to x, on the rows that are taken (of as many entries as a contact vector), 0 on others.
/// Conjugate gradients on B B': pairs that share no node are independent of each other. Collective.
std::vector<double> forces_on_rows(const Interface& interface, const std::vector<char>& taken, Vec x);

} // namespace squeal
