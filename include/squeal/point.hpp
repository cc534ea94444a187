#pragma once
/// How a stage is run: it leaves its result, or why it has none.
#include "squeal/base/outcome.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/options.hpp"
#include "squeal/report/report.hpp"
#include "squeal/transient/sliding_point.hpp"

#include <functional>
#include <optional>

namespace squeal
{

/// Runs the work of a stage, which returns whether the end of the run cut it short. Returns why the stage has no
/// result; empty if it has one.
using StageRunner = std::function<std::string(Stage which, const std::function<bool()>& work)>;

/// The result of a stage that did not run, with the reason.
template <class Result> Result not_run(OutcomeKind kind, const std::string& reason)
{
  Result result;
  result.outcome = {kind, reason, 0, 0};
  return result;
}

/// The result of the work, or why there is none. A stage that is off is not begun; `off`: why, empty where it is not.
template <class Work> auto run_stage(const StageRunner& run, Stage which, const std::string& off, const Work& work)
{
  decltype(work()) result;
  if (!off.empty()) return not_run<decltype(work())>(OutcomeKind::off, off);
  const auto all = [&] { return result = work(), result.outcome.kind == OutcomeKind::interrupted; };
  const std::string left_out = run(which, all);
  if (!left_out.empty()) result = not_run<decltype(work())>(OutcomeKind::skipped, left_out);
  return result;
}

// The small motions about sliding that a scene asks for. All functions that find something are collective.

/// Finds the equilibrium of the model: a point that knows no small motions yet.
SlidingPoint find_sliding(const Model& model, const ProgramOptions& options, const StageRunner& run);

/// Adds what the scene's stages need of the small motions about the equilibrium. A run that goes on takes the modes of
/// its checkpoint.
SlidingPoint with_small_motions(SlidingPoint point, const Scene& scene, const ProgramOptions& options,
                                const StageRunner& run);

/// The unstable modes. Where none is, and the scene gives a state for the cycle, the one that decays slowest. A cycle
/// may attract beside a stable equilibrium.
std::span<const ComplexMode> followed_modes(const SlidingPoint& point, const Scene& scene);

/// Estimates the amplitude of one mode.
Estimate estimate_of(const SlidingPoint& point, const ComplexMode& mode);

/// Whether all of the modes that grow do so without oscillating.
bool only_diverges(std::span<const ComplexMode> unstable);

/// Why no motion can be sought from these modes; empty if one can. They may diverge without oscillating.
std::string no_mode_among(const SlidingPoint& point, std::span<const ComplexMode> modes);

/// Why a stage of unstable modes cannot run; empty if it can.
std::string no_unstable_mode(const SlidingPoint& point);

/// Why a stage that follows a mode cannot run; empty if it can.
std::string no_mode_to_follow(const SlidingPoint& point, const Scene& scene);

/// Whether a stage of the scene needs the modes.
bool seeks_modes(const Scene& scene);

/// The number of starts whose motions are sought: that of the scene. Else, where it costs little, each of several
/// growing modes, their pairs, random sums and a small motion. Beside stable sliding with falling friction, the mode
/// and random sums. Nothing: none are sought.
std::optional<int> starts_sought(const SlidingPoint& point, const Scene& scene);

/// Why a stage is off; empty where the scene asks for it, or the point does. `point`: as far as the stages before know
/// it.
std::string why_off(Stage which, const SlidingPoint& point, const Scene& scene);

/// Integrates the theta steps that the scene asks for, from its start.
Trajectory find_transient(const SlidingPoint& point, const Scene& scene, const ProgramOptions& options);

} // namespace squeal
