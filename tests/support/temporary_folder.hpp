#pragma once
/// A folder for the files of one test, of one place on every rank. Rank 0 makes it and, in the end, removes it.
#include "squeal/base/petsc.hpp"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace squeal::test
{

struct TemporaryFolder
{
  std::filesystem::path path;

  TemporaryFolder()
  {
    std::string pattern = (std::filesystem::temp_directory_path() / "squeal-test-XXXXXX").string();
    int made = 1;
    if (rank_of(PETSC_COMM_WORLD) == 0) made = mkdtemp(pattern.data()) != nullptr;
    MPI_Bcast(&made, 1, MPI_INT, 0, PETSC_COMM_WORLD);
    MPI_Bcast(pattern.data(), static_cast<int>(pattern.size()), MPI_CHAR, 0, PETSC_COMM_WORLD);
    if (!made) throw Error("no temporary folder " + pattern);
    path = pattern;
  }
  ~TemporaryFolder()
  {
    MPI_Barrier(PETSC_COMM_WORLD);
    std::error_code ignored;
    if (rank_of(PETSC_COMM_WORLD) == 0) std::filesystem::remove_all(path, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  /// A file of this text, written by rank 0.
  std::filesystem::path write(const std::string& name, const std::string& text) const
  {
    if (rank_of(PETSC_COMM_WORLD) == 0) std::ofstream(path / name) << text;
    MPI_Barrier(PETSC_COMM_WORLD);
    return path / name;
  }
};

} // namespace squeal::test
