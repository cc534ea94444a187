#pragma once
/// A model at one set of scene numbers, with its small motions about sliding.
#include "squeal/contact/model.hpp"
#include "squeal/transient/estimate.hpp"

namespace squeal
{

/// Complete once it is returned; no stage changes it. Each part that was not found says why.
struct SlidingPoint
{
  const Model* model = nullptr;
  Equilibrium equilibrium;
  std::optional<LinearisedSliding> linearised; // where there is an equilibrium and a stage of the scene needs it
  Modes modes;
  std::vector<Estimate> estimates; // of the modes that grow; else of the one that is followed, or one that says why not

  SlidingEquilibrium sliding() const { return {model->structure, model->interface, equilibrium}; }
};

} // namespace squeal
