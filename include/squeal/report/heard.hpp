#pragma once
/// One sentence that says what is heard, and whether it lasts.
#include "squeal/report/report.hpp"

namespace squeal
{

/// The last row of the table, and `heard` in report.json.
std::string heard(const Report& report, const Scene& scene);

} // namespace squeal
