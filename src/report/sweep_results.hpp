#pragma once
/// The sweep in report.json, in history.h5, in sweep.csv and in the printed table.
#include "files.hpp"
#include "squeal/report/report.hpp"

#include <nlohmann/json_fwd.hpp>

namespace squeal
{

/// Adds the sweep to its entry, which has the outcome.
void add_sweep(const Sweep& sweep, const Scene& scene, nlohmann::ordered_json& entry);

void write_sweep(Hdf5File& file, const Sweep& sweep, const Scene& scene);

/// A line for each mode of each point, with a head; one without a mode for a point that failed.
std::string sweep_csv(const Sweep& sweep, const Scene& scene);

/// The lines of the table after the outcome's.
std::vector<std::string> sweep_lines(const Sweep& sweep, const Scene& scene);

/// Values as "0.3, 1e-6".
std::string text_of(const std::vector<double>& values);

} // namespace squeal
