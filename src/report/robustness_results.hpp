#pragma once
/// The probabilities of unstable modes in report.json, in history.h5, in robustness.csv and in the printed table.
#include "files.hpp"
#include "squeal/report/report.hpp"

#include <nlohmann/json_fwd.hpp>

namespace squeal
{

/// Adds the probabilities to their entry, which has the outcome.
void add_robustness(const Robustness& robustness, const Scene& scene, nlohmann::ordered_json& entry);

void write_robustness(Hdf5File& file, const Robustness& robustness);

/// A line for each sample, with a head.
std::string robustness_csv(const Robustness& robustness, const Scene& scene);

/// The lines of the table after the outcome's.
std::vector<std::string> robustness_lines(const Robustness& robustness, const Scene& scene);

} // namespace squeal
