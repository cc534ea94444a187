#include "squeal/load_steps.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

/// The places of the bolts that a step tightens.
std::vector<std::size_t> bolts_of(const LoadStep& step, const Scene& scene)
{
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < scene.bolts.size(); ++i)
    if (std::ranges::count(step.bolts, scene.bolts[i].name) > 0) places.push_back(i);
  return places;
}

/// A path that shares its loads with this one.
std::vector<PathStep> sharing(const std::vector<PathStep>& path)
{
  std::vector<PathStep> result;
  for (const PathStep& step : path)
    result.push_back({step.name, shared(step.load.get()), step.driven_friction, step.bolts});
  return result;
}

} // namespace

std::vector<PathStep> path_to(Vec load, const Scene& scene, const LoadOf& load_of)
{
  std::vector<PathStep> path;
  for (const LoadStep& step : scene.steps)
  {
    Scene loaded = scene;
    for (std::size_t i = 0; i < loaded.forces.size(); ++i)
    {
      const double factor = step.load * (step.forces.empty() ? 1 : step.forces[i]);
      loaded.forces[i].vector = factor * loaded.forces[i].vector;
      loaded.forces[i].moment = factor * loaded.forces[i].moment;
    }
    for (std::size_t i = 0; i < loaded.pressures.size(); ++i)
      loaded.pressures[i].value *= step.load * (step.pressures.empty() ? 1 : step.pressures[i]);
    const bool is_last = &step == &scene.steps.back();
    path.push_back({step.name, is_last ? shared(load) : load_of(loaded, step), step.friction, bolts_of(step, scene)});
  }
  return path;
}

std::vector<PathStep> path_of_mesh(const Structure& structure, const Scene& scene, const NumberedMesh& numbered,
                                   MPI_Comm comm)
{
  Scene stepped = scene;
  const auto tightens = [](const LoadStep& step) { return !step.bolts.empty(); };
  if (!scene.bolts.empty() && std::ranges::none_of(scene.steps, tightens))
  {
    LoadStep first{"bolts", 0, {}, {}};
    for (const Bolt& bolt : scene.bolts) first.bolts.push_back(bolt.name);
    if (stepped.steps.empty()) stepped.steps.push_back({"load", 1, {}, {}});
    first.friction = stepped.steps.front().friction;
    stepped.steps.insert(stepped.steps.begin(), first);
  }
  return path_to(structure.load, stepped,
                 [&](const Scene& loaded, const LoadStep&)
                 {
                   Owned<Vec> load = assemble_load(numbered.mesh, loaded, numbered.dofs, comm);
                   if (structure.preload.get()) check(VecAXPY(load, 1, structure.preload));
                   return load;
                 });
}

void share_loads(const Structure& own, Structure& structure)
{
  structure.load = shared(own.load.get());
  structure.preload = shared(own.preload.get());
  structure.bolts.clear();
  for (const TightBolt& bolt : own.bolts)
    structure.bolts.push_back(
        {bolt.name, bolt.tension, shared(bolt.pull.get()), bolt.stiffness, bolt.own, bolt.shortening});
  structure.path = sharing(own.path);
}

} // namespace squeal
