#pragma once
/// The model of a scene: from a mesh, from points and springs, or from matrices; everything after it is the same.
#include "squeal/contact/interface.hpp"
#include "squeal/report/report.hpp"
#include "squeal/scene/numbers.hpp"

#include <map>
#include <set>

namespace squeal
{

/// Gives the scene's contacts the drives of its rotors, which the mesh tells. Collective. Error: as of the mesh, the
/// structure and the interface; no mass. Rank 0 reads the mesh.
Model build_model(Scene& scene, MPI_Comm comm);

/// Models of a scene with other values of its numbers, on the same mesh and in the same layout. A part that no changed
/// number enters is shared with the scene's own model: the handles of matrices are then equal.
class NearbyModels
{
public:
  /// Borrows both.
  NearbyModels(const Model& model, const Scene& scene);

  /// Structure and contact with these values; all other numbers have the scene's. Collective. Error: as build_model, or
  /// they make no scene.
  Model at(std::span<const SceneNumber> numbers);

  MPI_Comm comm() const { return comm_; }

private:
  Model made_of_mesh(const Scene& scene, const std::set<Effect>& changed);
  const NumberedMesh& numbered(const Scene& scene);

  const Model& model_;
  const Scene& scene_;
  MPI_Comm comm_;
  std::optional<NumberedMesh> numbered_{}; // of the scene's own mesh, once a part is made of it
  ContactPairs pairs_{};
};

/// Description of the model, as far as it is known before anything is solved; warnings and length on rank 0.
/// Collective.
ModelSummary summary_of(const Model& model, const Scene& scene, MPI_Comm comm);

/// Adds to what probes read of an equilibrium by how much supports move their nodes [m].
void add_shifts(const Scene& scene, const Model& model, std::vector<double>& values);

/// The probes' values of a displacement [m], whole on every rank. Collective.
std::vector<double> probe_values(Mat probes, Vec u);

} // namespace squeal
