#pragma once
/// Numbers of a scene by their keys, for branches, sweeps and derivatives.
#include "squeal/scene/scene.hpp"

#include <span>

namespace squeal
{

/// A number of a scene, as overrides name it, and a value of it.
struct SceneNumber
{
  std::string key;
  double value = 0;
};

/// Numbers with these keys and values.
std::vector<SceneNumber> numbers_of(std::span<const std::string> keys, std::span<const double> values);

/// The table of named numbers, "numbers.clamp" is the key of one.
inline constexpr const char* named_numbers = "numbers.";

/// These numbers, with the keys where they stand in place of named ones.
std::vector<SceneNumber> driven_by(const Scene& scene, std::span<const SceneNumber> numbers);

/// The key of the friction coefficient.
inline constexpr const char* friction_coefficient_key = "friction.coefficient";

/// The parts of a model that a number of the scene enters: these are made again where it changes.
enum class Effect
{
  nothing,
  load,
  friction,           // its law
  gap,                // of contacts, and their compliance
  drive,              // of contacts, and the rows of pairs whose tangents turn with it
  damping,            // C, and the stiffness that loss factors multiply
  mass,               // M, and C by its part of M
  stiffness_and_mass, // M, C and K
  mesh,               // all: nodes, their numbering, the pairs
};

/// Returns the scene with other values of numbers that it has. Throws Error if that is no scene.
Scene scene_with(const Scene& scene, std::span<const SceneNumber> numbers);

/// A component with mass or stiffness of its own: a part, point, rigid body or spring. Twice the numbers `doubled`
/// double both. Without any it is the rest of the model: given matrices, or superelements.
struct SceneComponent
{
  std::string table, name;
  std::vector<SceneNumber> doubled{};
};

std::vector<SceneComponent> components_of(const Scene& scene);

/// Names of the contacts: "pad on disc".
std::vector<std::string> contact_names(const Scene& scene);

/// A number that is zero in the scene, with what it needs to be another one. A first loss factor needs a frequency of
/// its equivalent in time, on which modes do not depend.
std::vector<SceneNumber> from_zero(const Scene& scene, const SceneNumber& number);

/// A number as the table of keys describes it.
struct NumberDescription
{
  std::string unit; // "-" where it has none
  std::string name; // of what the key calls by its place alone, "part.0.young": of that part, or "pad on disc"
  Effect effect{};  // of a change: density changes the stiffness of a part that spins as well
};

NumberDescription description_of(const Scene& scene, const std::string& key);

/// The numbers with respect to which eigenvalues are derived, with the scene's values. They are those that it names,
/// else friction and what is not zero of parts, points, bodies, springs, damping and rates of rotation.
std::vector<SceneNumber> sensitive_numbers(const Scene& scene);

} // namespace squeal
