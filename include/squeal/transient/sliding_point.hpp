#pragma once
/// A model at one set of scene numbers, with its small motions about sliding.
#include "squeal/base/constants.hpp"
#include "squeal/contact/model.hpp"
#include "squeal/transient/estimate.hpp"

#include <cmath>

namespace squeal
{

/// A mode on the scene's mesh and on the finer one.
struct ModeOnFinerMesh
{
  std::complex<double> lambda, finer; // [1/s]
  double backward_error = 0;          // of the finer one; NaN: it was not found

  std::complex<double> corrected() const { return finer + (finer - lambda) / 2.; }
  double growth_bar() const { return std::abs((finer - lambda).real()) / 2; }               // [1/s] of the corrected
  double frequency_bar() const { return std::abs((finer - lambda).imag()) / (2 * two_pi); } // [Hz]

  /// Whether the limit may grow where the mode does not, or the other way.
  bool is_undecided() const { return is_known() && (lambda.real() > 0 ? 1 : -1) * corrected().real() <= growth_bar(); }
  bool is_known() const { return !std::isnan(backward_error); }
};

/// The modes about which the mesh was asked (squeal/mesh_error.hpp).
struct MeshError
{
  Outcome outcome{OutcomeKind::off, "", 0, 0};
  PetscInt dofs = 0; // of the finer model
  std::vector<ModeOnFinerMesh> modes{};
};

/// Complete once it is returned; no stage changes it. Each part that was not found says why.
struct SlidingPoint
{
  const Model* model = nullptr;
  Equilibrium equilibrium;
  std::optional<LinearisedSliding> linearised; // where there is an equilibrium and a stage of the scene needs it
  Modes modes;
  MeshError mesh_error{};
  std::vector<Estimate> estimates; // of the modes that grow; else of the one that is followed, or one that says why not

  SlidingEquilibrium sliding() const { return {model->structure, model->interface, equilibrium}; }
};

} // namespace squeal
