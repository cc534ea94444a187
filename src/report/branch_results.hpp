#pragma once
/// The branch, and the motions that many starts lead to, in report.json, in history.h5 and in the printed table.
#include "files.hpp"
#include "squeal/report/report.hpp"

#include <nlohmann/json_fwd.hpp>

namespace squeal
{

/// Adds the branch to its entry, which has the outcome.
void add_branch(const BrakeBranch& branch, const Scene& scene, nlohmann::ordered_json& entry);

/// The values of multipliers with their errors.
nlohmann::ordered_json multiplier_list(const Multipliers& multipliers);

/// Adds the motions that the starts lead to.
void add_attractors(const Attractors& attractors, nlohmann::ordered_json& entry);

std::vector<std::string> attractor_lines(const Attractors& attractors);

void write_branch(Hdf5File& file, const BrakeBranch& branch, const Scene& scene);

/// The lines of the table after the outcome's.
std::vector<std::string> branch_lines(const BrakeBranch& branch, const Scene& scene);

} // namespace squeal
