/// Checks of PETSc binary files on rank 0, and their collective reading.
#include "squeal/solid/binary.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/solid/structure.hpp"

#include <algorithm>
#include <array>
#include <boost/endian/conversion.hpp>
#include <cmath>
#include <cstdint>
#include <fstream>

namespace squeal
{

namespace
{

/// An index in a file: PETSc writes PetscInt, so that builds with 32- and 64-bit indices have different files.
using FileIndex = std::conditional_t<sizeof(PetscInt) == 8, std::int64_t, std::int32_t>;

template <class Number> std::vector<Number> read_big_endian(std::istream& stream, std::int64_t count)
{
  std::vector<Number> values(static_cast<std::size_t>(count));
  auto* bytes = reinterpret_cast<char*>(values.data());
  stream.read(bytes, static_cast<std::streamsize>(values.size() * sizeof(Number)));
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = boost::endian::endian_load<Number, sizeof(Number), boost::endian::order::big>(
        reinterpret_cast<const unsigned char*>(bytes) + i * sizeof(Number));
  return values;
}

template <class Number> void append_big_endian(Number number, std::string& bytes)
{
  std::array<unsigned char, sizeof number> ordered{};
  boost::endian::endian_store<Number, sizeof(Number), boost::endian::order::big>(ordered.data(), number);
  bytes.append(ordered.begin(), ordered.end());
}

/// Opens a file. Throws Error if it is missing or unreadable.
std::ifstream open_file(const std::filesystem::path& file)
{
  if (!is_file(file)) throw Error(file.string() + ": no such file");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw Error(file.string() + ": cannot be read");
  return stream;
}

/// Returns the first `count` indices after the class id. Throws Error if the file is of another kind or truncated.
std::vector<FileIndex> read_header(std::istream& stream, const std::filesystem::path& file, FileIndex class_id,
                                   const std::string& kind, std::int64_t count)
{
  const auto id = read_big_endian<FileIndex>(stream, 1);
  if (!stream || id[0] != class_id)
    throw Error(file.string() + ": not a " + kind + " in PETSc's binary format with " +
                std::to_string(8 * sizeof(FileIndex)) + "-bit indices; tools/matrices writes one");
  auto header = read_big_endian<FileIndex>(stream, count);
  if (!stream) throw Error(file.string() + ": truncated within its header");
  return header;
}

/// Throws Error if the file's length [bytes] is not what its header announces.
void check_length(const std::filesystem::path& file, std::int64_t expected)
{
  const auto found = static_cast<std::int64_t>(std::filesystem::file_size(file));
  if (found == expected) return;
  throw Error(file.string() + ": " + (found < expected ? "truncated: " : "too long: ") + std::to_string(found) +
              " bytes where its header announces " + std::to_string(expected) + " (real double precision)");
}

/// Throws Error if the columns of a row do not ascend or are out of range.
void check_columns(std::istream& stream, const std::filesystem::path& file, const std::vector<FileIndex>& counts,
                   FileIndex columns)
{
  for (std::size_t row = 0; row < counts.size(); ++row)
  {
    const auto column = read_big_endian<FileIndex>(stream, counts[row]);
    FileIndex previous = -1;
    for (const FileIndex j : column)
    {
      if (j <= previous || j >= columns)
        throw Error(file.string() + ": row " + std::to_string(row) + " has column " + std::to_string(j) + " after " +
                    std::to_string(previous) + " of " + std::to_string(columns) +
                    "; columns must ascend and be those of the matrix");
      previous = j;
    }
  }
}

/// Returns the size of a matrix after all checks of its file.
MatrixSize checked_size(const std::filesystem::path& file)
{
  auto stream = open_file(file);
  const auto header = read_header(stream, file, MAT_FILE_CLASSID, "matrix", 3);
  const std::int64_t rows = header[0], columns = header[1], entries = header[2];
  if (entries < 0) throw Error(file.string() + ": a dense matrix; write it as a sparse one (AIJ)");
  if (rows < 1 || columns < 1)
    throw Error(file.string() + ": a matrix of " + std::to_string(rows) + " x " + std::to_string(columns));
  const std::int64_t width = sizeof(FileIndex);
  check_length(file, (4 + rows + entries) * width + entries * 8);
  const auto counts = read_big_endian<FileIndex>(stream, rows);
  std::int64_t sum = 0;
  for (const FileIndex count : counts)
  {
    if (count < 0 || count > columns) throw Error(file.string() + ": a row of " + std::to_string(count) + " entries");
    sum += count;
  }
  if (sum != entries)
    throw Error(file.string() + ": rows hold " + std::to_string(sum) + " entries, the header announces " +
                std::to_string(entries));
  check_columns(stream, file, counts, header[1]);
  return {static_cast<PetscInt>(rows), static_cast<PetscInt>(columns)};
}

constexpr const char* entries_expected = "entries must be at most 1e100 in size, so that powers of them are finite";

bool is_computable(double value)
{
  return std::abs(value) <= largest_number; // false of NaN
}

/// Returns the message on the first entry of this rank's rows that is not computable; empty if there is none.
std::string problem_of_entries(Mat A, const std::filesystem::path& file)
{
  std::string problem;
  for_each_row(A,
               [&](PetscInt row, std::span<const PetscInt> columns, std::span<const PetscScalar> values)
               {
                 for (std::size_t k = 0; k < columns.size() && problem.empty(); ++k)
                   if (!is_computable(values[k]))
                     problem = format("%s: entry (%d, %d) is %g; %s", file.c_str(), static_cast<int>(row),
                                      static_cast<int>(columns[k]), values[k], entries_expected);
               });
  return problem;
}

} // namespace

bool is_there(const std::filesystem::path& file, MPI_Comm comm)
{
  int found = 0;
  on_rank_zero(comm, [&] { found = is_file(file) ? 1 : 0; });
  MPI_Bcast(&found, 1, MPI_INT, 0, comm);
  return found != 0;
}

MatrixSize check_matrix_file(const std::filesystem::path& file, MPI_Comm comm)
{
  MatrixSize size;
  on_rank_zero(comm, [&] { size = checked_size(file); });
  PetscInt both[2] = {size.rows, size.columns};
  MPI_Bcast(both, 2, MPIU_INT, 0, comm);
  return {both[0], both[1]};
}

Owned<Mat> load_matrix(const std::filesystem::path& file, MatrixSize size, MatrixSize local, MPI_Comm comm)
{
  Owned<PetscViewer> viewer;
  check(PetscViewerCreate(comm, viewer.put()));
  check(PetscViewerSetType(viewer, PETSCVIEWERBINARY));
  check(PetscViewerFileSetMode(viewer, FILE_MODE_READ));
  check(PetscViewerBinarySetSkipInfo(viewer, PETSC_TRUE)); // options in FILE.info, which may write anywhere
  check(PetscViewerBinarySetSkipOptions(viewer, PETSC_TRUE));
  check(PetscViewerFileSetName(viewer, file.c_str()));
  Owned<Mat> A;
  check(MatCreate(comm, A.put()));
  check(MatSetSizes(A, local.rows, local.columns, size.rows, size.columns));
  check(MatSetType(A, MATAIJ));
  check(MatLoad(A, viewer));
  agree(comm, problem_of_entries(A, file));
  return A;
}

std::vector<double> read_vector(const std::filesystem::path& file, MPI_Comm comm)
{
  std::vector<double> values;
  const auto read = [&]
  {
    std::vector<std::vector<double>> found = read_vectors(file);
    if (found.size() != 1) throw Error(file.string() + format(": holds %zu vectors, not one", found.size()));
    values = std::move(found.front());
    const auto bad = std::ranges::find_if_not(values, is_computable);
    if (bad != values.end())
      throw Error(format("%s: entry %td is %g; %s", file.c_str(), bad - values.begin(), *bad, entries_expected));
  };
  on_rank_zero(comm, read);
  broadcast(values, comm);
  return values;
}

std::vector<std::vector<double>> read_vectors(const std::filesystem::path& file)
{
  auto stream = open_file(file);
  const auto bytes = static_cast<std::int64_t>(std::filesystem::file_size(file));
  std::vector<std::vector<double>> vectors;
  while (vectors.empty() || stream.tellg() < bytes)
  {
    const std::int64_t length = read_header(stream, file, VEC_FILE_CLASSID, "vector", 1)[0];
    if (length < 0) throw Error(file.string() + ": a vector of " + std::to_string(length));
    if (const std::int64_t end = stream.tellg() + std::streamoff{8 * length}; end > bytes)
      throw Error(file.string() + ": truncated: " + std::to_string(bytes) + " bytes where a header announces " +
                  std::to_string(end) + " (real double precision)");
    vectors.push_back(read_big_endian<double>(stream, length));
  }
  return vectors;
}

void append_vector(const std::vector<double>& entries, std::string& bytes)
{
  append_big_endian(static_cast<FileIndex>(VEC_FILE_CLASSID), bytes);
  append_big_endian(static_cast<FileIndex>(entries.size()), bytes);
  for (const double entry : entries) append_big_endian(entry, bytes);
}

// Supports of a matrix scene are exact: their rows and columns are taken out of the matrices.

namespace
{

std::vector<NodeMotion> motions_in(const std::filesystem::path& file, PetscInt size)
{
  auto motions = read_row_motions(file);
  if (static_cast<PetscInt>(motions.size()) != size)
    throw Error(file.string() + ": " + std::to_string(motions.size()) + " lines, but M.petsc has " +
                std::to_string(size) + " rows: one line for each row is needed");
  return motions;
}

/// The rows that a text names, in the order of the files.
std::vector<PetscInt> rows_of(const MatrixRows& rows, const std::string& on, const std::string& user)
{
  const auto names = row_names(on);
  if (!names) throw Error(user + ": on = \"" + on + "\": expected \"dof:N\" or \"node:N\"");
  if (names->nodes && rows.motions.empty())
    throw Error(user + ": on = \"" + on + "\": the folder of the matrices has no dofs.txt, which says what node each " +
                "row belongs to; tools/matrices writes one, or name rows by \"dof:N\"");
  std::vector<PetscInt> found;
  for (const RowNames::Range& range : names->ranges)
  {
    const std::size_t before = found.size();
    for (PetscInt row = 0; row < rows.size; ++row)
      if (const long key = names->nodes ? rows.motions[row].node : row; key >= range.first && key <= range.last)
        found.push_back(row);
    if (found.size() == before || (!names->nodes && range.last >= rows.size))
      throw Error(user + ": on = \"" + on + "\": " +
                  (names->nodes ? "no row of the matrices belongs to node " + std::to_string(range.first)
                                : "the matrices have the rows 0 to " + std::to_string(rows.size - 1)));
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

bool names_nodes(const std::string& on)
{
  const std::optional<RowNames> names = row_names(on);
  return names && names->nodes;
}

} // namespace

MatrixRows read_matrix_rows(const std::filesystem::path& folder, PetscInt size, MPI_Comm comm)
{
  MatrixRows rows;
  rows.size = size;
  const auto file = folder / "dofs.txt";
  on_rank_zero(comm,
               [&]
               {
                 if (is_file(file)) rows.motions = motions_in(file, size);
               });
  broadcast(rows.motions, comm);
  return rows;
}

void add_forces(const MatrixRows& rows, const std::vector<Force>& forces, Vec load)
{
  const int rank = rank_of(comm_of(load));
  for (const Force& force : forces)
  {
    const auto found = rows_of(rows, force.on, "force on " + force.on);
    for (std::size_t c = 0; c < 3; ++c)
    {
      if (force.vector[c] == 0) continue;
      std::vector<PetscInt> pushed;
      for (const PetscInt row : found)
        if (!names_nodes(force.on) || rows.motions[row].motion == static_cast<int>(c)) pushed.push_back(row);
      if (pushed.empty())
        throw Error("force on " + force.on + ": the matrices have no row for its motion " + motion_words[c]);
      if (rank != 0) continue;
      for (const PetscInt row : pushed)
        check(VecSetValue(load, row, force.vector[c] / static_cast<double>(pushed.size()), ADD_VALUES));
    }
  }
  finish(load);
}

std::vector<PetscInt> held_rows(const MatrixRows& rows, const std::vector<Support>& supports)
{
  std::vector<PetscInt> held;
  for (const Support& support : supports)
  {
    const std::size_t before = held.size();
    for (const PetscInt row : rows_of(rows, support.on, "support on " + support.on))
    {
      const int motion = names_nodes(support.on) ? rows.motions[row].motion : 0;
      if (motion >= 0 && support.fixed[static_cast<std::size_t>(motion)]) held.push_back(row);
    }
    if (held.size() == before)
      throw Error("support on " + support.on + ": the matrices have no row for the motions that it holds");
  }
  std::sort(held.begin(), held.end());
  held.erase(std::unique(held.begin(), held.end()), held.end());
  if (static_cast<PetscInt>(held.size()) == rows.size) throw Error("the supports hold every row of the matrices");
  return held;
}

Owned<Mat> probe_rows(const std::vector<Probe>& probes, const MatrixRows& rows, PetscInt local_columns, MPI_Comm comm)
{
  std::vector<SparseRow> own;
  const auto [first, last] = local_range(static_cast<PetscInt>(probes.size()), comm);
  for (PetscInt i = 0; i < static_cast<PetscInt>(probes.size()); ++i)
  {
    const Probe& probe = probes[static_cast<std::size_t>(i)];
    SparseRow read;
    for (const PetscInt row : rows_of(rows, probe.on, "probe " + probe.name))
    {
      const int motion = names_nodes(probe.on) ? rows.motions[row].motion : -1;
      const double factor = !names_nodes(probe.on) ? 1 : motion >= 0 && motion < 3 ? probe.direction[motion] : 0;
      if (factor != 0) read[row] = factor;
    }
    if (read.empty())
      throw Error("probe " + probe.name + ": the matrices have no row for its direction at " + probe.on);
    if (i >= first && i < last) own.push_back(std::move(read));
  }
  return matrix_of_rows(own, local_columns, comm);
}

Elimination::Elimination(const std::vector<PetscInt>& held, Vec layout)
{
  const auto [first, last] = own_range(layout);
  std::vector<PetscInt> kept;
  for (PetscInt row = first; row < last; ++row)
    if (!std::binary_search(held.begin(), held.end(), row)) kept.push_back(row);
  kept_ = set_of(comm_of(layout), kept);
}

Owned<Mat> Elimination::square(Mat A) const
{
  return A ? part_of(A, kept_, kept_) : Owned<Mat>();
}

Owned<Mat> Elimination::columns(Mat A) const
{
  return A ? part_of(A, set_of(comm_of(A), own_rows(A)), kept_) : Owned<Mat>();
}

Owned<Vec> Elimination::entries(Vec x) const
{
  Vec part = nullptr;
  check(VecGetSubVector(x, kept_, &part));
  Owned<Vec> result = copy_of(part);
  check(VecRestoreSubVector(x, kept_, &part));
  return result;
}

void name_rows(const MatrixRows& rows, const std::vector<PetscInt>& held, DofNames& names)
{
  for (PetscInt row = 0; row < rows.size; ++row)
  {
    if (std::binary_search(held.begin(), held.end(), row)) continue;
    names.file_rows.push_back(row);
    if (!rows.motions.empty()) names.file_motions.push_back(rows.motions[row]);
  }
}

} // namespace squeal
