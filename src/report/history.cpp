/// history.h5: histories of transient, cycle and settled motion against time, and responses.
#include "files.hpp"

#include <algorithm>

namespace squeal
{

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
