/// Products with dense matrices for several right-hand sides.
#include "registers.hpp"
#include "squeal/algebra/panel.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

/// Adds the products with eight columns of W and, transposed, with their part below the diagonal block.
SQUEAL_INLINE void add_columns(const double* W, std::size_t size, std::size_t j, const double* __restrict x,
                               double* __restrict y)
{
  const double* const first = W + j * size;
  for (std::size_t k = 0; k < tile; ++k)
    for (std::size_t i = j; i < j + tile; ++i)
      y[j + k] += first[std::min(k, i - j) * size + j + std::max(k, i - j)] * x[i];
  constexpr std::size_t some = taken<Four>;
  Four sums[tile] = {}, some_W, some_x, some_y;
  std::size_t i = j + tile;
  for (; i + some <= size; i += some)
  {
    get(x + i, some_x);
    get(y + i, some_y);
    for (std::size_t k = 0; k < tile; ++k)
    {
      get(first + k * size + i, some_W);
      some_y += some_W * x[j + k];
      sums[k] += some_W * some_x;
    }
    put(some_y, y + i);
  }
  for (std::size_t k = 0; k < tile; ++k)
  {
    for (std::size_t part = 0; part < some; ++part) y[j + k] += sums[k][part];
    for (std::size_t row = i; row < size; ++row)
    {
      y[row] += first[k * size + row] * x[j + k];
      y[j + k] += first[k * size + row] * x[row];
    }
  }
}

/// y = W x for a few rows, `some`, of a row-major matrix.
template <class Vector, std::size_t some>
SQUEAL_INLINE void multiply_rows(const double* W, std::size_t columns, std::size_t lanes, const double* x, double* y)
{
  for (std::size_t lane = 0; lane < lanes; lane += taken<Vector>)
  {
    Vector sums[some] = {}, some_x;
    for (std::size_t j = 0; j < columns; ++j)
    {
      get(x + j * lanes + lane, some_x);
      for (std::size_t row = 0; row < some; ++row) sums[row] += W[row * columns + j] * some_x;
    }
    for (std::size_t row = 0; row < some; ++row) put(sums[row], y + row * lanes + lane);
  }
}

template <class Vector> SQUEAL_INLINE void multiply(const double* W, std::size_t rows, std::size_t columns,
                                                    std::size_t lanes, const double* x, double* y)
{
  std::size_t i = 0;
  for (; i + tile <= rows; i += tile) multiply_rows<Vector, tile>(W + i * columns, columns, lanes, x, y + i * lanes);
  for (; i < rows; ++i) multiply_rows<Vector, 1>(W + i * columns, columns, lanes, x, y + i * lanes);
}

} // namespace

SQUEAL_SIMD void dense_product(const double* W, std::size_t rows, std::size_t columns, std::size_t lanes,
                               const double* x, double* y)
{
  with_vector(lanes, [&](auto vector) SQUEAL_INLINE_LAMBDA
              { multiply<typename decltype(vector)::type>(W, rows, columns, lanes, x, y); });
}

SQUEAL_SIMD void add_symmetric_product(const double* W, std::size_t size, std::size_t columns, const double* x,
                                       double* y)
{
  std::size_t j = 0;
  for (; j + tile <= columns; j += tile) add_columns(W, size, j, x, y);
  for (; j < columns; ++j)
  {
    const double* const column = W + j * size;
    y[j] += column[j] * x[j];
    for (std::size_t i = j + 1; i < size; ++i)
    {
      y[i] += column[i] * x[j];
      y[j] += column[i] * x[i];
    }
  }
}

} // namespace squeal
