#pragma once
/// The condensed operator W of the contact solvers, symmetric, over the rows of all pairs (src/README.md, section 4.4).
/// How it is stored is known to this type alone: solvers use its products, the blocks of its diagonal, and its rows
/// added up pair by pair.
///
/// Its lower triangle is stored by columns, of which each rank has a share; one rank alone has all of W. Or it stays in
/// the factor of A as W = scale E E' (section 8.1): a product then reads the rows of E, which all ranks hold a part of.
///
/// The near field (section 4.7) holds the blocks that matter during sweeps, in single precision. Of a row it lacks the
/// smallest ones, whose sizes add up to a hundredth of the pair's own block. What it leaves out is met by a product
/// with W after the sweeps, so that each such round can gain a factor of a hundred.
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/contact/pair_law.hpp"

#include <cstddef>
#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace squeal
{

/// scale E E' plus a diagonal matrix, by products that the factor forms.
struct ScaledProducts
{
  CondensedProducts products;
  double scale = 1;
  std::vector<double> diagonal; // that is added, of every row; empty: none
};

/// The large blocks of W in single precision, in the rows of each pair by runs of neighbouring columns. The pairs form
/// patches that act little on each other, the pins of a brake pad say.
struct NearField
{
  /// Of a pair's own block, in a row: a larger share makes sweeps cheaper and products with W more frequent.
  static constexpr double left_out = 1e-2;
  struct Run
  {
    std::size_t first, count; // of w's entries
  };
  struct PairRow
  {
    std::vector<Run> runs{};
    std::vector<float> values{}; // run after run, the pair's rows of each run one after the other
  };
  std::vector<PairRow> inside, outside;            // of every pair: columns of its own patch, and of others
  std::vector<std::vector<std::size_t>> patches{}; // pairs, ascending
  bool in_turn = false; // patches are pieces of a single one: all even ones are swept, then all odd ones

  std::size_t entries() const;
};

/// Where W is stored: by its entries, or in the factor.
enum class OperatorStorage
{
  whole,
  by_factor,
};

/// Whether a product with a W of so many rows reads fewer numbers by the factor, whose rows of E have so many entries,
/// or a whole W would take more than a quarter of the memory that is `free` [bytes].
bool stays_in_factor(double rows, double border_entries, double free);

/// On rank 0. The ranks form products together where W is in the factor, or its columns are on all of them. There each
/// rank has some patches of the near field besides, where there are several, and the blocks of the diagonal.
class ContactOperator
{
public:
  ContactOperator() = default;

  std::size_t pairs() const { return pairs_; }
  int directions() const { return directions_; }
  std::size_t size() const { return PairRows<std::size_t>(directions_).rows_of(pairs_); } // rows

  /// W_ii
  const PairBlock& diagonal(std::size_t pair) const { return diagonal_[pair]; }
  const NaturalScale& scale(std::size_t pair) const { return scale_[pair]; }

  /// y = W x
  void multiply(std::span<const double> x, std::span<double> y) const;

  /// Whether all entries are stored, on rank 0 or on all that share them; the same on all ranks.
  bool is_stored() const { return !products_; }

  /// Gathers shared entries on rank 0, which keeps them all besides. hold_whole: collective. ask_for_whole: of rank 0,
  /// while the others are within ServedProducts.
  void hold_whole() const;
  void ask_for_whole() const;

  /// w += W dr of a change dr of one pair's reaction. Rank 0 has all entries.
  void add_product(std::size_t pair, const PairVector& change, std::span<double> w) const;

  /// The same by the near field, which small operators do not have.
  void add_near_product(std::size_t pair, const PairVector& change, std::span<float> w) const;
  /// Its part in the rows of the pair's own patch, and in those of the other patches that this rank has.
  void add_product_in_patch(std::size_t pair, const PairVector& change, std::span<float> w) const;
  void add_product_beyond_patch(std::size_t pair, const PairVector& change, std::span<float> w) const;
  bool has_near_field() const { return !near_.inside.empty(); }
  double near_share() const; // entries of the near field over those of W

  /// Of the near field: all patches, whether they are pieces that take turns (NearField), the rank of each, and whether
  /// ranks but the first have some.
  const std::vector<std::vector<std::size_t>>& patches() const { return near_.patches; }
  bool patches_take_turns() const { return near_.in_turn; }
  int owner(std::size_t patch) const { return owners_.empty() ? 0 : owners_[patch]; }
  bool shares_patches() const { return !owners_.empty(); }

  /// The ranks that form products together; MPI_COMM_NULL: rank 0 alone.
  MPI_Comm shared_by() const { return shared_by_; }

  /// Gives every rank its share of the columns of a large W, and of the patches. From now on products are formed from
  /// these, within ServedProducts only. Collective.
  void share(MPI_Comm comm);

  /// On other ranks, their part of a product that rank 0 forms: the whole of it, and what follows rank 0's word.
  void follow_product() const;
  void serve_product() const;

  /// All entries by rows, on rank 0, of a stored W that is not shared, or after hold_whole.
  std::span<const double> entries() const { return values_; }

  /// The largest eigenvalue of R W R, R the diagonal matrix of these roots, by power iteration: a lower bound.
  double largest_eigenvalue(std::span<const double> roots, int iterations) const;

private:
  friend class ServedProducts;
  friend ContactOperator make_contact_operator(std::vector<double> W, int pairs, int directions);
  friend ContactOperator make_contact_operator(const ScaledProducts& W, OperatorStorage storage, int pairs,
                                               int directions, MPI_Comm comm);

  /// Strips of a few columns of the lower triangle, one after the other, from each strip's first row on.
  struct Strips
  {
    std::size_t first = 0, last = 0; // columns
    std::vector<double> values{};
  };

  void set_diagonal(std::vector<PairBlock> blocks);
  void multiply_stored(std::vector<double>& x, std::vector<double>& y) const;
  void multiply_by_factor(std::span<const double> x, std::span<double> y) const;
  void add_strips(const std::vector<double>& x, std::vector<double>& y) const;
  void for_each_strip(const std::function<void(const CondensedStrip&)>& work) const;
  std::vector<std::size_t> share_columns(std::size_t rows, MPI_Comm comm);
  void append_strips(const CondensedStrip& columns);
  void make_place() const;
  void fill_whole(std::size_t first_column, std::size_t last_column, const double* entry) const;
  void gather() const;
  void share_patches();

  std::size_t pairs_ = 0;
  int directions_ = 0;
  mutable std::vector<double> values_;     // by rows, where rank 0 has all of them
  std::optional<ScaledProducts> products_; // the same on all ranks; none: entries are stored
  std::vector<PairBlock> diagonal_;
  std::vector<NaturalScale> scale_;
  NearField near_;                         // empty: W is small; on other ranks the rows of their patches, inside
  std::vector<int> owners_;                // of patches; empty: rank 0 has all
  std::vector<NearField::PairRow> beyond_; // the rows outside, in the columns of this rank's patches, where ranks share
  MPI_Comm shared_by_ = MPI_COMM_NULL;     // the ranks that form products together
  std::size_t rows_ = 0;                   // of W, on all ranks that share its columns
  Strips strips_;                          // of this rank, where ranks share
  mutable bool held_whole_ = false;        // besides; the same on all ranks
};

/// While rank 0 solves contact with products, and sweeps over patches, that W's ranks share, the constructor of the
/// others serves until rank 0's object ends. Nothing where W is not shared. Collective.
class ServedProducts
{
public:
  explicit ServedProducts(const ContactOperator& W);
  ServedProducts(const ServedProducts&) = delete;
  ServedProducts& operator=(const ServedProducts&) = delete;
  ~ServedProducts();

private:
  const ContactOperator& W_;
};

/// From a dense symmetric W, stored by rows. Error: the number of its entries does not fit.
ContactOperator make_contact_operator(std::vector<double> W, int pairs, int directions);

/// Whether ranks share an operator of so many rows: reading less takes no longer than two messages.
bool is_worth_sharing(double rows, int ranks);

/// From products with the factor's rows, strip by strip. by_factor: the near field reads them twice, and W stays in the
/// factor. whole: each rank stores a share; is_worth_sharing. Collective.
ContactOperator make_contact_operator(const ScaledProducts& W, OperatorStorage storage, int pairs, int directions,
                                      MPI_Comm comm);

/// target += sum of factors[k] row_k over the rows of one pair (1 to 3), `length` long, one after the other. Arithmetic
/// of one rank.
void add_rows(const float* rows, std::size_t length, std::size_t number, const PairVector& factors, float* target);

} // namespace squeal
