#pragma once
/// The motions of a sweep in report.json, in history.h5, in sweep_motions.csv and in the printed table.
#include "files.hpp"
#include "squeal/report/report.hpp"

#include <nlohmann/json_fwd.hpp>

namespace squeal
{

/// Whether any motion was sought.
bool has_motions(const Sweep& sweep);

nlohmann::ordered_json motion_entry(const SweptMotion& motion, const Scene& scene);

/// The group sweep/motion: one row a point, NaN where no motion was sought.
void write_motions(Hdf5File& file, const Sweep& sweep, const Scene& scene);

/// A line for each motion, with a head.
std::string motions_csv(const Sweep& sweep, const Scene& scene);

/// A line for each motion.
std::vector<std::string> motion_lines(const Sweep& sweep);

} // namespace squeal
