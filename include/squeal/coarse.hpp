#pragma once
/// The scene on a coarser mesh, whose cycle starts the search for the scene's own (src/README.md, section 6.3).
#include "squeal/model.hpp"
#include "squeal/options.hpp"
#include "squeal/report/report.hpp"
#include "squeal/solid/interpolation.hpp"

namespace squeal
{

/// A scene with cycle.start = "coarse", on the coarser mesh that it names.
struct CoarseModel
{
  /// Collective. Throws Error for a mesh that cannot be read, is not of the same parts, or is not coarser.
  CoarseModel(const Scene& fine_scene, const Model& fine, MPI_Comm comm);

  Scene scene; // the chain to a cycle and nothing beyond it
  Model model;
  Interpolation interpolation; // to the fine mesh
};

/// The coarse mesh of the scene's start; none where the scene starts otherwise. Collective.
std::optional<CoarseModel> coarse_model_of(const Scene& scene, const Model& model);

/// Finds the cycle on the coarse mesh, at the steps a period with which the search at the fine point begins, and
/// carries it over. Its time is scaled by the frequencies of the two meshes' followed modes where these differ by at
/// most a tenth: a coarse mesh is too stiff. Collective.
CoarseStart find_coarse_start(const CoarseModel& coarse, const SlidingPoint& fine, const Scene& scene,
                              const ProgramOptions& options);

} // namespace squeal
