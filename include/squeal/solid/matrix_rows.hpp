#pragma once
/// Rows of a matrix scene: which motions of which nodes they are, and what the scene adds to the matrices of the files:
/// damping, forces, probes, supports.
#include "squeal/solid/structure.hpp"

namespace squeal
{

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
