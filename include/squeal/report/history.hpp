#pragma once
/// history.h5: energies, powers, probes and contact counts against time, groups "transient" and "cycle".
#include "squeal/report/report.hpp"

namespace squeal
{

/// On rank 0 alone.
void write_history(const Report& report, const Scene& scene, const std::filesystem::path& file);

} // namespace squeal
