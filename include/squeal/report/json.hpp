#pragma once
/// report.json: the run in numbers. On rank 0 alone.
#include "squeal/report/report.hpp"

namespace squeal
{

/// The whole report as JSON text: SI units, null for what is not a number. inputs/RESULTS.md lists the keys.
std::string report_json(const Report& report, const Scene& scene);

} // namespace squeal
