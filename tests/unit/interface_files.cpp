// ranks: 1 2 3
// Matrix scenes: what is written is what is read, on any number of ranks, and a damaged folder is one message.
#include "../support/temporary_folder.hpp"
#include "squeal/contact/interface.hpp"

#include <cmath>
#include <doctest/doctest.h>
#include <fstream>
#include <limits>

using namespace squeal;
using test::TemporaryFolder;

namespace
{

using Dense = std::vector<std::vector<double>>;

const MPI_Comm& world = PETSC_COMM_WORLD; // set when the session starts

void write(const std::filesystem::path& file, const Dense& rows)
{
  if (rank_of(world) == 0)
  {
    Owned<Mat> A;
    const auto columns = static_cast<PetscInt>(rows[0].size());
    check(MatCreateSeqAIJ(PETSC_COMM_SELF, static_cast<PetscInt>(rows.size()), columns, columns, nullptr, A.put()));
    for (std::size_t i = 0; i < rows.size(); ++i)
      for (std::size_t j = 0; j < rows[i].size(); ++j)
        if (rows[i][j] != 0)
          check(MatSetValue(A, static_cast<PetscInt>(i), static_cast<PetscInt>(j), rows[i][j], INSERT_VALUES));
    check(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
    check(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
    Owned<PetscViewer> viewer;
    check(PetscViewerBinaryOpen(PETSC_COMM_SELF, file.c_str(), FILE_MODE_WRITE, viewer.put()));
    check(MatView(A, viewer));
  }
  MPI_Barrier(world);
}

void write(const std::filesystem::path& file, const std::vector<double>& values)
{
  if (rank_of(world) == 0)
  {
    Owned<Vec> v;
    check(VecCreateSeq(PETSC_COMM_SELF, static_cast<PetscInt>(values.size()), v.put()));
    for (std::size_t i = 0; i < values.size(); ++i)
      check(VecSetValue(v, static_cast<PetscInt>(i), values[i], INSERT_VALUES));
    check(VecAssemblyBegin(v));
    check(VecAssemblyEnd(v));
    Owned<PetscViewer> viewer;
    check(PetscViewerBinaryOpen(PETSC_COMM_SELF, file.c_str(), FILE_MODE_WRITE, viewer.put()));
    check(VecView(v, viewer));
  }
  MPI_Barrier(world);
}

/// Two pads on springs, each above a belt: four degrees of freedom, two pairs, one tangential row each.
void write_scene(const std::filesystem::path& folder)
{
  write(folder / "M.petsc", Dense{{2, 0, 0, 0}, {0, 2, 0, 0}, {0, 0, 3, 0}, {0, 0, 0, 3}});
  write(folder / "C.petsc", Dense{{0.1, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0.2}});
  write(folder / "K.petsc", Dense{{5, -1, 0, 0}, {-1, 6, 0, -2}, {0, 0, 7, 0}, {0, -2, 0, 8}});
  write(folder / "F.petsc", std::vector<double>{0, -1, 0, -2});
  write(folder / "B.petsc", Dense{{0, 1, 0, 0}, {1, 0, 0, 0}, {0, 0, 0, 1}, {0, 0, 1, 0}});
  write(folder / "gap.petsc", std::vector<double>{0, 1e-3});
  write(folder / "drive.petsc", std::vector<double>{3, -0.5});
}

const FrictionLaw friction{.coefficient = 0.3, .direction_damping = true};

std::string message(const std::filesystem::path& folder)
{
  try
  {
    const auto structure = read_structure(folder, world);
    read_interface(folder, structure, friction, world);
  }
  catch (const Error& error)
  {
    return error.what();
  }
  return "";
}

void put_bytes(const std::filesystem::path& file, const std::string& bytes)
{
  if (rank_of(world) == 0) std::ofstream(file, std::ios::binary) << bytes;
  MPI_Barrier(world);
}

void cut(const std::filesystem::path& file, std::uintmax_t bytes)
{
  if (rank_of(world) == 0) std::filesystem::resize_file(file, std::filesystem::file_size(file) - bytes);
  MPI_Barrier(world);
}

/// x'A y of vectors given by their entries.
double form(Mat A, const std::vector<double>& x, const std::vector<double>& y)
{
  Owned<Vec> left, right, product;
  check(MatCreateVecs(A, right.put(), left.put()));
  product = zeros_like(left);
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(left, &first, &last));
  for (PetscInt i = first; i < last; ++i)
  {
    check(VecSetValue(left, i, x[static_cast<std::size_t>(i)], INSERT_VALUES));
    check(VecSetValue(right, i, y[static_cast<std::size_t>(i)], INSERT_VALUES));
  }
  for (Vec v : {left.get(), right.get()})
  {
    check(VecAssemblyBegin(v));
    check(VecAssemblyEnd(v));
  }
  check(MatMult(A, right, product));
  double result = 0;
  check(VecDot(left, product, &result));
  return result;
}

} // namespace

TEST_CASE("a folder of matrices is read as it was written, with one pattern")
{
  const TemporaryFolder folder;
  write_scene(folder.path);
  const auto structure = read_structure(folder.path, world);
  // Entries are copied, never computed: equality is exact.
  const std::vector<double> x{1, 2, 3, 4}, y{1, -1, 2, 5};
  CHECK(form(structure.M, x, y) == 2 - 4 + 18 + 60);
  CHECK(form(structure.C, x, y) == doctest::Approx(0.1 + 4).epsilon(1e-15));
  CHECK(form(structure.K, x, y) == (5 + 1) + 2 * (-1 - 6 - 10) + 3 * 14 + 4 * (2 + 40));
  double load = 0;
  check(VecSum(structure.load, &load));
  CHECK(load == -3);
  MatInfo info;
  for (Mat A : {structure.M.get(), structure.C.get(), structure.K.get()})
  {
    check(MatGetInfo(A, MAT_GLOBAL_SUM, &info));
    CHECK(info.nz_used == 8); // four on the diagonal and two couplings
    PetscBool known = PETSC_FALSE, symmetric = PETSC_FALSE;
    check(MatIsSymmetricKnown(A, &known, &symmetric));
    CHECK(known);
    CHECK(symmetric);
  }
  CHECK(describe(structure.names, 3) == "dof 3");
}

TEST_CASE("relative and add_reactions are B x and B'r, whole on every rank")
{
  const TemporaryFolder folder;
  write_scene(folder.path);
  const auto structure = read_structure(folder.path, world);
  const auto interface = read_interface(folder.path, structure, friction, world);
  CHECK(interface.pairs == 2);
  CHECK(interface.directions == 1);
  CHECK(interface.gap == std::vector<double>{0, 1e-3});
  CHECK(drive_directions(interface) == std::vector<double>{1, -1});
  CHECK(relative(interface, structure.load) == std::vector<double>{-1, 0, -2, 0});
  auto y = copy_of(structure.load);
  add_reactions(interface, {10, 20, 30, 40}, y);
  CHECK(relative(interface, y) == std::vector<double>{9, 20, 28, 40});
  // Whole pairs on a rank: a pair's rows are never parted.
  PetscInt first = 0;
  check(MatGetOwnershipRange(interface.B, &first, nullptr));
  CHECK(first % (1 + interface.directions) == 0);
}

/// A folder of files that are written anew after each message.
struct Damaged
{
  TemporaryFolder folder{};
  const std::filesystem::path& path = folder.path;

