#include "panel.hpp"

#include "wide.hpp"

#include <algorithm>
#include <cstring>

namespace squeal
{

namespace
{

using Four = double __attribute__((vector_size(32)));

SQUEAL_INLINE void get(const double* from, Four& to)
{
  std::memcpy(&to, from, sizeof to);
}

SQUEAL_INLINE void put(const Four& value, double* to)
{
  std::memcpy(to, &value, sizeof value);
}

SQUEAL_INLINE void product_of_one(const Panel& L, const double* __restrict x, double* __restrict y)
{
  std::size_t j = 0;
  for (; j + 4 <= L.columns; j += 4)
  {
    const double *a = L.values + j * L.height, *b = a + L.height, *c = b + L.height, *d = c + L.height;
    const double p = x[j], q = x[j + 1], r = x[j + 2], s = x[j + 3];
    for (std::size_t i = 0; i < L.rows; ++i) y[i] -= p * a[i] + q * b[i] + r * c[i] + s * d[i];
  }
  for (; j < L.columns; ++j)
    for (std::size_t i = 0; i < L.rows; ++i) y[i] -= x[j] * L.values[j * L.height + i];
}

/// y[k] -= L_k'x, one after the other in four sums, which the compiler may not form by itself.
template <std::size_t columns>
SQUEAL_INLINE void subtract_dots(const Panel& L, std::size_t j, const double* x, double* y)
{
  const double* const first = L.values + j * L.height;
  Four sums[columns] = {}, some_L, some_x;
  std::size_t i = 0;
  for (; i + 4 <= L.rows; i += 4)
  {
    get(x + i, some_x);
    for (std::size_t k = 0; k < columns; ++k)
    {
      get(first + k * L.height + i, some_L);
      sums[k] += some_L * some_x;
    }
  }
  for (std::size_t k = 0; k < columns; ++k)
  {
    double sum = sums[k][0] + sums[k][1] + sums[k][2] + sums[k][3];
    for (std::size_t row = i; row < L.rows; ++row) sum += first[k * L.height + row] * x[row];
    y[j + k] -= sum;
  }
}

SQUEAL_INLINE void transposed_of_one(const Panel& L, const double* __restrict x, double* __restrict y)
{
  std::size_t j = 0;
  for (; j + 4 <= L.columns; j += 4) subtract_dots<4>(L, j, x, y);
  for (; j < L.columns; ++j) subtract_dots<1>(L, j, x, y);
}

constexpr std::size_t strip = 4, block = 64; // rows and columns of what is gathered at a time

/// Rows [i, i + rows) of `count` columns from j on, those of a column side by side; zeros up to a whole strip.
SQUEAL_INLINE void gather(const Panel& L, std::size_t i, std::size_t rows, std::size_t j, std::size_t count, double* to)
{
  const double* from = L.values + j * L.height + i;
  for (std::size_t k = 0; k < count; ++k)
    if (rows == strip)
      std::memcpy(to + strip * k, from + k * L.height, strip * sizeof(double));
    else
      for (std::size_t row = 0; row < strip; ++row) to[strip * k + row] = row < rows ? from[k * L.height + row] : 0.;
}

/// `fours`: how many times four numbers are taken at once of a vector's width.
template <std::size_t fours>
SQUEAL_INLINE void product_of_many(const Panel& L, std::size_t lanes, const double* __restrict x, double* __restrict y)
{
  double some_L[strip * block];
  for (std::size_t j = 0; j < L.columns; j += block)
  {
    const std::size_t count = std::min(block, L.columns - j);
    for (std::size_t i = 0; i < L.rows; i += strip)
    {
      const std::size_t rows = std::min(strip, L.rows - i);
      gather(L, i, rows, j, count, some_L);
      for (std::size_t lane = 0; lane < lanes; lane += 4 * fours)
      {
        Four sums[strip][fours] = {}, some_x[fours], some_y;
        for (std::size_t k = 0; k < count; ++k)
        {
          for (std::size_t f = 0; f < fours; ++f) get(x + (j + k) * lanes + lane + 4 * f, some_x[f]);
          for (std::size_t row = 0; row < strip; ++row)
            for (std::size_t f = 0; f < fours; ++f) sums[row][f] += some_L[strip * k + row] * some_x[f];
        }
        for (std::size_t row = 0; row < rows; ++row)
          for (std::size_t f = 0; f < fours; ++f)
          {
            double* const target = y + (i + row) * lanes + lane + 4 * f;
            get(target, some_y);
            put(some_y - sums[row][f], target);
          }
      }
    }
  }
}

template <std::size_t fours> SQUEAL_INLINE void transposed_of_many(const Panel& L, std::size_t lanes,
                                                                   const double* __restrict x, double* __restrict y)
{
  double some_L[strip * block];
  for (std::size_t j = 0; j < L.columns; j += block)
  {
    const std::size_t count = std::min(block, L.columns - j);
    for (std::size_t i = 0; i < L.rows; i += strip)
    {
      const std::size_t rows = std::min(strip, L.rows - i);
      gather(L, i, rows, j, count, some_L);
      for (std::size_t lane = 0; lane < lanes; lane += 4 * fours)
      {
        Four some_x[strip][fours] = {}, some_y[fours];
        for (std::size_t row = 0; row < rows; ++row)
          for (std::size_t f = 0; f < fours; ++f) get(x + (i + row) * lanes + lane + 4 * f, some_x[row][f]);
        for (std::size_t k = 0; k < count; ++k)
        {
          double* const target = y + (j + k) * lanes + lane;
          for (std::size_t f = 0; f < fours; ++f) get(target + 4 * f, some_y[f]);
          for (std::size_t row = 0; row < strip; ++row)
            for (std::size_t f = 0; f < fours; ++f) some_y[f] -= some_L[strip * k + row] * some_x[row][f];
          for (std::size_t f = 0; f < fours; ++f) put(some_y[f], target + 4 * f);
        }
      }
    }
  }
}

/// Four columns of W: the part of them below their diagonal block acts as it stands and transposed.
SQUEAL_INLINE void add_columns(const double* W, std::size_t size, std::size_t j, const double* __restrict x,
                               double* __restrict y)
{
  const double* const first = W + j * size;
  for (std::size_t k = 0; k < 4; ++k)
    for (std::size_t i = j; i < j + 4; ++i)
      y[j + k] += first[std::min(k, i - j) * size + j + std::max(k, i - j)] * x[i];
  Four sums[4] = {}, some_W, some_x, some_y;
  std::size_t i = j + 4;
  for (; i + 4 <= size; i += 4)
  {
    get(x + i, some_x);
    get(y + i, some_y);
    for (std::size_t k = 0; k < 4; ++k)
    {
      get(first + k * size + i, some_W);
      some_y += some_W * x[j + k];
      sums[k] += some_W * some_x;
    }
    put(some_y, y + i);
  }
  for (std::size_t k = 0; k < 4; ++k)
  {
    y[j + k] += sums[k][0] + sums[k][1] + sums[k][2] + sums[k][3];
    for (std::size_t row = i; row < size; ++row)
    {
      y[row] += first[k * size + row] * x[j + k];
      y[j + k] += first[k * size + row] * x[row];
    }
  }
}

} // namespace

SQUEAL_WIDE void symmetric_product(const double* W, std::size_t size, const double* x, double* y)
{
  std::fill_n(y, size, 0.);
  std::size_t j = 0;
  for (; j + 4 <= size; j += 4) add_columns(W, size, j, x, y);
  for (std::size_t k = j; k < size; ++k)
    for (std::size_t i = j; i < size; ++i) y[k] += W[std::min(i, k) * size + std::max(i, k)] * x[i];
}

SQUEAL_WIDE void subtract_product(const Panel& L, std::size_t lanes, const double* x, double* y)
{
  lanes == 1   ? product_of_one(L, x, y)
  : lanes == 4 ? product_of_many<1>(L, lanes, x, y)
               : product_of_many<2>(L, lanes, x, y);
}

SQUEAL_WIDE void subtract_transposed(const Panel& L, std::size_t lanes, const double* x, double* y)
{
  lanes == 1   ? transposed_of_one(L, x, y)
  : lanes == 4 ? transposed_of_many<1>(L, lanes, x, y)
               : transposed_of_many<2>(L, lanes, x, y);
}

} // namespace squeal
