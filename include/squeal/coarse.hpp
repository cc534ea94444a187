#pragma once
/// The scene on a coarser mesh, whose cycle starts the search for the scene's own (src/README.md, section 6.3).
#include "squeal/model.hpp"
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

/// A cycle, and the equilibrium and the followed mode that belong to it.
struct CycleOfMesh
{
  const Equilibrium& equilibrium;
  const ComplexMode& followed;
  const State& state;
  double period = 0; // [s]
};

/// A start on the fine mesh.
struct CarriedCycle
{
  State state;
  double period = 0; // [s]
  int rounds = 1;    // as many as the period may be of the cycle
};

/// The cycle of the coarse mesh about the equilibrium of the fine one. Its time is scaled by the frequencies of the two
/// meshes' followed modes where these differ by at most a tenth: a coarse mesh is too stiff. Collective.
CarriedCycle carried_cycle(const CoarseModel& coarse, const CycleOfMesh& cycle, const Equilibrium& fine,
                           const ComplexMode& followed);

} // namespace squeal
