#include "squeal/report/files.hpp"

#include "squeal/base/error.hpp"

#include <fstream>
#include <functional>
#include <numeric>
#include <utility>

namespace squeal
{

namespace fs = std::filesystem;

NewFile::NewFile(fs::path place) : place_(std::move(place)), part_(place_)
{
  part_ += ".part";
}

NewFile::~NewFile()
{
  std::error_code ignored;
  fs::remove(part_, ignored);
}

void NewFile::keep()
{
  std::error_code failed;
  fs::rename(part_, place_, failed);
  if (failed) throw Error("cannot write " + place_.string() + ": " + failed.message());
}

void write_text(const fs::path& place, const std::string& text)
{
  NewFile file(place);
  std::ofstream stream(file.path());
  stream << text;
  stream.close();
  if (!stream) throw Error("cannot write " + place.string() + ": is the folder writable, is the disk full?");
  file.keep();
}

namespace
{

/// Closes an HDF5 object when it goes out of scope.
class Handle
{
public:
  Handle(hid_t id, herr_t (*close)(hid_t), const std::string& what) : id_(id), close_(close)
  {
    if (id < 0) throw Error("cannot write " + what + ": HDF5 refused it; is the disk full?");
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

Hdf5File::Hdf5File(fs::path place) : file_(std::move(place))
{
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); // failures become our errors instead of a printed stack
  id_ = H5Fcreate(file_.path().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  if (id_ < 0) throw Error("cannot write " + file_.path().string() + ": is the folder writable?");
  write_attribute(id_, "format_version", std::to_string(format_version));
}

Hdf5File::~Hdf5File()
{
  if (id_ >= 0) H5Fclose(id_);
}

void Hdf5File::close()
{
  if (H5Fclose(std::exchange(id_, -1)) < 0)
    throw Error("cannot write " + file_.path().string() + ": is the disk full?");
}

void Hdf5File::keep()
{
  close();
  file_.keep();
}

void Hdf5File::write_data(const std::string& name, const std::vector<hsize_t>& shape, hid_t type, std::size_t size,
                          const void* data, const std::string& unit)
{
  const std::string what = file_.path().string() + ":" + name;
  if (std::accumulate(shape.begin(), shape.end(), hsize_t{1}, std::multiplies<>()) != size)
    throw Error("cannot write " + what + ": shape and data disagree");
  const Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose, what);
  H5Pset_create_intermediate_group(links, 1);
  const Handle space(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr), H5Sclose, what);
  const Handle set(H5Dcreate2(id_, name.c_str(), type, space, links, H5P_DEFAULT, H5P_DEFAULT), H5Dclose, what);
  if (size > 0 && H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0)
    throw Error("cannot write " + what + ": is the disk full?");
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

} // namespace squeal
