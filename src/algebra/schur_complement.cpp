/// Parts of the Schur complement E E' of a bordered factor, from the rows of E that the factor holds. Nothing of its
/// size is stored. Each rank adds up what its own subtrees give and, of shared supernodes, what its border rows give.
#include "cholesky.hpp"
#include "squeal/algebra/panel.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <petscblaslapack.h>

namespace squeal
{

namespace
{

/// E of one supernode: the rows of its panel that belong to the border.
struct BorderRows
{
  Panel panel;                    // its first rows may belong to the tile that ends above the border
  std::size_t before;             // number of these
  std::span<const int> positions; // in the order of elimination, of the rows after them; ascending
  int dofs;                       // positions before the border

  std::size_t pivots() const { return panel.columns; }
};

BorderRows border_rows(const TreeShare& share, std::size_t k, const std::vector<double>& values)
{
  const Supernode& supernode = share.symbolic.supernodes[k];
  const std::size_t pivots = at(supernode.columns), below = at(supernode.below), inner = at(supernode.inner());
  const double* const panels = values.data() + supernode.values_begin + packed_triangle(pivots);
  const bool shared = k >= share.own; // these have a panel of their own for the border
  const std::size_t above = inner / tile * tile;
  return {shared ? Panel{panels + packed_panel(inner, pivots), below - inner, pivots, 0}
                 : Panel{panels, below - above, pivots, above},
          shared ? 0 : inner - above,
          {share.symbolic.rows.data() + supernode.rows_begin + inner, below - inner},
          share.symbolic.dofs};
}

/// The place of the first row that is not before `row`.
std::size_t place_of_row(std::span<const int> rows, int row)
{
  return static_cast<std::size_t>(std::lower_bound(rows.begin(), rows.end(), row) - rows.begin());
}

/// Some columns of a lower triangle, from the first one's row on.
struct Strip
{
  int first, last;
  std::size_t height; // distance of two columns
  double* values;

