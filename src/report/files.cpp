#include "files.hpp"

#include "squeal/base/error.hpp"
#include "squeal/base/markdown.hpp"
#include "squeal/base/whole_file.hpp"

#include <algorithm>
#include <utility>

namespace squeal
{

namespace fs = std::filesystem;

namespace
{

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

/// Whether a data set has this name, in which a <placeholder> stands for the rest of a group's name.
bool is_of(std::string_view pattern, std::string_view name)
{
  for (std::size_t at = 0; (at = pattern.find('<')) != std::string_view::npos;)
  {
    if (name.substr(0, at) != pattern.substr(0, at)) return false;
    pattern.remove_prefix(pattern.find('>') + 1);
    name.remove_prefix(std::min(name.find('/', at), name.size()));
  }
  return pattern == name;
}

} // namespace

Hdf5File::Hdf5File(fs::path place, const std::string& run, std::span<const DataSet> sets)
    : place_(std::move(place)), sets_(sets)
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
  std::string bytes(static_cast<std::size_t>(std::max<ssize_t>(size, 0)), '\0');
  if (size <= 0 || H5Fget_file_image(id_, bytes.data(), bytes.size()) != size)
    throw Error("cannot write " + place_.string() + ": HDF5 does not hand out the file that it made in memory");
  write_whole_file(place_, bytes);
  H5Fclose(std::exchange(id_, -1));
}

const DataSet& Hdf5File::set_of(const std::string& name) const
{
  const auto found = std::ranges::find_if(sets_, [&](const DataSet& set) { return is_of(set.name, name); });
  if (found == sets_.end()) throw Error("no data set " + name + " is described");
  return *found;
}

void Hdf5File::write_data(const std::string& name, const std::vector<hsize_t>& shape, hid_t type, const void* data)
{
  const DataSet& described = set_of(name);
  const std::string what = place_.string() + ":" + name;
  const Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose, what);
  H5Pset_create_intermediate_group(links, 1);
  const Handle space(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr), H5Sclose, what);
  const Handle set(H5Dcreate2(id_, name.c_str(), type, space, links, H5P_DEFAULT, H5P_DEFAULT), H5Dclose, what);
  if (shape.front() > 0 && H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0)
    throw Error("cannot write " + what + ": HDF5 refused it; is there memory for the file?");
  write_attribute(set, "unit", described.unit);
  write_attribute(set, "meaning", described.meaning);
}

std::string page_rows(std::span<const DataSet> sets)
{
  std::string rows;
  for (const DataSet& set : sets) rows += markdown_row({markdown_code(set.name), set.unit, set.meaning});
  return rows;
}

} // namespace squeal
