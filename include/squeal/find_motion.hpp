#pragma once
/// The search for what vibrates: cycle, else settled motion (src/README.md, sections 6, 7.8 and 7.10). Ways are tried
/// in one order, each where it applies; every attempt is noted with why it ended. All functions are collective.
#include "squeal/model.hpp"
#include "squeal/point.hpp"
#include "squeal/report/report.hpp"

namespace squeal
{

/// The start that the scene gives the search, if it is not the modes.
struct MotionStart
{
  std::optional<State> given;
  std::string missing; // why it is not there; empty if it is
};

/// The start that the scene names: a file, or the end of the transient. Error: as of read_state.
MotionStart motion_start(const SlidingPoint& point, const Scene& scene, const Trajectory& transient);

/// Finds the cycle, and where none attracts the motion that is settled on. With "auto" the ways are gone through again
/// at four times the steps a period, while these may decide and are affordable.
Motion find_motion(const SlidingPoint& point, const MotionStart& start, const Scene& scene,
                   const ProgramOptions& options, const StageRunner& run);

// The stages beyond one motion that the scene asks for; each says why it does not run. All functions are collective.

/// Frequency responses of the scene's probes about the equilibrium.
Response run_response(const SlidingPoint& point, const Scene& scene, const ProgramOptions& options);

/// The motions that the scene's starts lead to.
Attractors run_attractors(const SlidingPoint& point, const Motion& motion, const Scene& scene,
                          const ProgramOptions& options);

/// The cycle's branch over a number of the scene.
BranchStudy run_branch(const SlidingPoint& point, const Motion& motion, const Scene& scene,
                       const ProgramOptions& options);

/// Derivatives of the unstable modes, and the effect of changes of the scene on them.
Sensitivity run_sensitivity(const SlidingPoint& point, const Scene& scene, const ProgramOptions& options);

/// Modes over numbers of the scene.
Sweep run_scene_sweep(const Model& model, const Scene& scene, const ProgramOptions& options);

/// How uncertain numbers of the scene change the modes.
Robustness run_robustness(const Model& model, const Scene& scene, const ProgramOptions& options);

} // namespace squeal
