#pragma once
/// A model at one set of scene numbers, with its small motions about sliding.
#include "squeal/base/constants.hpp"
#include "squeal/contact/interface.hpp"
#include "squeal/transient/estimate.hpp"

#include <cmath>

namespace squeal
{

/// A mode on the scene's mesh and on the finer one.
struct ModeOnFinerMesh
{
  std::complex<double> lambda, finer, held; // [1/s]; held: the finer one with the closed pairs of the scene's mesh
  double backward_error = 0;                // of the finer ones
  static constexpr double safety = 1.25;    // factor of the bar (Roache, J. Fluids Eng. 116 (1994) 405)
  std::complex<double> corrected() const { return finer + (held - lambda) / 2.; }
  /// The bar of `corrected`: of growth [1/s] in the real part, of angular frequency [rad/s] in the imaginary one.
  std::complex<double> bar() const
  {
    const std::complex<double> smooth = safety * (held - lambda) / 2., contact = finer - held;
    return {std::abs(smooth.real()) + std::abs(contact.real()), std::abs(smooth.imag()) + std::abs(contact.imag())};
  }

  /// Whether the limit may grow where the mode does not, or the other way.
  bool is_undecided() const { return (lambda.real() > 0 ? 1 : -1) * corrected().real() <= bar().real(); }
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
