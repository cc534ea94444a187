#pragma once
/// Products with the panels of a factor and solves with its triangles. Both are packed so that each is read as one
/// stream.
///
/// A panel is cut into strips of eight columns, the last ones of four, two and one. A strip is cut into tiles of eight
/// rows, the last one filled up with zeros; a tile is stored column by column. A triangle is packed in the same way,
/// each strip from its own diagonal on. A vector holds `lanes` numbers in each row, one for each right-hand side
/// (lanes_for says how many). Its rows fill the last tile; those beyond the matrix are read and written unchanged. All
/// functions are arithmetic of one rank. They check no sizes.
#include <cstddef>

namespace squeal
{

constexpr std::size_t tile = 8; // rows

/// The lanes for that many right-hand sides: 1, 4 or a multiple of 8.
constexpr std::size_t lanes_for(std::size_t columns)
{
  return columns == 1 ? 1 : columns <= 4 ? 4 : (columns + 7) / 8 * 8;
}

/// A packed matrix of rows x columns: all of what was packed, or its last rows.
struct Panel
{
  const double* values;
  std::size_t rows, columns;
  std::size_t above = 0; // rows of every strip that are left out, whole tiles
};

/// The numbers that a packed panel and a packed triangle take. Both arguments count numbers, not bytes.
std::size_t packed_panel(std::size_t rows, std::size_t columns);
std::size_t packed_triangle(std::size_t columns);

/// Pack part of a column-major matrix with `height` rows; each returns the end of what it wrote.
double* pack_panel(const double* from, std::size_t height, std::size_t rows, std::size_t columns, double* to);
double* pack_triangle(const double* from, std::size_t height, std::size_t columns, double* to);

/// Writes the rows of a panel from `first` on by columns, rows - first apart.
void unpack_rows(const Panel& L, std::size_t first, double* to);

/// y -= L x
void subtract_product(const Panel& L, std::size_t lanes, const double* x, double* y);

/// y -= L' x
void subtract_transposed(const Panel& L, std::size_t lanes, const double* x, double* y);

/// x = L^-1 x for a packed triangle with `columns` columns.
void solve_triangle(const double* L, std::size_t columns, std::size_t lanes, double* x);

/// x = L^-T x
void solve_transposed_triangle(const double* L, std::size_t columns, std::size_t lanes, double* x);

/// y += the part that the first `columns` of a symmetric W have in W x. W is stored by columns, of which the lower
/// triangle is read once.
void add_symmetric_product(const double* W, std::size_t size, std::size_t columns, const double* x, double* y);

} // namespace squeal
