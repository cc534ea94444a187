#include "squeal/solver_options.hpp"

#include <algorithm>

namespace squeal
{

const SolverPrefix* solver_prefix_of(const std::string& name)
{
  const auto found =
      std::ranges::find_if(solver_prefixes, [&](const SolverPrefix& prefix) { return name.starts_with(prefix.text); });
  return found == solver_prefixes.end() ? nullptr : &*found;
}

std::string problem_of_solver_type(const std::string& name, const std::string& value)
{
  const bool needs_more =
      (name == "modes_pep_type" && value == "jd") || (name == "cycle_snes_type" && value == "aspin");
  return needs_more ? "option -" + name + " " + value + ": it needs more than an operator" : "";
}

} // namespace squeal
