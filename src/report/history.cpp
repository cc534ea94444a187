#include "squeal/report/history.hpp"

#include "branch_results.hpp"
#include "files.hpp"
#include "response_results.hpp"
#include "robustness_results.hpp"
#include "sweep_results.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

void write_group(Hdf5File& file, const std::string& group, const History& history, const Scene& scene)
{
  const auto write = [&](const std::string& name, const char* unit, const auto& series)
  { file.write(group + "/" + name, {series.size()}, series, unit); };
  for_each_series(write, history);
  const std::size_t probes = std::min(scene.probes.size(), history.probes.size());
  for (std::size_t i = 0; i < probes; ++i) write("probes/" + scene.probes[i].name, "m", history.probes[i]);
}

/// The spectrum of a settled motion, and its lines, strongest first. `unit`: of the amplitudes.
void write_spectrum(Hdf5File& file, const Spectrum& spectrum, const std::string& unit)
{
  const auto write = [&](const std::string& name, const std::vector<double>& data, const std::string& of)
  { file.write("settled/spectrum/" + name, {data.size()}, data, of); };
  write("frequency", spectrum.frequency_hz, "Hz");
  write("amplitude", spectrum.amplitude, unit);
  std::vector<double> frequency, amplitude;
  for (const Line& line : spectrum.lines)
  {
    frequency.push_back(line.frequency_hz);
    amplitude.push_back(line.amplitude);
  }
  write("line_frequency", frequency, "Hz");
  write("line_amplitude", amplitude, unit);
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
  file.write("settled/shapes/time", {time.size()}, time, "s");
  file.write("settled/shapes/coordinate", {time.size(), coordinates.size()}, rows, "m/s kg^1/2");
}

/// Steps in rows, pairs in columns; 0 open, 1 stick, 2 slip.
void write_statuses(Hdf5File& file, const std::vector<std::vector<ContactStatus>>& statuses)
{
  if (statuses.empty()) return;
  std::vector<unsigned char> flat;
  for (const auto& step : statuses)
    for (const ContactStatus status : step) flat.push_back(static_cast<unsigned char>(status));
  file.write("cycle/status", {statuses.size(), statuses.front().size()}, flat, "0 open, 1 stick, 2 slip");
}

} // namespace

void write_history(const Report& report, const Scene& scene, const std::filesystem::path& place)
{
  Hdf5File file(place, report.run);
  if (has_run(report.transient.outcome)) write_group(file, "transient", report.transient.history, scene);
  if (has_run(report.motion.cycle.outcome))
  {
    write_group(file, "cycle", report.motion.cycle.measured.history, scene);
    write_statuses(file, report.motion.cycle.measured.statuses);
  }
  if (has_run(report.motion.settled.outcome))
  {
    write_group(file, "settled", report.motion.settled.history, scene);
    write_spectrum(file, report.motion.settled.examined.spectrum, report.motion.settled.spectrum_probe < 0 ? "N" : "m");
    if (!scene.matrices) write_coordinates(file, report.motion.settled);
  }
  if (has_run(report.response.outcome)) write_response(file, report.response, scene);
  if (has_run(report.branch.outcome)) write_branch(file, report.branch, scene);
  if (has_run(report.sweep.outcome)) write_sweep(file, report.sweep, scene);
  if (has_run(report.robustness.outcome)) write_robustness(file, report.robustness);
  file.keep();
}

} // namespace squeal
