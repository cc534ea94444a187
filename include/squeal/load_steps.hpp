#pragma once
/// The loads of a model along the steps of its scene.
#include "squeal/solid/structure.hpp"

#include <functional>

namespace squeal
{

/// The load at the end of a step of a scene, given as the scene that has it.
using LoadOf = std::function<Owned<Vec>(const Scene& scene, const LoadStep& step)>;

/// The steps to `load`, at which the last one ends.
std::vector<PathStep> path_to(Vec load, const Scene& scene, const LoadOf& load_of);

/// The path of a mesh scene whose structure has its load and preload. Bolts that no step tightens are tightened before
/// the first one.
std::vector<PathStep> path_of_mesh(const Structure& structure, const Scene& scene, const NumberedMesh& numbered,
                                   MPI_Comm comm);

/// Shares load, preload, bolts and path.
void share_loads(const Structure& own, Structure& structure);

} // namespace squeal
