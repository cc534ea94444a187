#pragma once
/// PETSc binary files, big-endian. A matrix is {1211216, rows, columns, entries, entries of each row, columns, values},
/// a vector {1211214, length, values}.
/// PETSc's readers fail on a damaged file with one message a rank, or none. Rank 0 therefore checks the whole file
/// first. All functions are collective; an Error names the file and is thrown by every rank.
#include "squeal/base/petsc.hpp"
#include "squeal/solid/structure.hpp"

#include <filesystem>
#include <vector>

namespace squeal
{

/// Rows and columns, of a whole matrix or of this rank.
struct MatrixSize
{
  PetscInt rows = 0, columns = 0;
};

/// Whether rank 0 has the file.
bool is_there(const std::filesystem::path& file, MPI_Comm comm);

/// Returns the size of the matrix in a file. Throws Error if its length, kind, row counts or columns are wrong.
MatrixSize check_matrix_file(const std::filesystem::path& file, MPI_Comm comm);

/// Returns the AIJ matrix in a file that was checked; local sizes may be PETSC_DECIDE.
/// Throws Error if an entry is not finite.
Owned<Mat> load_matrix(const std::filesystem::path& file, MatrixSize size, MatrixSize local, MPI_Comm comm);

/// Returns all entries of a vector file on every rank. Throws Error as above.
std::vector<double> read_vector(const std::filesystem::path& file, MPI_Comm comm);

/// Returns the vectors that a file holds, one after the other. Throws Error as above. Not collective, nor is the next.
std::vector<std::vector<double>> read_vectors(const std::filesystem::path& file);

/// Appends a vector with its header.
void append_vector(const std::vector<double>& entries, std::string& bytes);

// Rows of a matrix scene: which motions of which nodes they are. The scene adds damping, forces, probes and supports to
// the matrices of the files.

/// The rows of the files of a matrix scene, the same on every rank.
struct MatrixRows
{
  PetscInt size = 0;
  std::vector<NodeMotion> motions; // of each row, by dofs.txt; empty without this file
};

/// Returns the rows of the matrices in a folder. `dofs.txt` beside them has a line "node motion" for each row, such as
/// "1017 rx". A row that is no motion of a node, such as a modal coordinate, has "-" for the motion. Collective.
/// Throws Error with the line that is wrong.
MatrixRows read_matrix_rows(const std::filesystem::path& folder, PetscInt size, MPI_Comm comm);

/// Adds the forces of a scene to the load. Throws Error for a row, node or motion that the matrices do not have.
/// Collective: all ranks hold the rows, so that all throw.
void add_forces(const MatrixRows& rows, const std::vector<Force>& forces, Vec load);

/// Returns the rows that the supports of a scene hold, ascending. Throws Error as above. Not collective.
std::vector<PetscInt> held_rows(const MatrixRows& rows, const std::vector<Support>& supports);

/// Returns the matrix with a row for each probe, on the columns of the files. Throws Error as above. Collective.
Owned<Mat> probe_rows(const std::vector<Probe>& probes, const MatrixRows& rows, PetscInt local_columns, MPI_Comm comm);

/// Takes held rows and columns out of a matrix, or columns alone, and held entries out of a vector. Each keeps its
/// layout otherwise; of no matrix it makes none. Collective.
class Elimination
{
public:
  /// `layout` is a vector over the rows of the files.
  Elimination(const std::vector<PetscInt>& held, Vec layout);

  Owned<Mat> square(Mat A) const;
  Owned<Mat> columns(Mat A) const;
  Owned<Vec> entries(Vec x) const;

private:
  Owned<IS> kept_; // this rank's rows that are free
};

/// Says in the structure's names which row of the files each free degree of freedom is. Not collective.
void name_rows(const MatrixRows& rows, const std::vector<PetscInt>& held, DofNames& names);

} // namespace squeal
