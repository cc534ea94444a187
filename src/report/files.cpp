#include "files.hpp"

#include "squeal/base/error.hpp"
#include "squeal/base/whole_file.hpp"

#include <algorithm>
#include <functional>
#include <numeric>
#include <utility>

namespace squeal
{

namespace fs = std::filesystem;

namespace
{

// Of the superblock of version 0, which HDF5 writes unless it is asked for a later one (HDF5 File Format, II.A).
constexpr ssize_t consistency_flags = 20, superblock = 96; // [bytes] where the flags are, size

/// Closes an HDF5 object when it goes out of scope.
class Handle
{
public:
  Handle(hid_t id, herr_t (*close)(hid_t), const std::string& what) : id_(id), close_(close)
  {
    if (id < 0) throw Error("cannot write " + what + ": HDF5 refused it; is there memory for the file?");
  }
  ~Handle() { close_(id_); }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }

private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

void write_attribute(hid_t object, const std::string& name, const std::string& text)
{
  const Handle type(H5Tcopy(H5T_C_S1), H5Tclose, name);
  H5Tset_size(type, text.size() + 1);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose, name);
  const Handle attribute(H5Acreate2(object, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, name);
  if (H5Awrite(attribute, type, text.c_str()) < 0) throw Error("cannot write attribute " + name);
}

} // namespace

Hdf5File::Hdf5File(fs::path place, const std::string& run) : place_(std::move(place))
{
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); // failures become our errors instead of a printed stack
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, place_.string());
  constexpr std::size_t growth = 1 << 20; // bytes that the memory grows by at a time
  H5Pset_fapl_core(access, growth, 0);    // 0: nothing on the disk
  id_ = H5Fcreate(place_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
  if (id_ < 0) throw Error("cannot write " + place_.string() + ": HDF5 cannot make a file in memory");
  write_attribute(id_, "format_version", std::to_string(format_version));
  write_attribute(id_, "run", run);
}

Hdf5File::~Hdf5File()
{
  if (id_ >= 0) H5Fclose(id_);
}

void Hdf5File::keep()
{
  H5Fflush(id_, H5F_SCOPE_GLOBAL);
  const ssize_t size = H5Fget_file_image(id_, nullptr, 0);
  void* memory = nullptr; // where the driver keeps the address of the file's bytes: no copy is made
  if (size < superblock || H5Fget_vfd_handle(id_, H5P_DEFAULT, &memory) < 0)
    throw Error("cannot write " + place_.string() + ": HDF5 does not hand out the file that it made in memory");
  char* const bytes = *static_cast<char**>(memory);
  std::fill_n(bytes + consistency_flags, 4, '\0'); // no longer open for writing
  write_whole_file(place_, {bytes, static_cast<std::size_t>(size)});
  H5Fclose(std::exchange(id_, -1));
}

void Hdf5File::write_data(const std::string& name, const std::vector<hsize_t>& shape, hid_t type, std::size_t size,
                          const void* data, const std::string& unit)
{
  const std::string what = place_.string() + ":" + name;
  if (std::accumulate(shape.begin(), shape.end(), hsize_t{1}, std::multiplies<>()) != size)
    throw Error("cannot write " + what + ": shape and data disagree");
  const Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose, what);
  H5Pset_create_intermediate_group(links, 1);
  const Handle space(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr), H5Sclose, what);
  const Handle set(H5Dcreate2(id_, name.c_str(), type, space, links, H5P_DEFAULT, H5P_DEFAULT), H5Dclose, what);
  if (size > 0 && H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0)
    throw Error("cannot write " + what + ": HDF5 refused it; is there memory for the file?");
  write_attribute(set, "unit", unit);
}

void Hdf5File::write(const std::string& name, const std::vector<hsize_t>& shape, const std::vector<double>& data,
                     const std::string& unit)
{
  write_data(name, shape, H5T_NATIVE_DOUBLE, data.size(), data.data(), unit);
}

void Hdf5File::write(const std::string& name, const std::vector<hsize_t>& shape, const std::vector<int>& data,
                     const std::string& unit)
{
  write_data(name, shape, H5T_NATIVE_INT, data.size(), data.data(), unit);
}

void Hdf5File::write(const std::string& name, const std::vector<hsize_t>& shape, const std::vector<unsigned char>& data,
                     const std::string& unit)
{
  write_data(name, shape, H5T_NATIVE_UCHAR, data.size(), data.data(), unit);
}

std::string csv_text(const std::string& text)
{
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

} // namespace squeal
