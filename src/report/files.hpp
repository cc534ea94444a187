#pragma once
/// HDF5 files of results, each written whole or not at all, and cells of CSV files.
#include <filesystem>
#include <hdf5.h>
#include <string>
#include <vector>

namespace squeal
{

/// The version of the keys of report.json and of the data sets of the HDF5 files. Readers refuse a later one.
inline constexpr int format_version = 1;

/// An HDF5 file written by one rank. Data sets carry their unit as an attribute, the file its format_version and the
/// identity of its run. It is made in memory: on a full disk HDF5 itself would fail again when MPI ends.
class Hdf5File
{
public:
  Hdf5File(std::filesystem::path place, const std::string& run);
  ~Hdf5File();
  Hdf5File(const Hdf5File&) = delete;
  Hdf5File& operator=(const Hdf5File&) = delete;

  /// `name` may hold groups, "cycle/energy"; they are made as needed. Row-major; `shape` multiplies to the data's size.
  void write(const std::string& name, const std::vector<hsize_t>& shape, const std::vector<double>& data,
             const std::string& unit);
  void write(const std::string& name, const std::vector<hsize_t>& shape, const std::vector<int>& data,
             const std::string& unit);
  void write(const std::string& name, const std::vector<hsize_t>& shape, const std::vector<unsigned char>& data,
             const std::string& unit);
  void keep(); // writes the file in its place

private:
  void write_data(const std::string& name, const std::vector<hsize_t>& shape, hid_t type, std::size_t size,
                  const void* data, const std::string& unit);

  std::filesystem::path place_;
  hid_t id_ = -1;
};

/// A text in quotation marks, as a cell of a CSV file.
std::string csv_text(const std::string& text);

} // namespace squeal
