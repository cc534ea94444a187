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

/// Entries of a matrix in the order of elimination, column by column.
struct Columns
{
  std::vector<std::size_t> starts;
  std::vector<int> rows;
  std::vector<double> values;
};

Columns sorted(const Triplets& lower, const Elimination& order)
{
  const std::size_t count = lower.row.size();
  Columns columns;
  columns.starts.assign(at(order.dofs) + 1, 0);
  columns.rows.resize(count);
  columns.values.resize(count);
  const auto place = [&](std::size_t k)
  {
    const int i = lower.row[k] - 1, q = order.position[at(lower.column[k] - 1)];
    const int p = i < order.dofs ? order.position[at(i)] : i;
    return std::pair(std::max(p, q), std::min(p, q));
  };
  for (std::size_t k = 0; k < count; ++k) ++columns.starts[at(place(k).second) + 1];
  for (std::size_t j = 0; j < at(order.dofs); ++j) columns.starts[j + 1] += columns.starts[j];
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

/// The frontal matrix of a supernode: its pivots and inner rows as columns, the border as rows too; lower part.
struct Front
{
  const Supernode& supernode;
  const int* below; // positions of its rows below
  double* values;

  std::size_t height() const { return at(supernode.height()); }
  std::size_t pivots() const { return at(supernode.columns); }
  double* column(std::size_t j) const { return values + j * height(); }
};

std::size_t front_size(const Supernode& supernode)
{
  return at(supernode.height()) * at(supernode.columns + supernode.inner());
}

/// What a front leaves to its parent: of inner columns, by columns of `below` each.
std::size_t update_size(const Supernode& supernode)
{
  return at(supernode.inner()) * at(supernode.below);
}

/// Most that the updates waiting for their parents, and a front, ever hold.
std::pair<std::size_t, std::size_t> room(const Elimination& order)
{
  std::size_t waiting = 0, most = 0, front = 0;
  for (const Supernode& supernode : order.supernodes)
  {
    for (const int child : supernode.children) waiting -= update_size(order.supernodes[at(child)]);
    waiting += update_size(supernode);
    most = std::max(most, waiting);
    front = std::max(front, front_size(supernode));
  }
  return {most, front};
}

/// Pivots, the rows below them, and what is left for the parent; false if a pivot is not positive.
bool eliminate_pivots(const Front& front)
{
  PetscBLASInt n = static_cast<PetscBLASInt>(front.height()), pivots = front.supernode.columns,
               below = front.supernode.below, inner = front.supernode.inner(), bordering = front.supernode.bordering,
               info = 0;
  const double one = 1, minus = -1;
  double *L = front.values, *lower = L + pivots, *update = L + at(pivots) * at(n) + pivots;
  LAPACKpotrf_("L", &pivots, L, &n, &info);
  if (info != 0) return false;
  if (below > 0) BLAStrsm_("R", "L", "T", "N", &below, &pivots, &one, L, &n, lower, &n);
  if (inner == 0) return true;
  BLASsyrk_("L", "N", &inner, &pivots, &minus, lower, &n, &one, update, &n);
  if (bordering > 0)
    BLASgemm_("N", "T", &bordering, &inner, &pivots, &minus, lower + inner, &n, lower, &n, &one, update + inner, &n);
  return true;
}

/// E E' of the front's border rows into the corner, tile by tile.
void add_to_corner(const Front& front, const Elimination& order, std::vector<double>& product,
                   std::vector<double>& corner)
{
  PetscBLASInt n = static_cast<PetscBLASInt>(front.height()), pivots = front.supernode.columns,
               bordering = front.supernode.bordering, border = order.border;
  const double one = 1, zero = 0;
  const int inner = front.supernode.inner(), *rows = front.below + inner;
  const double* E = front.values + pivots + inner;
  if (bordering == border)
  {
    BLASsyrk_("L", "N", &border, &pivots, &one, E, &n, &one, corner.data(), &border);
    return;
  }
  constexpr PetscBLASInt most = 128;
  for (PetscBLASInt first = 0; first < bordering; first += most)
  {
    PetscBLASInt width = std::min(most, bordering - first), height = bordering - first;
    product.resize(std::max(product.size(), at(height) * at(width)));
    BLASgemm_("N", "T", &height, &width, &pivots, &one, E + first, &n, E + first, &n, &zero, product.data(), &height);
    for (int j = 0; j < width; ++j)
    {
      double* column = &corner[at(rows[first + j] - order.dofs) * at(border)];
      const double* from = &product[at(j) * at(height)];
      for (int i = j; i < height; ++i) column[rows[first + i] - order.dofs] += from[i];
    }
  }
}

/// The entries of A and B in its columns; `local`: where in the front a position is.
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

/// What a child left, with its rows.
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
  const Columns A = sorted(lower, order_);
  lower = {};
  const auto [most, largest] = room(order_);
  // updates on a stack, since children come before parents; memory is not touched before it is needed
  const auto waiting = std::make_unique_for_overwrite<double[]>(most);
  const auto front_values = std::make_unique_for_overwrite<double[]>(largest);
  std::vector<double> product;
  std::vector<int> local(at(order_.dofs + order_.border));
  values_ = on_large_pages(order_.values);
  corner_ = on_large_pages(at(order_.border) * at(order_.border));
  corner_.resize(corner_.capacity(), 0.);
  double* top = waiting.get();
  for (const Supernode& supernode : order_.supernodes)
  {
    const Front front{supernode, order_.rows.data() + supernode.rows, front_values.get()};
    const std::size_t pivots = front.pivots(), below = at(supernode.below);
    assemble(front, A, local);
    for (auto number = supernode.children.rbegin(); number != supernode.children.rend(); ++number)
    {
      const Supernode& child = order_.supernodes[at(*number)];
      top -= update_size(child);
      add_update(front, child, order_.rows.data() + child.rows, top, local);
    }
    if (!eliminate_pivots(front)) return false;
    values_.resize(supernode.values + packed_triangle(pivots) + packed_panel(below, pivots));
    double* const rest = pack_triangle(front.values, front.height(), pivots, &values_[supernode.values]);
    pack_panel(front.values + pivots, front.height(), below, pivots, rest);
    if (supernode.bordering > 0) add_to_corner(front, order_, product, corner_);
    for (std::size_t j = 0; j < at(supernode.inner()); ++j, top += below)
      std::copy_n(front.column(pivots + j) + pivots, below, top);
  }
  return true;
}

