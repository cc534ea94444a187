#pragma once
/// PETSc binary files, big-endian. A matrix is {1211216, rows, columns, entries, entries of each row, columns, values},
/// a vector {1211214, length, values}.
/// PETSc's readers fail on a damaged file with one message a rank, or none. Rank 0 therefore checks the whole file
/// first. All functions are collective; an Error names the file and is thrown by every rank.
#include "squeal/base/petsc.hpp"

#include <filesystem>
#include <iosfwd>
#include <optional>
#include <vector>

namespace squeal
{

/// Rows and columns, of a whole matrix or of this rank.
struct MatrixSize
{
  PetscInt rows = 0, columns = 0;
};

/// Returns the size of the matrix in a file. Throws Error if its length, kind, row counts or columns are wrong.
MatrixSize check_matrix_file(const std::filesystem::path& file, MPI_Comm comm);

/// Returns the AIJ matrix in a file that was checked; local sizes may be PETSC_DECIDE.
/// Throws Error if an entry is not finite.
Owned<Mat> load_matrix(const std::filesystem::path& file, MatrixSize size, MatrixSize local, MPI_Comm comm);

/// Returns all entries of a vector file on every rank. Throws Error as above.
std::vector<double> read_vector(const std::filesystem::path& file, MPI_Comm comm);

/// Size [byte] of the header of a vector: its class id and its length, which PETSc writes as two PetscInt.
inline constexpr std::size_t vector_header_size = 2 * sizeof(PetscInt);

/// Reads the header of a vector. Returns its length; none if there is no such header. Not collective, nor are the two
/// below.
std::optional<PetscInt> read_vector_header(std::istream& stream);

/// Reads the entries behind a header.
std::vector<double> read_vector_entries(std::istream& stream, PetscInt length);

/// Appends a vector with its header.
void append_vector(const std::vector<double>& entries, std::string& bytes);

} // namespace squeal
