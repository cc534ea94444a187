#pragma once
/// Frequency responses in report.json, in history.h5 and in the printed table.
#include "files.hpp"
#include "squeal/report/report.hpp"

#include <nlohmann/json_fwd.hpp>

namespace squeal
{

/// Adds what the responses are worth and their peaks to the entry, which has the outcome.
void add_response(const Response& response, const Scene& scene, nlohmann::ordered_json& entry);

/// The group "response": frequencies, and receptances as rows of a real and an imaginary part.
void write_response(Hdf5File& file, const Response& response, const Scene& scene);

/// The lines of the table after the outcome's.
std::vector<std::string> response_lines(const Response& response, const Scene& scene);

} // namespace squeal
