#include "squeal/algebra/panel.hpp"

#include "registers.hpp"

#include <algorithm>
#include <bit>

namespace squeal
{

namespace
{

/// The distance of software prefetches in a strip [numbers]: a page, beyond which the processor itself does not
/// prefetch.
constexpr std::size_t prefetch_distance = 512;

constexpr std::size_t padded(std::size_t rows)
{
  return (rows + tile - 1) / tile * tile;
}

/// The width of the strip that begins at column j.
constexpr std::size_t width_from(std::size_t j, std::size_t columns)
{
  return std::min(tile, std::bit_floor(columns - j));
}

/// The width of the strip that ends before column j.
constexpr std::size_t width_before(std::size_t j)
{
  return std::min(tile, j & -j);
}

/// Calls work(width) with a width that the compiler knows.
template <class Work> SQUEAL_INLINE void with_width(std::size_t width, const Work& work)
{
  switch (width)
  {
  case 8:
    return work(std::integral_constant<std::size_t, 8>{});
  case 4:
    return work(std::integral_constant<std::size_t, 4>{});
  case 2:
    return work(std::integral_constant<std::size_t, 2>{});
  default:
    return work(std::integral_constant<std::size_t, 1>{});
  }
}

/// y -= L x for a strip and one right-hand side.
template <std::size_t width>
SQUEAL_INLINE void subtract_strip(const double* L, std::size_t rows, const double* x, double* y)
{
  Eight some_L, some_y;
  for (std::size_t i = 0; i < rows; i += tile, L += tile * width)
  {
    get(y + i, some_y);
    for (std::size_t k = 0; k < width; ++k)
    {
      __builtin_prefetch(L + tile * k + prefetch_distance);
      get(L + tile * k, some_L);
      some_y -= some_L * x[k];
    }
    put(some_y, y + i);
  }
}

/// y -= L' x for a strip and one right-hand side.
template <std::size_t width>
SQUEAL_INLINE void subtract_transposed_strip(const double* L, std::size_t rows, const double* x, double* y)
{
  constexpr std::size_t half = tile / 2;
  Four sums[width] = {}, some_L, upper_x, lower_x;
  for (std::size_t i = 0; i < rows; i += tile, L += tile * width)
  {
    get(x + i, upper_x);
    get(x + i + half, lower_x);
    for (std::size_t k = 0; k < width; ++k)
    {
      __builtin_prefetch(L + tile * k + prefetch_distance);
      get(L + tile * k, some_L);
      sums[k] += some_L * upper_x;
      get(L + tile * k + half, some_L);
      sums[k] += some_L * lower_x;
    }
  }
  for (std::size_t k = 0; k < width; ++k)
    for (std::size_t row = 0; row < half; ++row) y[k] -= sums[k][row];
}

/// The place of row i in a strip.
constexpr std::size_t row_of(std::size_t i, std::size_t width)
{
  return i / tile * tile * width + i % tile;
}

/// y -= L x for a strip and as many right-hand sides as a Vector holds; rows are `lanes` apart.
template <class Vector, std::size_t width>
SQUEAL_INLINE void subtract_strip(const double* L, std::size_t rows, std::size_t lanes, const double* x, double* y)
{
  Vector some_x[width], some_y;
  for (std::size_t k = 0; k < width; ++k) get(x + k * lanes, some_x[k]);
  for (std::size_t i = 0; i < rows; ++i)
  {
    const double* const row = L + row_of(i, width);
    get(y + i * lanes, some_y);
    for (std::size_t k = 0; k < width; ++k) some_y -= row[tile * k] * some_x[k];
    put(some_y, y + i * lanes);
  }
}

/// y -= L' x for a strip and as many right-hand sides as a Vector holds.
template <class Vector, std::size_t width> SQUEAL_INLINE void
subtract_transposed_strip(const double* L, std::size_t rows, std::size_t lanes, const double* x, double* y)
{
  Vector sums[width] = {}, some_x, some_y;
  for (std::size_t i = 0; i < rows; ++i)
  {
    const double* const row = L + row_of(i, width);
    get(x + i * lanes, some_x);
    for (std::size_t k = 0; k < width; ++k) sums[k] += row[tile * k] * some_x;
  }
  for (std::size_t k = 0; k < width; ++k)
  {
    get(y + k * lanes, some_y);
    put(some_y - sums[k], y + k * lanes);
  }
}

/// work(strip, its first column, its width) for each strip of a panel; the width is a constant of its type.
template <class Work> SQUEAL_INLINE void for_each_strip(const Panel& L, Work work)
{
  const double* strip = L.values;
  for (std::size_t j = 0; j < L.columns; j += width_from(j, L.columns))
  {
    const std::size_t some = width_from(j, L.columns);
    with_width(some, [&](auto width) SQUEAL_INLINE_LAMBDA { work(strip + width * L.above, j, width); });
    strip += some * (L.above + padded(L.rows));
  }
}

/// y -= L x for a panel.
template <class Vector> SQUEAL_INLINE void product(const Panel& L, std::size_t lanes, const double* x, double* y)
{
  for_each_strip(L,
                 [&](const double* strip, std::size_t j, auto width) SQUEAL_INLINE_LAMBDA
                 {
                   if constexpr (std::is_same_v<Vector, double>)
                     subtract_strip<width>(strip, L.rows, x + j, y);
                   else
                     for (std::size_t lane = 0; lane < lanes; lane += taken<Vector>)
                       subtract_strip<Vector, width>(strip, L.rows, lanes, x + j * lanes + lane, y + lane);
                 });
}

/// y -= L' x for a panel.
template <class Vector> SQUEAL_INLINE void transposed(const Panel& L, std::size_t lanes, const double* x, double* y)
{
  for_each_strip(L,
                 [&](const double* strip, std::size_t j, auto width) SQUEAL_INLINE_LAMBDA
                 {
                   if constexpr (std::is_same_v<Vector, double>)
                     subtract_transposed_strip<width>(strip, L.rows, x, y + j);
                   else
                     for (std::size_t lane = 0; lane < lanes; lane += taken<Vector>)
                       subtract_transposed_strip<Vector, width>(strip, L.rows, lanes, x + lane, y + j * lanes + lane);
                 });
}

/// Solves with the tile on the diagonal of a strip `width` wide, and subtracts its product from the tile's own rows.
template <class Vector> SQUEAL_INLINE void solve_tile(const double* L, std::size_t width, std::size_t lanes, double* x)
{
  for (std::size_t lane = 0; lane < lanes; lane += taken<Vector>)
    for (std::size_t k = 0; k < width; ++k)
    {
      Vector pivot, other;
      get(x + k * lanes + lane, pivot);
      pivot *= 1 / L[(tile + 1) * k];
      put(pivot, x + k * lanes + lane);
      for (std::size_t i = k + 1; i < tile; ++i)
      {
        get(x + i * lanes + lane, other);
        put(other - L[tile * k + i] * pivot, x + i * lanes + lane);
      }
    }
}

template <class Vector>
SQUEAL_INLINE void solve_transposed_tile(const double* L, std::size_t width, std::size_t lanes, double* x)
{
  for (std::size_t lane = 0; lane < lanes; lane += taken<Vector>)
    for (std::size_t k = width; k-- > 0;)
    {
      Vector pivot, other;
      get(x + k * lanes + lane, pivot);
      for (std::size_t i = k + 1; i < tile; ++i)
      {
        get(x + i * lanes + lane, other);
        pivot -= L[tile * k + i] * other;
      }
      pivot *= 1 / L[(tile + 1) * k];
      put(pivot, x + k * lanes + lane);
    }
}

/// The panel below the diagonal tile of the strip of a triangle that begins at column j.
Panel below_tile(const double* strip, std::size_t j, std::size_t width, std::size_t columns)
{
  return {strip + tile * width, columns - std::min(columns, j + tile), width};
}

template <class Vector> SQUEAL_INLINE void solve(const double* L, std::size_t columns, std::size_t lanes, double* x)
{
  for (std::size_t j = 0; j < columns; j += width_from(j, columns))
  {
    const std::size_t width = width_from(j, columns);
    solve_tile<Vector>(L, width, lanes, x + j * lanes);
    product<Vector>(below_tile(L, j, width, columns), lanes, x + j * lanes, x + (j + tile) * lanes);
    L += width * padded(columns - j);
  }
}

template <class Vector>
SQUEAL_INLINE void solve_transposed(const double* L, std::size_t columns, std::size_t lanes, double* x)
{
  L += packed_triangle(columns);
  for (std::size_t j = columns; j > 0;)
  {
    const std::size_t width = width_before(j);
    j -= width;
    L -= width * padded(columns - j);
    transposed<Vector>(below_tile(L, j, width, columns), lanes, x + (j + tile) * lanes, x + j * lanes);
    solve_transposed_tile<Vector>(L, width, lanes, x + j * lanes);
  }
}

} // namespace

std::size_t packed_panel(std::size_t rows, std::size_t columns)
{
  return padded(rows) * columns;
}

std::size_t packed_triangle(std::size_t columns)
{
  std::size_t size = 0;
  for (std::size_t j = 0; j < columns; j += width_from(j, columns))
    size += packed_panel(columns - j, width_from(j, columns));
  return size;
}

double* pack_panel(const double* from, std::size_t height, std::size_t rows, std::size_t columns, double* to)
{
  for (std::size_t j = 0; j < columns; j += width_from(j, columns))
    for (std::size_t i = 0; i < rows; i += tile)
      for (std::size_t k = j; k < j + width_from(j, columns); ++k, to += tile)
      {
        const std::size_t count = std::min(tile, rows - i);
        std::copy_n(from + k * height + i, count, to);
        std::fill(to + count, to + tile, 0.);
      }
  return to;
}

void unpack_rows(const Panel& L, std::size_t first, double* to)
{
  const std::size_t height = L.rows - first;
  for_each_strip(L,
                 [&](const double* strip, std::size_t j, auto width)
                 {
                   for (std::size_t k = 0; k < width; ++k)
                     for (std::size_t i = first, end = 0; i < L.rows; i = end)
                     {
                       end = std::min(L.rows, i / tile * tile + tile);
                       std::copy_n(strip + row_of(i, width) + tile * k, end - i, to + (j + k) * height + i - first);
                     }
                 });
}

double* pack_triangle(const double* from, std::size_t height, std::size_t columns, double* to)
{
  for (std::size_t j = 0; j < columns; j += width_from(j, columns))
    to = pack_panel(from + j * height + j, height, columns - j, width_from(j, columns), to);
  return to;
}

SQUEAL_SIMD void subtract_product(const Panel& L, std::size_t lanes, const double* x, double* y)
{
  with_vector(lanes,
              [&](auto vector) SQUEAL_INLINE_LAMBDA { product<typename decltype(vector)::type>(L, lanes, x, y); });
}

SQUEAL_SIMD void subtract_transposed(const Panel& L, std::size_t lanes, const double* x, double* y)
{
  with_vector(lanes,
              [&](auto vector) SQUEAL_INLINE_LAMBDA { transposed<typename decltype(vector)::type>(L, lanes, x, y); });
}

SQUEAL_SIMD void solve_triangle(const double* L, std::size_t columns, std::size_t lanes, double* x)
{
  with_vector(lanes,
              [&](auto vector) SQUEAL_INLINE_LAMBDA { solve<typename decltype(vector)::type>(L, columns, lanes, x); });
}

SQUEAL_SIMD void solve_transposed_triangle(const double* L, std::size_t columns, std::size_t lanes, double* x)
{
  with_vector(lanes, [&](auto vector) SQUEAL_INLINE_LAMBDA
              { solve_transposed<typename decltype(vector)::type>(L, columns, lanes, x); });
}

} // namespace squeal
