#pragma once
/// All results of a run as one tree (report/result.hpp), and the rows of tables that report.json leaves out.
#include "result.hpp"
#include "squeal/report/report.hpp"

namespace squeal
{

/// The tree of report.json.
Result results_of(const Report& report, const Scene& scene);

/// A group for each mode of each point of a sweep, one without a mode for a point that failed.
Result sweep_modes(const Sweep& sweep, const Scene& scene, Content content);

/// A group for each random sample.
Result robustness_samples(const Robustness& robustness, const Scene& scene, Content content);

/// Adds one value a probe in a group of this name.
void add_probes(Entry out, const std::string& name, const char* meaning, const std::vector<double>& values);

/// Adds the values of multipliers with their errors.
void add_multipliers(Entry out, const char* name, const Multipliers& multipliers);

/// Adds the key of a number with the name that it has.
void add_key(Entry out, const char* meaning, const std::string& key);

// Each adds the results of a stage that has run.
void add_equilibrium(Entry out, const Report& report);
void add_modes(Entry out, const Report& report);
void add_estimate(Entry out, const Report& report);
void add_response(Entry out, const Report& report);
void add_transient(Entry out, const Report& report);
void add_cycle(Entry out, const Report& report);
void add_settled(Entry out, const Report& report);
void add_attractors(Entry out, const Report& report);
void add_branch(Entry out, const Report& report);
void add_sensitivity(Entry out, const Report& report);
void add_sweep(Entry out, const Report& report);
void add_robustness(Entry out, const Report& report);

/// Adds the attempts of the search for a motion, with why each ended.
void add_attempts(Entry out, const std::vector<Attempt>& attempts);

/// Adds the model on which the cycle was sought.
void add_fidelity(Entry out, const Fidelity& fidelity);

} // namespace squeal
