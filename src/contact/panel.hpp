#pragma once
/// Products with a panel of a factor, rows x columns, stored by columns `height` apart. Vectors are
/// `lanes` numbers wide, 1 or a multiple of `wide`: those of several right-hand sides side by side.
#include <cstddef>

namespace squeal
{

constexpr std::size_t wide = 8;

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
