#pragma once
/// history.h5: histories of "transient", "cycle" and "settled" against time; the groups "branch" and "sweep".
#include "squeal/report/report.hpp"

namespace squeal
{

/// On rank 0 alone. Error: the file cannot be written.
void write_history(const Report& report, const Scene& scene, const std::filesystem::path& file);

} // namespace squeal
