#pragma once
/// The model of a scene, which every stage works on.
#include "squeal/contact/interface.hpp"
#include "squeal/mesh/contact_pairs.hpp"

namespace squeal
{

/// A model in all its parts.
struct Model
{
  // On rank 0; empty on a matrix scene. Scenes with stages that make models on groups of ranks, [sweep] and
  // [robustness], have the mesh on every rank.
  Mesh mesh;
  DofMap dofs; // rank 0's; elsewhere its size alone
  Structure structure;
  Interface interface;
  std::vector<Coverage> coverage; // one a contact; empty on a matrix scene
  Owned<Mat> probes;              // a row per probe of the scene
};

} // namespace squeal
