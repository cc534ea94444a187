#include "cholesky.hpp"

#include "large_pages.hpp"
#include "squeal/algebra/panel.hpp"

#include <algorithm>
#include <memory>
#include <petscblaslapack.h>

namespace squeal
{

namespace
{

std::size_t at(int number)
{
  return static_cast<std::size_t>(number);
}

/// Entries of a matrix by columns, in the order of elimination.
struct Columns
{
  std::vector<std::size_t> starts;
  std::vector<int> rows;
  std::vector<double> values;
};

Columns ordered(const Triplets& lower, const SymbolicFactor& symbolic)
{
  const std::size_t count = lower.row.size();
  Columns columns;
  columns.starts.assign(at(symbolic.dofs) + 1, 0);
  columns.rows.resize(count);
  columns.values.resize(count);
  const auto place = [&](std::size_t k)
  {
    const int i = lower.row[k] - 1, q = symbolic.position[at(lower.column[k] - 1)];
    const int p = i < symbolic.dofs ? symbolic.position[at(i)] : i;
    return std::pair(std::max(p, q), std::min(p, q));
  };
  for (std::size_t k = 0; k < count; ++k) ++columns.starts[at(place(k).second) + 1];
  for (std::size_t j = 0; j < at(symbolic.dofs); ++j) columns.starts[j + 1] += columns.starts[j];
  std::vector<std::size_t> next(columns.starts.begin(), columns.starts.end() - 1);
  for (std::size_t k = 0; k < count; ++k)
  {
    const auto [row, column] = place(k);
    const std::size_t here = next[at(column)]++;
    columns.rows[here] = row;
    columns.values[here] = lower.value[k];
  }
  return columns;
}

/// The lower triangle of the frontal matrix of a supernode: columns for its pivots and inner rows, and the same rows
/// followed by those of the border.
struct Front
{
  const Supernode& supernode;
  const int* below; // positions of the rows below
  double* values;

