/// Structures given as matrices: M C K G H F of a folder, in PETSc's binary format.
#include "squeal/solid/structure.hpp"

#include "squeal/algebra/shift_invert.hpp"
#include "squeal/solid/binary.hpp"

#include <cmath>

namespace squeal
{

namespace
{

/// Largest |A_ij - A_ji| over the largest entry. Exported matrices have the round-off of the program that wrote them; a
/// genuine error is orders of magnitude larger.
constexpr double symmetry_tolerance = 1e-9;

struct Entry
{
  double magnitude = -1;
  PetscInt row = 0, column = 0;
};

/// Returns the largest entry of this rank's rows.
Entry largest_entry(Mat A)
{
  Entry largest;
  for_each_row(A,
               [&](PetscInt row, std::span<const PetscInt> columns, std::span<const PetscScalar> values)
               {
                 for (std::size_t k = 0; k < columns.size(); ++k)
                   if (std::abs(values[k]) > largest.magnitude) largest = {std::abs(values[k]), row, columns[k]};
               });
  return largest;
}

double maximum(double local, MPI_Comm comm)
{
  double largest = 0;
  MPI_Allreduce(&local, &largest, 1, MPI_DOUBLE, MPI_MAX, comm);
  return largest;
}

/// Returns (A + sign A')/2: the symmetric or the skew part.
Owned<Mat> part_of(Mat A, double sign)
{
  Owned<Mat> result = transpose_of(A);
  check(MatAYPX(result, sign, A, DIFFERENT_NONZERO_PATTERN));
  check(MatScale(result, 0.5));
  return result;
}

/// Returns what is wrong with an A whose part of this sign should vanish; empty if it does.
std::string nonzero_part(Mat A, double sign, const std::filesystem::path& file, MPI_Comm comm)
{
  const Entry worst = largest_entry(part_of(A, sign));
  const double scale = maximum(largest_entry(A).magnitude, comm);
  const double overall = maximum(worst.magnitude, comm);
  if (overall <= symmetry_tolerance * scale || worst.magnitude != overall) return {};
  const std::string i = std::to_string(worst.row), j = std::to_string(worst.column);
  return file.string() + (sign < 0 ? ": not symmetric" : ": not skew") + ": entries (" + i + ", " + j + ") and (" + j +
         ", " + i + ") " + (sign < 0 ? "differ by " : "add up to ") +
         format("%g, the largest entry is %g", 2 * worst.magnitude, scale);
}

/// Returns A with the pattern of `pattern`, whose entries are zero.
Owned<Mat> with_pattern(Mat pattern, Mat A)
{
  Owned<Mat> result = copy_of(pattern);
  check(MatAXPY(result, 1, A, SUBSET_NONZERO_PATTERN));
  mark_symmetric(result);
  return result;
}

/// Loads a square matrix of any symmetry. `size` is the expected size, or receives it if negative.
Owned<Mat> load_any_square(const std::filesystem::path& file, PetscInt& size, MPI_Comm comm)
{
  const auto found = check_matrix_file(file, comm);
  std::string problem;
  const auto shape = std::to_string(found.rows) + " x " + std::to_string(found.columns);
  if (found.rows != found.columns) problem = file.string() + ": " + shape + ", must be square";
  if (problem.empty() && size >= 0 && found.rows != size)
    problem = file.string() + ": " + shape + ", but M.petsc beside it is " + std::to_string(size) + " x " +
              std::to_string(size);
  agree(comm, problem);
  size = found.rows;
  return load_matrix(file, found, {PETSC_DECIDE, PETSC_DECIDE}, comm);
}

/// Returns a matrix of zeros with the pattern of another.
Owned<Mat> zero_of(Mat pattern)
{
  Owned<Mat> zero;
  check(MatDuplicate(pattern, MAT_DO_NOT_COPY_VALUES, zero.put()));
  return zero;
}

/// Loads the symmetric part of a matrix; the skew part, if there is one, goes to `skew`. Throws Error where it may have
/// none, which null says.
Owned<Mat> load_symmetric(const std::filesystem::path& file, PetscInt& size, Owned<Mat>* skew, MPI_Comm comm)
{
  auto A = load_any_square(file, size, comm);
  const std::string unsymmetric = nonzero_part(A, -1, file, comm);
  if (!skew) agree(comm, unsymmetric);
  int found = unsymmetric.empty() ? 0 : 1;
  MPI_Allreduce(MPI_IN_PLACE, &found, 1, MPI_INT, MPI_MAX, comm);
  if (found == 0) return A;
  *skew = part_of(A, -1);
  return part_of(A, 1);
}

/// Adds the skew matrix of a file, if it is there.
void add_skew(const std::filesystem::path& file, PetscInt size, Owned<Mat>& skew, MPI_Comm comm)
{
  if (!is_there(file, comm)) return;
  auto A = load_any_square(file, size, comm);
  std::string problem = nonzero_part(A, 1, file, comm);
  if (!problem.empty()) problem += "; its symmetric part belongs into C.petsc or K.petsc";
  agree(comm, problem);
  if (skew.get())
    check(MatAXPY(skew, 1, A, DIFFERENT_NONZERO_PATTERN));
  else
    skew = std::move(A);
}

/// Throws Error if M has a negative eigenvalue. They are counted for D^-1 M, D the diagonal of M, so that units of
/// rotations do not matter. Rounding of an exported M moves them by about symmetry_tolerance.
void check_mass(Mat M, const std::filesystem::path& file, MPI_Comm comm)
{
  const Owned<Mat> D = zero_of(M);
  const Owned<Vec> diagonal = vector_of_rows(M);
  PetscReal largest = 0;
  check(MatGetDiagonal(M, diagonal));
  check(VecAbs(diagonal));
  check(VecMax(diagonal, nullptr, &largest));
  if (largest == 0) largest = 1;
  PetscScalar* entries = nullptr;
  check(VecGetArray(diagonal, &entries));
  for (PetscInt i = 0; i < own_rows(M).size(); ++i)
    if (entries[i] == 0) entries[i] = largest; // a motion without mass
  check(VecRestoreArray(diagonal, &entries));
  check(MatDiagonalSet(D, diagonal, INSERT_VALUES));
  PencilFactor factor(M, D, Keep::factor, {});
  if (factor.factorise(-10 * symmetry_tolerance) && factor.negative_pivots() > 0)
    agree(comm, file.string() + format(": %d of its eigenvalues are negative, so some motion would have a negative "
                                       "kinetic energy; a mass matrix has none below zero",
                                       factor.negative_pivots()));
}

/// Gives M, C and K the union of their patterns with the whole diagonal, and marks them as symmetric.
/// A sum M + a C + b K then needs additions of values only.
void share_pattern(Structure& structure)
{
  Owned<Mat> pattern = copy_of(structure.M);
  check(MatAXPY(pattern, 1, structure.C, DIFFERENT_NONZERO_PATTERN));
  check(MatAXPY(pattern, 1, structure.K, DIFFERENT_NONZERO_PATTERN));
  check(MatShift(pattern, 1)); // adds the diagonal entries that are missing
  check(MatZeroEntries(pattern));
  structure.M = with_pattern(pattern, structure.M);
  structure.C = with_pattern(pattern, structure.C);
  structure.K = with_pattern(pattern, structure.K);
}

} // namespace

void mark_symmetric(Mat A)
{
  check(MatSetOption(A, MAT_SYMMETRIC, PETSC_TRUE));
  check(MatSetOption(A, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  check(MatSetOption(A, MAT_NEW_NONZERO_LOCATION_ERR, PETSC_TRUE));
}

Structure read_structure(const std::filesystem::path& folder, MPI_Comm comm)
{
  Structure structure;
  PetscInt size = -1;
  structure.M = load_symmetric(folder / "M.petsc", size, nullptr, comm);
  const bool has_pairs = is_there(folder / "B.petsc", comm);
  structure.K = load_symmetric(folder / "K.petsc", size, has_pairs ? nullptr : &structure.H, comm);
  structure.C = is_there(folder / "C.petsc", comm)
                    ? load_symmetric(folder / "C.petsc", size, has_pairs ? nullptr : &structure.G, comm)
                    : zero_of(structure.M);
  add_skew(folder / "G.petsc", size, structure.G, comm);
  add_skew(folder / "H.petsc", size, structure.H, comm);
  share_pattern(structure);
  check_mass(structure.M, folder / "M.petsc", comm);
  structure.load = vector_of_rows(structure.K);
  if (!is_there(folder / "F.petsc", comm))
  {
    check(VecSet(structure.load, 0));
    return structure;
  }
  const auto force = read_vector(folder / "F.petsc", comm);
  if (static_cast<PetscInt>(force.size()) != size)
    throw Error((folder / "F.petsc").string() + ": length " + std::to_string(force.size()) + ", but M.petsc is " +
                std::to_string(size) + " x " + std::to_string(size));
  set_all_entries(structure.load, force);
  return structure;
}

} // namespace squeal
