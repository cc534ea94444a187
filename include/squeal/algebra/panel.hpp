#pragma once
/// Products with the panels of a factor and solves with their triangles, packed so that each is read as one stream:
/// strips of eight columns (four, two, one where fewer are left), each from its first row on in tiles of eight rows,
/// the last one filled up with zeros; the columns of a tile one after the other. A strip of a triangle begins at its
/// own diagonal. Vectors are `lanes` numbers wide, as `lanes_for` gives them: those of several right-hand sides side by
/// side; as many rows as fill the last tile must be there to be read and, with their values kept, written.
#include <cstddef>

namespace squeal
{

constexpr std::size_t tile = 8; // rows

/// For so many right-hand sides: 1, 4 or a multiple of 8.
constexpr std::size_t lanes_for(std::size_t columns)
{
  return columns == 1 ? 1 : columns <= 4 ? 4 : (columns + 7) / 8 * 8;
}

/// Packed, of rows x columns.
struct Panel
{
  const double* values;
  std::size_t rows, columns;
};

std::size_t packed_panel(std::size_t rows, std::size_t columns);
std::size_t packed_triangle(std::size_t columns);

/// From a matrix stored by columns `height` apart; each returns where the next one goes.
double* pack_panel(const double* from, std::size_t height, std::size_t rows, std::size_t columns, double* to);
double* pack_triangle(const double* from, std::size_t height, std::size_t columns, double* to);

/// y -= L x
void subtract_product(const Panel& L, std::size_t lanes, const double* x, double* y);

/// y -= L' x
void subtract_transposed(const Panel& L, std::size_t lanes, const double* x, double* y);

/// x = L^-1 x for a packed triangle of `columns`.
void solve_triangle(const double* L, std::size_t columns, std::size_t lanes, double* x);

/// x = L^-T x
void solve_transposed_triangle(const double* L, std::size_t columns, std::size_t lanes, double* x);

/// y = W x for the lower triangle of a symmetric W, by columns, read once.
void symmetric_product(const double* W, std::size_t size, const double* x, double* y);

/// y = W x for a W stored by rows, of several `lanes`.
void dense_product(const double* W, std::size_t size, std::size_t lanes, const double* x, double* y);

} // namespace squeal
