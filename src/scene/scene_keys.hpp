#pragma once
/// The keys of a scene file, each bound to the member it fills, with its unit, rule, meaning and effect on the model.
/// Reading, range checks, the resolved text and the reference all use this one description.
#include "squeal/scene/numbers.hpp"

#include <variant>

namespace squeal
{

/// alpha or beta of an optional damping. Setting either of them creates the damping.
struct DampingTarget
{
  std::optional<RayleighDamping>* damping;
  double RayleighDamping::*member;
};

/// The member that a key fills.

using Target = std::variant<double*, int*, long*, bool*, std::string*, std::filesystem::path*, Vec3*,
                            std::optional<Vec3>*, std::vector<Vec3>*, std::vector<std::string>*, std::vector<double>*,
                            std::vector<int>*, std::array<double, 6>*, Motions*, std::map<std::string, double>*,
                            std::optional<Rotation>*, std::optional<Orthotropy>*, TimeFactor*, DampingTarget, Start*,
                            CycleStart*, std::vector<MeasuredRatio>*, Choice>;

/// Whether a key must be given.
enum class Need
{
  optional,
  required,
};

/// Condition on a value. In addition every number must be finite.
enum class Rule
{
  any,
  positive,
  not_negative,
  poisson,   // in (-1, 0.5)
  fraction,  // in (0, 1]
  direction, // a vector that is normalised, or "x", "-y" and so on
  file,      // an existing file
  folder,    // an existing folder
};

struct SceneKey
{
  std::string name;
  Target target;
  Need need;
  Rule rule;
  std::string unit; // a physical unit, or a word for the kind of value
  std::string meaning;
  Effect effect = Effect::nothing; // of a number
};

using SceneKeys = std::vector<SceneKey>;

/// Whether a key's unit is a physical one.
bool has_unit(const std::string& unit);

/// Returns the keys of a table, bound to its members.
SceneKeys keys_of(Scene& scene); // the keys outside any table
SceneKeys keys_of(MeshSource& mesh);
SceneKeys keys_of(std::filesystem::path& matrices);
SceneKeys keys_of(Part& part);
SceneKeys keys_of(Orthotropy& orthotropy);
SceneKeys keys_of(Point& point);
SceneKeys keys_of(RigidBody& body);
SceneKeys keys_of(Spring& spring);
SceneKeys keys_of(Superelement& superelement);
SceneKeys keys_of(Support& support);
SceneKeys keys_of(Force& force);
SceneKeys keys_of(Pressure& pressure);
SceneKeys keys_of(Rotation& rotation);
SceneKeys keys_of(Contact& contact);
SceneKeys keys_of(Tie& tie);
SceneKeys keys_of(FrictionLaw& friction);
SceneKeys keys_of(RayleighDamping& damping);
SceneKeys keys_of(ModesSettings& modes);
SceneKeys keys_of(EstimateSettings& estimate);
SceneKeys keys_of(TransientSettings& transient);
SceneKeys keys_of(CycleSettings& cycle);
SceneKeys keys_of(BranchSettings& branch);
SceneKeys keys_of(SweepSettings& sweep);
SceneKeys keys_of(SensitivitySettings& sensitivity);
SceneKeys keys_of(Change& change);
SceneKeys keys_of(ResponseSettings& response);
SceneKeys keys_of(RobustnessSettings& robustness);
SceneKeys keys_of(UncertainNumber& number);
SceneKeys keys_of(Probe& probe);

/// Calls visit(key, member, meaning) for each table of a scene file, in the order in which they are written.
/// A vector is a list of tables [[key]], an optional is a table that may be missing, all else a table with defaults.
template <class AnyScene, class Visit> void for_each_table(AnyScene& scene, Visit visit)
{
  visit("mesh", scene.mesh, "a mesh and how to read it");
  visit("matrices", scene.matrices, "matrices of another code instead of a mesh");
  visit("part", scene.parts, "a named volume of the mesh, or a named surface with a thickness (shell)");
  visit("point", scene.points, "a node of its own: a point mass, or an end of springs");
  visit("rigid_body", scene.rigid_bodies, "named surfaces that move as one rigid body");
  visit("spring", scene.springs, "spring and dashpot between two points or rigid bodies, or to \"ground\"");
  visit("superelement", scene.superelements, "a reduced structure of another code, joined to nodes");
  visit("support", scene.supports, "fixed motions of a named group or point");
  visit("force", scene.forces, "force on a point, a rigid body or a named group");
  visit("pressure", scene.pressures, "pressure on a named surface");
  visit("contact", scene.contacts, "two named surfaces or two points in contact with friction");
  visit("tie", scene.ties, "two named surfaces of parts meshed apart that move as one");
  visit("friction", scene.friction, "Coulomb's law at every contact");
  visit("damping", scene.damping, "Rayleigh damping C = alpha M + beta K of parts that give none of their own");
  visit("modes", scene.modes, "stability of the sliding equilibrium");
  visit("estimate", scene.estimate, "energy estimate of the cycle's amplitude");
  visit("transient", scene.transient, "time integration; runs when the table is present");
  visit("cycle", scene.cycle, "limit cycle by shooting; runs when the table is present");
  visit("branch", scene.branch, "the limit cycle along a number of the scene; runs when the table is present");
  visit("sweep", scene.sweep, "stability at many values of one or two numbers; runs when the table is present");
  visit("sensitivity", scene.sensitivity,
        "derivatives, energies and powers of the unstable modes; runs when the table is present");
  visit("change", scene.changes, "a mass, damper or spring proposed at a probe, predicted and computed");
  visit("response", scene.response, "frequency responses about steady sliding; runs when the table is present");
  visit("robustness", scene.robustness, "probability of unstable modes; runs when the table is present");
  visit("uncertain", scene.uncertain, "a number of the scene that is random in [robustness]");
  visit("probe", scene.probes, "a displacement that is recorded in time");
}

/// Places where values were given, for messages: "scene.toml, line 12" or "--set key=value".
struct Places
{
  std::string file;
  std::map<const void*, std::string> given; // by the address of the member

  /// Returns the place of a member; the file if it was not given.
  std::string at(const void* member) const;
};

/// Throws Error on contradictions between keys: undefined or repeated names, tables that exclude each other.
void check_scene(const Scene& scene, const Places& places);

/// Finds the scene's own value of the number that a branch follows. Throws Error if there is none, or no branch from
/// it.
void resolve_branch(Scene& scene, const Places& places);

/// Gives every number of a sweep its points. Throws Error if there is no such number, or its values make no scene.
void resolve_sweep(Scene& scene, const Places& places);

/// Throws Error where a number of the sensitivity is none of the scene, or a change is at no probe or changes nothing.
void check_sensitivity(const Scene& scene, const Places& places);

/// Fits the scene's Rayleigh damping to the measured ratios, where there are some. Throws Error where it is given too.
void fit_damping(Scene& scene, const Places& places);

/// Gives every random number its mean. Throws Error if there is no such number, or its values make no scene.
void resolve_robustness(Scene& scene, const Places& places);

} // namespace squeal
