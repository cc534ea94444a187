#pragma once
/// Why modes are unstable and what would change them (src/README.md, section 11). It gives derivatives of eigenvalues,
/// shares of the parts in energies, powers of contact and damping, and the effect of proposed changes.
#include "squeal/modes/modes.hpp"
#include "squeal/scene/numbers.hpp"

#include <functional>

namespace squeal
{

/// By one number of the scene, equilibrium included, closed pairs fixed.
struct NumberDerivative
{
  SceneNumber number;
  bool known = false;            // the closed pairs are the same on both sides
  std::complex<double> lambda{}; // d lambda / d number [1/s per unit of the number]
};

/// By what is added at a probe along its direction.
struct ProbeDerivative
{
  std::complex<double> mass, damping, stiffness; // d lambda / d of each [1/s per kg, N s/m, N/m]
};

/// A change with the eigenvalue that the derivatives predict and the one that the changed structure has.
struct ChangeEffect
{
  bool found = false; // the mode of the changed structure
  std::complex<double> predicted, computed;
};

/// The share of a table of the scene in the energies of a mode.
struct EnergyShare
{
  std::string table, name; // as SceneComponent; "contact": of pairs with a compliance
  double kinetic = 0, strain = 0;
};

/// Powers are over the mean energy (|lambda|^2 phi^H M phi + phi^H K phi)/4 of the motion [1/s]. K has the springs of
/// pairs with a compliance. Those of contacts are put in, and sums over the scene's contacts; a matrix scene has one.
struct ModeCauses
{
  std::complex<double> lambda;
  double backward_error = 0; // the larger one of the right and of the left vector
  MultiVector left{};        // real and imaginary part of psi, with psi'Q'(lambda) phi = 1 by the mode phi
  std::vector<NumberDerivative> numbers;
  std::vector<ProbeDerivative> probes;
  std::vector<EnergyShare> shares;             // their sums are one
  std::vector<double> pair_powers;             // by reactions that change, of each pair
  std::vector<double> contact_powers;          // the same of each contact
  std::vector<double> falling_friction_powers; // by the law: negative where friction rises with the speed
  std::vector<double> turning_friction_powers; // by the direction of friction, which damps: not positive
  double damping_power = 0;                    // that C and loss factors take
  double defect = 0;                           // all that is put in - damping_power - 2 Re(lambda)
  std::vector<ChangeEffect> changes;
};

/// outcome: "converged", "not converged" (vectors or a changed mode were not found), "refused", "skipped", "off".
struct Sensitivity
{
  Outcome outcome;
  std::vector<ModeCauses> modes; // the unstable ones, falling growth rate
};

/// The modes and what they are derived by.
struct SensitivityProblem
{
  SlidingEquilibrium sliding;
  const LinearisedSliding& linearised;
  const Modes& modes;
  std::vector<SceneNumber> numbers;
  std::vector<SceneComponent> components;
  std::vector<std::string> contacts;                               // names
  std::function<Model(std::span<const SceneNumber>)> model_with{}; // the scene with other values
  Mat probes = nullptr;                                            // a row a probe
  const std::vector<Change>& changes;
  std::vector<int> probes_of_changes; // their rows
  const ModesSettings& modes_settings;
  const ModesOptions& modes_options;
  const EquilibriumOptions& equilibrium_options;
};

/// Derivatives, energies, powers and changes of every unstable mode. Collective. Error: a number's value makes no
/// scene.
Sensitivity find_sensitivity(const SensitivityProblem& problem);

} // namespace squeal
