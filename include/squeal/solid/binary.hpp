#pragma once
/// PETSc binary files (big-endian): a matrix is {1211216, rows, columns, entries, entries of each row, columns,
/// values}, a vector {1211214, length, values}. A damaged file would leave PETSc's readers with one message a rank, or
/// none, so rank 0 checks the whole of it first. All collective; an Error names the file and is thrown by every rank.
#include "squeal/base/petsc.hpp"

#include <filesystem>
#include <vector>

namespace squeal
{

struct MatrixSize
{
  PetscInt rows = 0, columns = 0;
};

/// Checks length, kind, row counts and columns (ascending and in range) of a matrix file.
MatrixSize check_matrix_file(const std::filesystem::path& file, MPI_Comm comm);

/// AIJ matrix of a file that was checked; local sizes may be PETSC_DECIDE. Error: entries that are not finite.
Owned<Mat> load_matrix(const std::filesystem::path& file, MatrixSize size, MatrixSize local, MPI_Comm comm);

/// A vector file, whole on every rank.
std::vector<double> read_vector(const std::filesystem::path& file, MPI_Comm comm);

} // namespace squeal
