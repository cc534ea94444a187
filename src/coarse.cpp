#include "squeal/coarse.hpp"

#include "squeal/base/checkpoint.hpp"
#include "squeal/find_motion.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// The scene on its coarse mesh, up to the cycle.
Scene scene_on_coarse_mesh(const Scene& scene)
{
  Scene coarse = scene;
  const CycleSettings& given = scene.cycle;
  if (given.coarse_mesh.empty())
    for (const auto& [name, value] : given.coarse_parameters) coarse.mesh->parameters[name] = value;
  else
  {
    coarse.mesh->file = given.coarse_mesh;
    coarse.mesh->parameters = given.coarse_parameters;
  }
  coarse.cycle.start = {};
  coarse.cycle.save_state.clear();
  coarse.probes.clear();
  return coarse;
}

/// The model on the coarse mesh; messages say which mesh they are about.
Model coarse_model(Scene& scene, const Model& fine, MPI_Comm comm)
{
  const std::string label = "cycle.start = \"coarse\": ";
  Model model;
  try
  {
    model = build_model(scene, comm);
  }
  catch (const Error& error) // on every rank alike
  {
    throw Error(label + error.what());
  }
  if (model.dofs.size >= fine.dofs.size)
    throw Error(label + format("the coarse mesh has %lld degrees of freedom, the scene's own %lld: change "
                               "cycle.coarse_parameters or cycle.coarse_mesh to a coarser one",
                               static_cast<long long>(model.dofs.size), static_cast<long long>(fine.dofs.size)));
  return model;
}

} // namespace

CoarseModel::CoarseModel(const Scene& fine_scene, const Model& fine, MPI_Comm comm)
    : scene(scene_on_coarse_mesh(fine_scene)), model(coarse_model(scene, fine, comm)),
      interpolation({model.mesh, model.dofs}, {fine.mesh, fine.dofs}, scene, comm)
{
}

std::optional<CoarseModel> coarse_model_of(const Scene& scene, const Model& model)
{
  if (!scene.cycle.enabled || scene.cycle.start.kind != CycleStartKind::coarse) return {};
  return std::optional<CoarseModel>(std::in_place, scene, model, comm_of(model.structure.load));
}

namespace
{

/// The cycle of the coarse mesh about the equilibrium of the fine one.
GivenStart carried(const Interpolation& interpolation, const SlidingPoint& coarse, const LimitCycle& cycle,
                   const SlidingPoint& fine)
{
  constexpr double same_mode = 0.1;
  const double ratio = fine.modes.modes.front().frequency_hz() / coarse.modes.modes.front().frequency_hz();
  const double faster = std::abs(ratio - 1) < same_mode ? ratio : 1;
  const Vec rest = fine.equilibrium.u;
  const Owned<Vec> moved = copy_of(cycle.measured.start.u.get());
  check(VecAXPY(moved, -1, coarse.equilibrium.u));
  GivenStart start{{zeros_like(rest), zeros_like(rest), 0, fine.equilibrium.reactions}, cycle.orbit.period / faster};
  interpolation.apply(moved, start.state.u);
  check(VecAXPY(start.state.u, 1, rest));
  interpolation.apply(cycle.measured.start.v, start.state.v);
  check(VecScale(start.state.v, faster));
  return start;
}

} // namespace

CoarseStart find_coarse_start(const CoarseModel& coarse, const SlidingPoint& fine, const Scene& scene,
                              const ProgramOptions& options)
{
  const std::string reason = no_mode_to_follow(fine, scene);
  if (!reason.empty()) return not_run<CoarseStart>(OutcomeKind::skipped, reason);
  Scene coarse_scene = coarse.scene;
  const CycleSettings chosen = first_settings(fine, scene, options);
  constexpr double tolerance = 1e-3; // the mesh's own error is larger
  coarse_scene.cycle.steps_per_period = chosen.steps_per_period;
  coarse_scene.cycle.tolerance = std::max(chosen.tolerance, tolerance);
  ProgramOptions coarse_options = options;
  coarse_options.cycle.shooting.multipliers = 0;
  const Finally end = without_checkpoints(); // of the fine mesh
  const SlidingPoint point = find_point(coarse.model, coarse_scene, coarse_options, within_a_stage);
  const LimitCycle cycle = find_cycle(point, coarse_scene, coarse_options);
  CoarseStart start{cycle.outcome, coarse.model.dofs.size, coarse.model.interface.pairs};
  if (!has_run(cycle.outcome)) start.outcome.kind = OutcomeKind::not_converged;
  if (start.outcome.kind != OutcomeKind::converged) return start;
  start.period = cycle.orbit.period;
  start.mean_fluctuating_energy = cycle.measured.mean_fluctuating_energy;
  start.periods = cycle.convergence.periods;
  start.carried = carried(coarse.interpolation, point, cycle, fine);
  return start;
}

} // namespace squeal
