#pragma once
/// Products with a panel of a factor, rows x columns, stored by columns `height` apart. Vectors are
/// `lanes` numbers wide, as `lanes_for` gives them: those of several right-hand sides side by side.
#include <cstddef>

namespace squeal
{

/// For so many right-hand sides: 1, 4 or a multiple of 8.
constexpr std::size_t lanes_for(std::size_t columns)
{
  return columns == 1 ? 1 : columns <= 4 ? 4 : (columns + 7) / 8 * 8;
}

struct Panel
{
  const double* values;
  std::size_t height, rows, columns;
};

/// y -= L x
void subtract_product(const Panel& L, std::size_t lanes, const double* x, double* y);

/// y -= L' x
void subtract_transposed(const Panel& L, std::size_t lanes, const double* x, double* y);

/// y = W x for the lower triangle of a symmetric W, by columns, read once.
void symmetric_product(const double* W, std::size_t size, const double* x, double* y);

} // namespace squeal
