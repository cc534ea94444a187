#pragma once
/// The stages beyond one motion that the scene asks for; each says why it does not run. All functions are collective.
#include "squeal/find_motion.hpp"
#include "squeal/model.hpp"

namespace squeal
{

/// Frequency responses of the scene's probes about the equilibrium.
Response run_response(const SlidingPoint& point, const Scene& scene, const ProgramOptions& options);

/// The motions that the scene's starts lead to.
Attractors run_attractors(const SlidingPoint& point, const Motion& motion, const Scene& scene,
                          const ProgramOptions& options);

/// The cycle's branch over a number of the scene.
BrakeBranch run_branch(const SlidingPoint& point, const Motion& motion, const Scene& scene,
                       const ProgramOptions& options);

/// Derivatives of the unstable modes, and the effect of changes of the scene on them.
Sensitivity run_sensitivity(const SlidingPoint& point, const Scene& scene, const ProgramOptions& options);

/// Modes over numbers of the scene.
Sweep run_scene_sweep(const Model& model, const Scene& scene, const ProgramOptions& options);

/// How uncertain numbers of the scene change the modes.
Robustness run_robustness(const Model& model, const Scene& scene, const ProgramOptions& options);

} // namespace squeal
