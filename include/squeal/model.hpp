#pragma once
/// The model of a scene: from a mesh, from points and springs, or from matrices; everything after it is the same.
#include "squeal/contact/model.hpp"
#include "squeal/report/report.hpp"
#include "squeal/scene/numbers.hpp"

namespace squeal
{

/// Collective. Error: as of the mesh, the structure and the interface; no mass. Rank 0 reads and numbers the mesh.
Model build_model(const Scene& scene, MPI_Comm comm);

/// The model of a scene on the same mesh, in the same layout. Collective.
Model rebuild_model(const Model& model, const Scene& scene, MPI_Comm comm);

/// Structure and contact of the scene with other values of its numbers, likewise. Collective.
BrakeModel model_with(const Model& model, const Scene& scene, std::span<const SceneNumber> numbers, MPI_Comm comm);

/// What the model is, as far as it is known before anything is solved; warnings and length on rank 0. Collective.
ModelSummary summary_of(const Model& model, const Scene& scene, MPI_Comm comm);

/// What the probes read of a displacement [m], whole on every rank. Collective.
std::vector<double> probe_values(Mat probes, Vec u);

} // namespace squeal
