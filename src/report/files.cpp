/// HDF5 files, and history.h5: transient, cycle and settled motion against time, and responses.
#include "files.hpp"

#include "squeal/base/error.hpp"
#include "squeal/base/markdown.hpp"
#include "squeal/base/whole_file.hpp"

#include <algorithm>
#include <hdf5_hl.h>
#include <utility>

namespace squeal
{

namespace fs = std::filesystem;

namespace
{

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
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  constexpr std::size_t growth = 1 << 20; // bytes that the memory grows by at a time
  H5Pset_fapl_core(access, growth, 0);    // 0: nothing on the disk
  id_ = H5Fcreate(place_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
  H5Pclose(access);
  if (id_ < 0 || H5LTset_attribute_string(id_, "/", "format_version", std::to_string(format_version).c_str()) < 0 ||
      H5LTset_attribute_string(id_, "/", "run", run.c_str()) < 0)
    throw Error("cannot write " + place_.string() + ": HDF5 cannot make a file in memory");
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
  for (std::size_t at = 0; (at = name.find('/', at + 1)) != std::string::npos;)
    if (const std::string group = name.substr(0, at); H5Lexists(id_, group.c_str(), H5P_DEFAULT) <= 0)
      H5Gclose(H5Gcreate2(id_, group.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  if (H5LTmake_dataset(id_, name.c_str(), static_cast<int>(shape.size()), shape.data(), type,
                       shape.front() > 0 ? data : nullptr) < 0 ||
      H5LTset_attribute_string(id_, name.c_str(), "unit", described.unit) < 0 ||
      H5LTset_attribute_string(id_, name.c_str(), "meaning", described.meaning) < 0)
    throw Error("cannot write " + place_.string() + ":" + name + ": HDF5 refused it; is there memory for the file?");
}

std::string page_rows(std::span<const DataSet> sets)
{
  std::string rows;
  for (const DataSet& set : sets) rows += markdown_row({markdown_code(set.name), set.unit, set.meaning});
  return rows;
}

namespace
{

void write_group(Hdf5File& file, const std::string& group, const History& history, const Scene& scene)
{
  const auto write = [&](const std::string& name, const char*, const auto& series)
  { file.write(group + "/" + name, series); };
  for_each_series(write, history);
  const std::size_t probes = std::min(scene.probes.size(), history.probes.size());
  for (std::size_t i = 0; i < probes; ++i) write("probes/" + scene.probes[i].name, "m", history.probes[i]);
}

/// The motion on its shapes, one sample a row.
void write_coordinates(Hdf5File& file, const SettledMotion& settled)
{
  const auto& coordinates = settled.shapes.coordinates;
  if (coordinates.empty()) return;
  std::vector<double> time, rows;
  for (std::size_t i = 0; i < settled.shapes.squares.size(); ++i)
  {
    const auto every = static_cast<std::size_t>(settled.sampled_steps);
    time.push_back(settled.history.time[(i + 1) * every - 1]);
    for (const auto& coordinate : coordinates) rows.push_back(coordinate[i]);
  }
  file.write("settled/shapes/time", time);
  file.write("settled/shapes/coordinate", rows, coordinates.size());
}

void write_statuses(Hdf5File& file, const std::vector<std::vector<ContactStatus>>& statuses)
{
  if (statuses.empty()) return;
  std::vector<unsigned char> flat;
  for (const auto& step : statuses)
    for (const ContactStatus status : step) flat.push_back(static_cast<unsigned char>(status));
  file.write("cycle/status", flat, statuses.front().size());
}

void write_response(Hdf5File& file, const Response& response, const Scene& scene)
{
  file.write("response/frequency", response.frequency_hz);
  for (std::size_t i = 0; i < response.excitations.size(); ++i)
    for (std::size_t j = 0; j < response.receptance[i].size(); ++j)
    {
      std::vector<double> flat;
      for (const std::complex<double>& value : response.receptance[i][j])
        flat.insert(flat.end(), {value.real(), value.imag()});
      const std::string& driven = scene.probes[static_cast<std::size_t>(response.excitations[i])].name;
      file.write("response/receptance/" + driven + "/" + scene.probes[j].name, flat, 2);
    }
}

} // namespace

void write_history(const Report& report, const Scene& scene, const std::filesystem::path& place)
{
  Hdf5File file(place, report.run, history_sets);
  const auto& [cycle, fidelity, settled, followed, attempts] = report.motion;
  if (has_run(report.transient.outcome)) write_group(file, "transient", report.transient.history, scene);
  if (has_run(cycle.outcome))
  {
    write_group(file, "cycle", cycle.measured.history, scene);
    write_statuses(file, cycle.measured.statuses);
  }
  if (has_run(settled.outcome))
  {
    write_group(file, "settled", settled.history, scene);
    file.write("settled/spectrum/frequency", settled.examined.spectrum.frequency_hz);
    file.write("settled/spectrum/amplitude", settled.examined.spectrum.amplitude);
    if (!scene.matrices) write_coordinates(file, settled);
  }
  if (has_run(report.response.outcome)) write_response(file, report.response, scene);
  file.keep();
}

} // namespace squeal
