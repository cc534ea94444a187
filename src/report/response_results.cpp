#include "response_results.hpp"

#include <nlohmann/json.hpp>

namespace squeal
{

namespace
{

using Json = nlohmann::ordered_json;

/// The largest |H| of a probe's response.
struct Peak
{
  double frequency_hz = 0, size = 0;
};

Peak peak_of(const Response& response, std::size_t excitation, std::size_t probe)
{
  Peak peak;
  const auto& values = response.receptance[excitation][probe];
  for (std::size_t f = 0; f < values.size(); ++f)
    if (std::abs(values[f]) > peak.size) peak = {response.frequency_hz[f], std::abs(values[f])};
  return peak;
}

const std::string& name_of(const Response& response, std::size_t excitation, const Scene& scene)
{
  return scene.probes[static_cast<std::size_t>(response.excitations[excitation])].name;
}

} // namespace

void add_response(const Response& response, const Scene& scene, Json& entry)
{
  entry["residual"] = response.outcome.residual;
  entry["change"] = response.change;
  entry["parts"] = response.parts;
  entry["shapes"] = response.shapes;
  entry["from_hz"] = response.frequency_hz.front();
  entry["to_hz"] = response.frequency_hz.back();
  entry["count"] = response.frequency_hz.size();
  entry["peaks"] = Json::array();
  for (std::size_t i = 0; i < response.excitations.size(); ++i)
    for (std::size_t j = 0; j < response.receptance[i].size(); ++j)
    {
      const Peak peak = peak_of(response, i, j);
      entry["peaks"].push_back({{"excitation", name_of(response, i, scene)},
                                {"probe", scene.probes[j].name},
                                {"frequency_hz", peak.frequency_hz},
                                {"receptance", peak.size}});
    }
}

void write_response(Hdf5File& file, const Response& response, const Scene& scene)
{
  file.write("response/frequency", {response.frequency_hz.size()}, response.frequency_hz, "Hz");
  for (std::size_t i = 0; i < response.excitations.size(); ++i)
    for (std::size_t j = 0; j < response.receptance[i].size(); ++j)
    {
      std::vector<double> flat;
      for (const std::complex<double>& value : response.receptance[i][j])
        flat.insert(flat.end(), {value.real(), value.imag()});
      file.write("response/receptance/" + name_of(response, i, scene) + "/" + scene.probes[j].name,
                 {flat.size() / 2, 2}, flat, "m/N");
    }
}

std::vector<std::string> response_lines(const Response& response, const Scene& scene)
{
  constexpr std::size_t shown = 6;
  std::vector<std::string> lines = {
      format("%zu frequencies from %.5g to %.5g Hz on bases of up to %d shapes: residuals "
             "%.1e of a unit force, changed by %.1e in the last pass",
             response.frequency_hz.size(), response.frequency_hz.front(), response.frequency_hz.back(), response.shapes,
             response.outcome.residual, response.change)};
  for (std::size_t i = 0; i < response.excitations.size(); ++i)
    for (std::size_t j = 0; j < response.receptance[i].size(); ++j)
    {
      const Peak peak = peak_of(response, i, j);
      lines.push_back(format("%s driven at %s: largest %.5g m/N at %.7g Hz", scene.probes[j].name.c_str(),
                             name_of(response, i, scene).c_str(), peak.size, peak.frequency_hz));
    }
  if (lines.size() <= shown + 1) return lines;
  lines.resize(shown + 1);
  lines.push_back("more are in report.json, all of them in history.h5");
  return lines;
}

} // namespace squeal