  std::size_t height() const { return at(supernode.height()); }
  std::size_t pivots() const { return at(supernode.columns); }
  double* column(std::size_t j) const { return values + j * height(); }
};

std::size_t front_size(const Supernode& supernode)
{
  return at(supernode.height()) * at(supernode.columns + supernode.inner());
}

/// Size of the update that a front leaves to its parent, inner columns with `below` rows each.
std::size_t update_size(const Supernode& supernode)
{
  return at(supernode.inner()) * at(supernode.below);
}

/// The largest sizes of the stack of updates that wait for their parents, and of a front.
std::pair<std::size_t, std::size_t> largest_sizes(const SymbolicFactor& symbolic)
{
  std::size_t waiting = 0, most = 0, front = 0;
  for (const Supernode& supernode : symbolic.supernodes)
  {
    for (const int child : supernode.children) waiting -= update_size(symbolic.supernodes[at(child)]);
    waiting += update_size(supernode);
    most = std::max(most, waiting);
    front = std::max(front, front_size(supernode));
  }
  return {most, front};
}

/// Factorises the pivots and subtracts their products from the inner rows. Returns false if a pivot is not positive.
bool eliminate_pivots(const Front& front)
{
  PetscBLASInt n = static_cast<PetscBLASInt>(front.height()), pivots = front.supernode.columns,
               below = front.supernode.below, inner = front.supernode.inner(), border = front.supernode.border,
               info = 0;
  const double one = 1, minus = -1;
  double *L = front.values, *lower = L + pivots, *update = L + at(pivots) * at(n) + pivots;
  LAPACKpotrf_("L", &pivots, L, &n, &info);
  if (info != 0) return false;
  if (below > 0) BLAStrsm_("R", "L", "T", "N", &below, &pivots, &one, L, &n, lower, &n);
  if (inner == 0) return true;
  BLASsyrk_("L", "N", &inner, &pivots, &minus, lower, &n, &one, update, &n);
  if (border > 0)
    BLASgemm_("N", "T", &border, &inner, &pivots, &minus, lower + inner, &n, lower, &n, &one, update + inner, &n);
  return true;
}

/// Adds E E' of the front's border rows to the lower triangle of the Schur complement, tile by tile.
void add_to_schur_complement(const Front& front, const SymbolicFactor& symbolic, std::vector<double>& product,
                             std::vector<double>& schur_complement)
{
  PetscBLASInt n = static_cast<PetscBLASInt>(front.height()), pivots = front.supernode.columns,
               rows = front.supernode.border, border = symbolic.border;
  const double one = 1, zero = 0;
  const int inner = front.supernode.inner(), *positions = front.below + inner;
  const double* E = front.values + pivots + inner;
  if (rows == border)
  {
    BLASsyrk_("L", "N", &border, &pivots, &one, E, &n, &one, schur_complement.data(), &border);
    return;
  }
  constexpr PetscBLASInt most = 128;
  for (PetscBLASInt first = 0; first < rows; first += most)
  {
    PetscBLASInt width = std::min(most, rows - first), height = rows - first;
    product.resize(std::max(product.size(), at(height) * at(width)));
    BLASgemm_("N", "T", &height, &width, &pivots, &one, E + first, &n, E + first, &n, &zero, product.data(), &height);
    for (int j = 0; j < width; ++j)
    {
      double* column = &schur_complement[at(positions[first + j] - symbolic.dofs) * at(border)];
      const double* from = &product[at(j) * at(height)];
      for (int i = j; i < height; ++i) column[positions[first + i] - symbolic.dofs] += from[i];
    }
  }
}

/// Sets the front to the entries of A and B in its columns, and `local` to the row in the front of each position.
void assemble(const Front& front, const Columns& A, std::vector<int>& local)
{
  const std::size_t first = at(front.supernode.first), pivots = front.pivots();
  std::fill_n(front.values, front_size(front.supernode), 0.);
  for (std::size_t j = 0; j < pivots; ++j) local[first + j] = static_cast<int>(j);
  for (std::size_t i = 0; i < at(front.supernode.below); ++i) local[at(front.below[i])] = static_cast<int>(pivots + i);
  for (std::size_t j = 0; j < pivots; ++j)
    for (std::size_t k = A.starts[first + j]; k < A.starts[first + j + 1]; ++k)
      front.column(j)[local[at(A.rows[k])]] += A.values[k];
}

/// Adds the update that a child left, whose rows are the positions `rows`.
void add_update(const Front& front, const Supernode& child, const int* rows, const double* update,
                const std::vector<int>& local)
{
  const std::size_t below = at(child.below);
  for (std::size_t j = 0; j < at(child.inner()); ++j)
  {
    double* column = front.column(at(local[at(rows[j])]));
    for (std::size_t i = j; i < below; ++i) column[local[at(rows[i])]] += update[j * below + i];
  }
}

} // namespace

bool Cholesky::factorise(Triplets lower)
{
  const Columns A = ordered(lower, symbolic_);
  lower = {};
  const auto [most, largest] = largest_sizes(symbolic_);
  // Updates form a stack, since children come before parents. Its memory is not touched before it is needed.
  const auto waiting = std::make_unique_for_overwrite<double[]>(most);
  const auto front_values = std::make_unique_for_overwrite<double[]>(largest);
  std::vector<double> product;
  std::vector<int> local(at(symbolic_.dofs + symbolic_.border));
  values_ = vector_on_large_pages(symbolic_.values);
  schur_complement_ = vector_on_large_pages(at(symbolic_.border) * at(symbolic_.border));
  schur_complement_.resize(schur_complement_.capacity(), 0.);
  double* top = waiting.get();
  for (const Supernode& supernode : symbolic_.supernodes)
  {
    const Front front{supernode, symbolic_.rows.data() + supernode.rows_begin, front_values.get()};
    const std::size_t pivots = front.pivots(), below = at(supernode.below);
    assemble(front, A, local);
    for (auto number = supernode.children.rbegin(); number != supernode.children.rend(); ++number)
    {
      const Supernode& child = symbolic_.supernodes[at(*number)];
      top -= update_size(child);
      add_update(front, child, symbolic_.rows.data() + child.rows_begin, top, local);
    }
    if (!eliminate_pivots(front)) return false;
    values_.resize(supernode.values_begin + packed_triangle(pivots) + packed_panel(below, pivots));
    double* const rest = pack_triangle(front.values, front.height(), pivots, &values_[supernode.values_begin]);
    pack_panel(front.values + pivots, front.height(), below, pivots, rest);
    if (supernode.border > 0) add_to_schur_complement(front, symbolic_, product, schur_complement_);
    for (std::size_t j = 0; j < at(supernode.inner()); ++j, top += below)
      std::copy_n(front.column(pivots + j) + pivots, below, top);
  }
  return true;
}

Cholesky::Cholesky(Triplets lower, SymbolicFactor symbolic) : symbolic_(std::move(symbolic))
{
  failed_ = !factorise(std::move(lower));
}

namespace
{

/// x: entries of all positions, then those of the border, `lanes` each.
void forward_substitution(const SymbolicFactor& symbolic, const double* values, std::size_t lanes, double* x)
{
  std::vector<double> part;
  for (const Supernode& supernode : symbolic.supernodes)
  {
    const std::size_t pivots = at(supernode.columns), below = at(supernode.below);
    const double* const triangle = values + supernode.values_begin;
    double* own = x + at(supernode.first) * lanes;
    solve_triangle(triangle, pivots, lanes, own);
    part.assign((below + tile) * lanes, 0.);
    subtract_product(Panel{triangle + packed_triangle(pivots), below, pivots}, lanes, own, part.data());
    const int* rows = symbolic.rows.data() + supernode.rows_begin;
    for (std::size_t i = 0; i < below; ++i)
      for (std::size_t l = 0; l < lanes; ++l) x[at(rows[i]) * lanes + l] += part[i * lanes + l];
  }
}

void backward_substitution(const SymbolicFactor& symbolic, const double* values, std::size_t lanes, double* x)
{
  std::vector<double> part;
  for (auto supernode = symbolic.supernodes.rbegin(); supernode != symbolic.supernodes.rend(); ++supernode)
  {
    const std::size_t pivots = at(supernode->columns), below = at(supernode->below);
    const double* const triangle = values + supernode->values_begin;
    double* own = x + at(supernode->first) * lanes;
    const int* rows = symbolic.rows.data() + supernode->rows_begin;
    part.assign((below + tile) * lanes, 0.);
    for (std::size_t i = 0; i < below; ++i)
      for (std::size_t l = 0; l < lanes; ++l) part[i * lanes + l] = x[at(rows[i]) * lanes + l];
    subtract_transposed(Panel{triangle + packed_triangle(pivots), below, pivots}, lanes, part.data(), own);
    solve_transposed_triangle(triangle, pivots, lanes, own);
  }
}

} // namespace

std::vector<double> Cholesky::forward(const std::vector<double>& b, int columns)
{
  columns_ = at(columns);
  lanes_ = lanes_for(columns_);
  const std::size_t dofs = at(symbolic_.dofs), border = at(symbolic_.border);
  work_.assign((dofs + border + tile) * lanes_, 0.);
  for (std::size_t i = 0; i < dofs; ++i)
    for (std::size_t k = 0; k < columns_; ++k) work_[at(symbolic_.position[i]) * lanes_ + k] = b[k * dofs + i];
  forward_substitution(symbolic_, values_.data(), lanes_, work_.data());
  std::vector<double> result(border * columns_);
  for (std::size_t i = 0; i < border; ++i)
    for (std::size_t k = 0; k < columns_; ++k) result[k * border + i] = -work_[(dofs + i) * lanes_ + k];
  return result;
}

void Cholesky::backward(const std::vector<double>& lambda, std::vector<double>& x)
{
  const std::size_t dofs = at(symbolic_.dofs), border = at(symbolic_.border);
  for (std::size_t i = 0; i < border; ++i)
    for (std::size_t k = 0; k < columns_; ++k) work_[(dofs + i) * lanes_ + k] = lambda[k * border + i];
  backward_substitution(symbolic_, values_.data(), lanes_, work_.data());
  x.resize(dofs * columns_);
  for (std::size_t i = 0; i < dofs; ++i)
    for (std::size_t k = 0; k < columns_; ++k) x[k * dofs + i] = work_[at(symbolic_.position[i]) * lanes_ + k];
}

double cholesky_memory(const SymbolicFactor& symbolic)
{
  const auto [waiting, front] = largest_sizes(symbolic);
  return sizeof(double) * static_cast<double>(symbolic.values + waiting + front) +
         sizeof(int) * static_cast<double>(symbolic.rows.size());
}

} // namespace squeal