  double* column(int j) const { return values + at(j - first) * height; }
};

/// Rows of E by columns, one after the other.
struct DenseRows
{
  std::vector<int> rows{};      // of the border, ascending
  std::vector<double> values{}; // and what is left of a larger use
};

/// Memory is used again from supernode to supernode and from strip to strip. The system would take as long to clear
/// new one as the products take.
void enlarge(std::vector<double>& values, std::size_t size)
{
  if (values.size() < size) values.resize(size);
}

/// Adds the products of `left` with `right`, rows that the strip has as columns, to the strip's lower triangle.
void add_products(const DenseRows& left, const DenseRows& right, std::size_t pivots, const Strip& strip,
                  std::vector<double>& products)
{
  constexpr std::size_t most = 128; // columns at once: of what is above their diagonal block nothing is computed
  const double one = 1, zero = 0;
  for (std::size_t j = 0; j < right.rows.size(); j += most)
  {
    const std::size_t begin = place_of_row(left.rows, right.rows[j]), width = std::min(most, right.rows.size() - j);
    PetscBLASInt m = to_int(left.rows.size() - begin), n = to_int(width), k = to_int(pivots),
                 left_height = to_int(left.rows.size()), right_height = to_int(right.rows.size());
    if (m == 0) return;
    products.resize(std::max(products.size(), at(m) * width));
    BLASgemm_("N", "T", &m, &n, &k, &one, left.values.data() + begin, &left_height, right.values.data() + j,
              &right_height, &zero, products.data(), &m);
    for (std::size_t c = 0; c < width; ++c)
    {
      const int row = right.rows[j + c];
      double* const to = strip.column(row) - strip.first;
      const double* const from = products.data() + c * at(m);
      for (std::size_t i = place_of_row(left.rows, row) - begin; i < at(m); ++i) to[left.rows[begin + i]] += from[i];
    }
  }
}

/// Rows of E from the strip's first one on.
void rows_from(const BorderRows& E, int first, DenseRows& dense)
{
  const std::size_t begin = place_of_row(E.positions, E.dofs + first);
  dense.rows.clear();
  for (const int position : E.positions.subspan(begin)) dense.rows.push_back(position - E.dofs);
  enlarge(dense.values, dense.rows.size() * E.pivots());
  if (!dense.rows.empty()) unpack_rows(E.panel, E.before + begin, dense.values.data());
}

/// The leading rows, before the border's row `last`.
void rows_before(const DenseRows& E, std::size_t pivots, int last, DenseRows& leading)
{
  const std::size_t count = place_of_row(E.rows, last);
  leading.rows.assign(E.rows.begin(), E.rows.begin() + static_cast<std::ptrdiff_t>(count));
  enlarge(leading.values, count * pivots);
  for (std::size_t j = 0; j < pivots; ++j)
    std::copy_n(E.values.data() + j * E.rows.size(), count, leading.values.data() + j * count);
}

/// All ranks' rows of a shared supernode that the strip has as columns. `own`: this rank's. Collective.
void gather(const DenseRows& own, const std::vector<int>& border, std::size_t pivots, MPI_Comm comm, DenseRows& all,
            std::vector<double>& received)
{
  const int ranks = ranks_of(comm);
  std::vector<int> count(at(ranks), 0), counts, starts(count.size(), 0);
  for (const int row : border) ++count[at(holder_of(row, ranks))];
  for (const int rows : count) counts.push_back(to_int(at(rows) * pivots));
  for (std::size_t p = 1; p < counts.size(); ++p) starts[p] = starts[p - 1] + counts[p - 1];
  enlarge(received, border.size() * pivots);
  MPI_Allgatherv(own.values.data(), to_int(own.rows.size() * pivots), MPI_DOUBLE, received.data(), counts.data(),
                 starts.data(), MPI_DOUBLE, comm);
  all.rows = border;
  enlarge(all.values, border.size() * pivots);
  std::vector<std::size_t> next(starts.begin(), starts.end());
  for (std::size_t i = 0; i < border.size(); ++i)
  {
    const auto rank = at(holder_of(border[i], ranks));
    const std::size_t from = next[rank]++;
    for (std::size_t j = 0; j < pivots; ++j) all.values[j * border.size() + i] = received[from + j * at(count[rank])];
  }
}

/// Adds the parts of all ranks on one of them, in messages of moderate length. Collective.
void sum_on(int rank, std::vector<double>& part, MPI_Comm comm)
{
  if (ranks_of(comm) == 1) return;
  constexpr std::size_t together = 1 << 16; // numbers: of longer messages Open MPI adds 1 GB/s instead of 6
  const bool here = rank_of(comm) == rank;
  for (std::size_t begin = 0; begin < part.size(); begin += together)
  {
    double* const from = part.data() + begin;
    MPI_Reduce(here ? MPI_IN_PLACE : from, from, to_int(std::min(together, part.size() - begin)), MPI_DOUBLE, MPI_SUM,
               rank, comm);
  }
}

} // namespace

void Cholesky::read_schur_complement(std::span<const WantedColumns> strips,
                                     const std::function<void(const CondensedStrip&)>& take) const
{
  std::vector<double> values, products, received;
  DenseRows own, leading, all;
  for (const auto& [begin, end, rank] : strips)
  {
    const std::size_t height = at(share_.symbolic.border) - begin;
    const int first = to_int(begin), last = to_int(end);
    values.assign(height * (end - begin), 0.);
    const Strip strip{first, last, height, values.data()};
    for (std::size_t k = 0; k < share_.symbolic.supernodes.size(); ++k)
    {
      const BorderRows E = border_rows(share_, k, values_);
      const bool shared = k >= share_.own;
      const std::span<const int> border = shared ? share_.shared[k - share_.own].border : E.positions;
      std::vector<int> columns; // on all ranks that have some
      for (std::size_t i = place_of_row(border, E.dofs + first); i < place_of_row(border, E.dofs + last); ++i)
        columns.push_back(border[i] - E.dofs);
      if (columns.empty()) continue;
      rows_from(E, first, own);
      rows_before(own, E.pivots(), last, leading);
      if (shared) gather(leading, columns, E.pivots(), comm_, all, received);
      add_products(own, shared ? all : leading, E.pivots(), strip, products);
    }
    sum_on(rank, values, comm_);
    if (rank_of(comm_) == rank) take({begin, end, height, values.data()});
  }
}

} // namespace squeal
