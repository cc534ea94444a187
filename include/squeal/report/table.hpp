#pragma once
/// The table a person reads at the end of a run.
#include "squeal/report/report.hpp"

namespace squeal
{

/// The printed table, line by line. On rank 0 alone.
std::string table(const Report& report, const Scene& scene);

} // namespace squeal
