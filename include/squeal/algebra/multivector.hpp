#pragma once
/// A few distributed vectors side by side: matrices are read once for all of them, and products are dense kernels.
/// Every function is collective; small matrices are column-major and whole on every rank.
#include "squeal/base/petsc.hpp"

namespace squeal
{

struct Block
{
  MPI_Comm comm = MPI_COMM_NULL;
  PetscInt rows = 0, columns = 0; // of this rank
  std::vector<double> entries;    // column-major

  double* column(PetscInt j) { return entries.data() + static_cast<std::ptrdiff_t>(j) * rows; }
  const double* column(PetscInt j) const { return entries.data() + static_cast<std::ptrdiff_t>(j) * rows; }
};

/// No columns yet, rows as the columns of A are distributed.
Block empty_block(Mat A);

/// `columns` vectors to start from, orthogonal to nothing in particular, the same for any number of ranks.
Block uneven_block(Mat A, PetscInt columns);

void append(Block& X, Vec x);
void append(Block& X, const Block& Y);
void copy_column(const Block& X, PetscInt j, Vec x);

/// A X
Block product(Mat A, const Block& X);

/// X'Y
std::vector<double> inner(const Block& X, const Block& Y);

/// X a, `columns` wide
Block combination(const Block& X, const std::vector<double>& a, PetscInt columns);

/// Y += alpha X a
void add_combination(Block& Y, double alpha, const Block& X, const std::vector<double>& a);

Block columns_from(const Block& X, PetscInt first);

/// 2-norms of the columns
std::vector<double> column_norms(const Block& X);

/// X spans the same with X'X = I; directions below `least` of the largest eigenvalue of X'X are dropped.
void orthonormalise(Block& X, double least);

/// X appended to the orthonormal V as orthonormal columns; what V holds already (up to 1e-12 of a column) is dropped.
/// Returns how many columns V gained.
PetscInt extend_orthonormal(Block& V, Block X);

} // namespace squeal
