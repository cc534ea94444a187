#pragma once
/// Result files that exist whole or not at all: written beside their place under another name, then moved there.
#include <filesystem>
#include <hdf5.h>
#include <string>
#include <vector>

namespace squeal
{

/// The version of the keys of report.json and of the data sets of the HDF5 files. Readers refuse a later one.
inline constexpr int format_version = 1;

/// A file in the making; it takes its place by keep(), and vanishes without.
class NewFile
{
public:
  explicit NewFile(std::filesystem::path place);
  ~NewFile();
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  const std::filesystem::path& path() const { return part_; } // to write to
  void keep();

private:
  std::filesystem::path place_, part_;
};

/// Writes a whole text file.
void write_text(const std::filesystem::path& place, const std::string& text);

/// An HDF5 file written by one rank. Data sets carry their unit as an attribute, the file its format_version.
class Hdf5File
{
public:
  explicit Hdf5File(std::filesystem::path place);
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
  void keep(); // closes the file and puts it in its place

private:
  void write_data(const std::string& name, const std::vector<hsize_t>& shape, hid_t type, std::size_t size,
                  const void* data, const std::string& unit);
  void close();

  NewFile file_;
  hid_t id_ = -1;
};

} // namespace squeal
