#pragma once
/// Supernodal multifrontal Cholesky factor of a positive definite A bordered by rows B that are not eliminated
/// (src/README.md, sections 8.1 and 8.2):
///     A = L L',   E = B L^-T,   B A^-1 B' = E E' (Schur complement),
/// so that a solve has two halves, y = L^-1 b with E y = B A^-1 b, and x = L^-T (y - E' lambda). Each rank holds its
/// share of the elimination tree (tree_share.hpp).
#include "squeal/algebra/bordered_factor.hpp"
#include "tree_share.hpp"

#include <petscsf.h>

namespace squeal
{

struct Columns;
struct Front;

/// Right-hand sides and solutions between the ranks that own their rows and those that own their positions in a
/// supernodal factor. The rows of shared supernodes stay where they are.
class PositionExchange
{
public:
  /// `position`: of each row; `owner`: of each position, empty on one rank.
  PositionExchange(const RowLayout& layout, const std::vector<int>& position, const std::vector<int>& owner,
                   MPI_Comm comm);

  /// Puts b into x, `lanes` numbers a position: what this rank owns, and of shared positions its own rows. Collective.
  void gather(std::span<const double* const> b, std::size_t lanes, std::vector<double>& x) const;

  /// The reverse: the own rows from what the ranks own and what this rank has of shared positions. Collective.
  void scatter(const std::vector<double>& x, std::size_t lanes, std::span<double* const> b) const;

private:
  std::vector<std::size_t> positions_; // that this rank fills
  Owned<PetscSF> rows_;                // from the rows to these
};

class Cholesky
{
public:
  /// `own`: this rank's entries of the lower triangle of A and, from row dofs + 1 on, of B. `symbolic`: their analysis,
  /// read on rank 0. `layout`: of the rows of A. Collective.
  Cholesky(Triplets own, SymbolicFactor symbolic, const RowLayout& layout, MPI_Comm comm);

  /// Whether A is not positive definite, the same on all ranks; the factor is then not to be used.
  bool failed() const { return failed_; }

  /// Some columns of E E', and the rank that takes them.
  struct WantedColumns
  {
    std::size_t first, last;
    int rank;
  };

  /// Gives `take` one strip after the other, of which the lower triangle is set. Collective.
  void read_schur_complement(std::span<const WantedColumns> strips,
                             const std::function<void(const CondensedStrip&)>& take) const;

  /// E L^-1 b, on rank 0, of right-hand sides whose own rows are given; keeps L^-1 b. Collective.
  std::vector<double> forward(std::span<const double* const> b);

  /// L^-T (L^-1 b - E' lambda) into the own rows x; lambda is read on rank 0. Collective.
  void backward(const std::vector<double>& lambda, std::span<double* const> x);

  /// Entries of L and E on all ranks.
  double entries() const { return share_.symbolic.entries; }

private:
  struct Work; // memory that elimination works in

  void factorise(Triplets own);
  bool eliminate_own(const Columns& A, Work& work);
  bool eliminate_shared(const Columns& A, Work& work);
  void add_children(const Front& front, const std::vector<int>& local, Work& work) const;
  void pack(const Supernode& supernode, const double* front, std::size_t split);
  void sum_shared_pivots();
  void subtract_shared_border();
  const int* rows_of(const Supernode& supernode) const { return share_.symbolic.rows.data() + supernode.rows_begin; }

  MPI_Comm comm_;
  TreeShare share_;
  PositionExchange exchange_;
  std::vector<double> values_;          // L and E, packed
  std::vector<double> work_;            // L^-1 b: the entries of all columns at a position are neighbours
  std::size_t columns_ = 0, lanes_ = 0; // of `work_`: lanes_ - columns_ of each position are not used
  bool failed_ = false;
};

/// The largest memory that a Cholesky takes on one rank [bytes].
double cholesky_memory(const SymbolicFactor& symbolic);

/// The largest memory that this rank's share of one takes [bytes].
double cholesky_memory(const TreeShare& share);

} // namespace squeal
