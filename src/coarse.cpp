#include "squeal/coarse.hpp"

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
  coarse.cycle.coarse_parameters.clear();
  coarse.cycle.coarse_mesh.clear();
  coarse.cycle.save_state.clear();
  coarse.cycle.starts = 0;
  coarse.transient = {};
  coarse.branch.reset();
  coarse.sweep.reset();
  coarse.sensitivity.reset();
  coarse.robustness.reset();
  coarse.changes.clear();
  coarse.probes.clear();
  return coarse;
}

/// The model on the coarse mesh; messages say which mesh they are about.
Model coarse_model(const Scene& scene, const Model& fine, MPI_Comm comm)
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

CarriedCycle carried_cycle(const CoarseModel& coarse, const CycleOfMesh& cycle, const Equilibrium& fine,
                           const ComplexMode& followed)
{
  constexpr double same_mode = 0.1;
  const double ratio = followed.frequency_hz() / cycle.followed.frequency_hz();
  const double faster = std::abs(ratio - 1) < same_mode ? ratio : 1;
  const Owned<Vec> moved = copy_of(cycle.state.u.get());
  check(VecAXPY(moved, -1, cycle.equilibrium.u));
  CarriedCycle carried{{zeros_like(fine.u), zeros_like(fine.u), 0, fine.reactions}, cycle.period / faster};
  coarse.interpolation.apply(moved, carried.state.u);
  check(VecAXPY(carried.state.u, 1, fine.u));
  coarse.interpolation.apply(cycle.state.v, carried.state.v);
  check(VecScale(carried.state.v, faster));
  return carried;
}

} // namespace squeal
