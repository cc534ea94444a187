/// history.h5: histories of transient, cycle and settled motion against time, responses, and columns of results.
#include "files.hpp"
#include "results.hpp"

#include <algorithm>
#include <cmath>

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

/// The spectrum of a settled motion, and its lines, strongest first.
void write_spectrum(Hdf5File& file, const Spectrum& spectrum)
{
  std::vector<double> frequency, amplitude;
  for (const Line& line : spectrum.lines)
  {
    frequency.push_back(line.frequency_hz);
    amplitude.push_back(line.amplitude);
  }
  file.write("settled/spectrum/frequency", spectrum.frequency_hz);
  file.write("settled/spectrum/amplitude", spectrum.amplitude);
  file.write("settled/spectrum/line_frequency", frequency);
  file.write("settled/spectrum/line_amplitude", amplitude);
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

/// Followed modes, points in rows and modes in columns; NaN where one was not found.
void write_tracks(Hdf5File& file, const Sweep& sweep)
{
  const std::size_t points = sweep.points.size(), tracks = static_cast<std::size_t>(sweep.tracks);
  std::vector<double> frequency(points * tracks, std::nan("")), growth = frequency, mac = frequency;
  for (std::size_t i = 0; i < points; ++i)
    for (const SweptMode& mode : sweep.points[i].modes)
    {
      if (mode.track < 0) continue;
      const std::size_t place = i * tracks + static_cast<std::size_t>(mode.track);
      frequency[place] = frequency_hz_of(mode.lambda);
      growth[place] = mode.lambda.real();
      mac[place] = mode.mac;
    }
  if (frequency.empty()) return;
  file.write("sweep/frequency", frequency, tracks);
  file.write("sweep/growth_rate", growth, tracks);
  file.write("sweep/mac", mac, tracks);
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
    write_spectrum(file, settled.examined.spectrum);
    if (!scene.matrices) write_coordinates(file, settled);
  }
  if (has_run(report.response.outcome)) write_response(file, report.response, scene);
  if (has_run(report.sweep.outcome)) write_tracks(file, report.sweep);
  const Result results = results_of(report, scene);
  for (const auto& [group, stage, name] : result_columns)
    if (const Result* list = results.part(stage)->part(name)) file.write_columns(group, *list);
  file.write_columns(sample_group, robustness_samples(report.robustness, scene, Content::results));
  file.keep();
}

} // namespace squeal