  Damaged()
  {
    write_scene(path);
    REQUIRE(message(path) == "");
  }

  void says(const std::string& text) const
  {
    const auto found = message(path);
    CAPTURE(found);
    CHECK(found.find(text) != std::string::npos);
    write_scene(path);
  }
};

TEST_CASE("files that are missing or damaged are one message on every rank")
{
  const Damaged files;
  const auto& path = files.path;
  const auto says = [&](const std::string& text) { files.says(text); };
  SUBCASE("missing damping and load, which are zero")
  {
    if (rank_of(world) == 0)
      for (const char* name : {"C.petsc", "F.petsc"}) std::filesystem::remove(path / name);
    const auto structure = read_structure(path, world);
    CHECK(form(structure.C, {1, 0, 0, 1}, {1, 0, 0, 1}) == 0);
    CHECK(all_entries(structure.load) == std::vector<double>(4, 0.));
  }
  SUBCASE("missing")
  {
    if (rank_of(world) == 0) std::filesystem::remove(path / "K.petsc");
    MPI_Barrier(world);
    says("K.petsc: no such file");
  }
  SUBCASE("truncated")
  {
    for (const char* name : {"M.petsc", "K.petsc", "F.petsc", "B.petsc", "gap.petsc", "drive.petsc"})
    {
      cut(path / name, 5);
      says(std::string(name) + ": truncated");
    }
    put_bytes(path / "K.petsc", "");
    says("K.petsc: not a matrix");
  }
  SUBCASE("not PETSc's format, or another object")
  {
    put_bytes(path / "K.petsc", "this is no matrix at all");
    says("K.petsc: not a matrix");
    write(path / "F.petsc", Dense{{1, 2, 3, 4}});
    says("F.petsc: not a vector");
  }
}

TEST_CASE("files that contradict each other are one message on every rank")
{
  const Damaged files;
  const auto& path = files.path;
  const auto says = [&](const std::string& text) { files.says(text); };
  SUBCASE("sizes that disagree")
  {
    write(path / "K.petsc", Dense{{1, 0}, {0, 1}});
    says("K.petsc: 2 x 2, but M.petsc beside it is 4 x 4");
    write(path / "F.petsc", std::vector<double>{1, 2});
    says("F.petsc: length 2");
    write(path / "B.petsc", Dense{{1, 0}, {0, 1}});
    says("B.petsc: 2 columns, but M.petsc has 4");
    write(path / "gap.petsc", std::vector<double>{0, 0, 0});
    says("B.petsc: 4 rows for the 3 pairs");
    write(path / "drive.petsc", std::vector<double>{1, 0, 1});
    says("drive.petsc: length 3");
    write(path / "M.petsc", Dense{{1, 0}, {0, 1}, {0, 0}});
    says("M.petsc: 3 x 2, must be square");
  }
  SUBCASE("values that cannot be")
  {
    write(path / "K.petsc", Dense{{5, -1, 0, 0}, {-1, 6, 0, -2}, {0, 0, std::nan(""), 0}, {0, -2, 0, 8}});
    says("K.petsc: entry (2, 2) is nan");
    write(path / "K.petsc", Dense{{5, -1, 0, 0}, {-1, 6e200, 0, -2}, {0, 0, 7, 0}, {0, -2, 0, 8}});
    says("K.petsc: entry (1, 1) is 6e+200; entries must be at most 1e100");
    write(path / "gap.petsc", std::vector<double>{0, std::numeric_limits<double>::infinity()});
    says("gap.petsc: entry 1 is inf");
    write(path / "K.petsc", Dense{{5, -1, 0, 0}, {-1, 6, 0, -2}, {0, 0, 7, 0}, {0, -1.9, 0, 8}});
    says("K.petsc: not symmetric: entries (");
    write(path / "M.petsc", Dense{{2, 0, 0, 0}, {0, -2, 0, 0}, {0, 0, 3, 0}, {0, 0, 0, 3}});
    says("M.petsc: 1 of its eigenvalues are negative");
    write(path / "drive.petsc", std::vector<double>{1, 0}); // the second pair has no drive: it may stick
    write(path / "B.petsc", Dense{{0, 1, 0, 0}, {1, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 1, 0}});
    says("pair 1 cannot move along its normal");
  }
}