Cholesky::Cholesky(Triplets lower, Elimination order) : order_(std::move(order))
{
  failed_ = !factorise(std::move(lower));
}

namespace
{

/// x: of all positions, the border's after them.
void forward_through(const Elimination& order, const double* values, std::size_t lanes, double* x)
{
  std::vector<double> part;
  for (const Supernode& supernode : order.supernodes)
  {
    const std::size_t pivots = at(supernode.columns), below = at(supernode.below);
    const double* const triangle = values + supernode.values;
    double* own = x + at(supernode.first) * lanes;
    solve_triangle(triangle, pivots, lanes, own);
    part.assign((below + tile) * lanes, 0.);
    subtract_product(Panel{triangle + packed_triangle(pivots), below, pivots}, lanes, own, part.data());
    const int* rows = order.rows.data() + supernode.rows;
    for (std::size_t i = 0; i < below; ++i)
      for (std::size_t l = 0; l < lanes; ++l) x[at(rows[i]) * lanes + l] += part[i * lanes + l];
  }
}

void backward_through(const Elimination& order, const double* values, std::size_t lanes, double* x)
{
  std::vector<double> part;
  for (auto supernode = order.supernodes.rbegin(); supernode != order.supernodes.rend(); ++supernode)
  {
    const std::size_t pivots = at(supernode->columns), below = at(supernode->below);
    const double* const triangle = values + supernode->values;
    double* own = x + at(supernode->first) * lanes;
    const int* rows = order.rows.data() + supernode->rows;
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
  const std::size_t dofs = at(order_.dofs), border = at(order_.border);
  work_.assign((dofs + border + tile) * lanes_, 0.);
  for (std::size_t i = 0; i < dofs; ++i)
    for (std::size_t k = 0; k < columns_; ++k) work_[at(order_.position[i]) * lanes_ + k] = b[k * dofs + i];
  forward_through(order_, values_.data(), lanes_, work_.data());
  std::vector<double> result(border * columns_);
  for (std::size_t i = 0; i < border; ++i)
    for (std::size_t k = 0; k < columns_; ++k) result[k * border + i] = -work_[(dofs + i) * lanes_ + k];
  return result;
}

void Cholesky::backward(const std::vector<double>& lambda, std::vector<double>& x)
{
  const std::size_t dofs = at(order_.dofs), border = at(order_.border);
  for (std::size_t i = 0; i < border; ++i)
    for (std::size_t k = 0; k < columns_; ++k) work_[(dofs + i) * lanes_ + k] = lambda[k * border + i];
  backward_through(order_, values_.data(), lanes_, work_.data());
  x.resize(dofs * columns_);
  for (std::size_t i = 0; i < dofs; ++i)
    for (std::size_t k = 0; k < columns_; ++k) x[k * dofs + i] = work_[at(order_.position[i]) * lanes_ + k];
}

double cholesky_memory(const Elimination& order)
{
  const auto [waiting, front] = room(order);
  return 8 * static_cast<double>(order.values + waiting + front) + 4 * static_cast<double>(order.rows.size());
}

} // namespace squeal
