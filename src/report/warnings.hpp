#pragma once
/// Sentences for readers whom a stage's numbers would mislead, in the table and in report.json alike.
#include "squeal/report/report.hpp"

namespace squeal
{

/// By stages; most runs have none.
struct Warnings
{
  std::vector<std::string> equilibrium, modes, response, estimate, transient, cycle;
};

Warnings warnings_of(const Report& report);

} // namespace squeal
