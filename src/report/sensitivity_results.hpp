#pragma once
/// Derivatives, energies and powers of the unstable modes in report.json and in the printed table.
#include "squeal/report/report.hpp"

#include <nlohmann/json_fwd.hpp>

namespace squeal
{

/// Adds the modes to the entry, which has the outcome.
void add_sensitivity(const Sensitivity& sensitivity, const Scene& scene, nlohmann::ordered_json& entry);

/// The lines of the table after the outcome's.
std::vector<std::string> sensitivity_lines(const Sensitivity& sensitivity, const Scene& scene);

} // namespace squeal
