#pragma once
/// The keys of a scene file, described once: reading, range checks, the resolved text and the reference all follow
/// this description. A field binds a key to the member it fills, with its unit, rule and meaning.
#include "squeal/scene/scene.hpp"

#include <variant>

namespace squeal
{

/// alpha or beta of an optional damping; either of them brings it into being.
struct DampingTarget
{
  std::optional<RayleighDamping>* damping;
  double RayleighDamping::*member;
};

using Target =
    std::variant<double*, int*, long*, bool*, std::string*, std::filesystem::path*, Vec3*, std::optional<Vec3>*,
                 std::vector<Vec3>*, std::vector<std::string>*, std::array<double, 6>*, Motions*,
                 std::map<std::string, double>*, std::optional<Rotation>*, DampingTarget, Start*, Choice>;

enum class Need
{
  optional,
  required,
};

/// What a value must satisfy; every number must be finite besides.
enum class Rule
{
  any,
  positive,
  not_negative,
  poisson,   // in (-1, 0.5)
  fraction,  // in [0, 1]
  direction, // a vector, made a unit one; "x", "-y", … for short
  file,      // an existing file
  folder,    // an existing folder
};

struct Field
{
  std::string key;
  Target target;
  Need need;
  Rule rule;
  std::string unit;
  std::string meaning;
};

using Fields = std::vector<Field>;

/// Whether a field's unit is a physical one, not a word for the kind of value.
bool has_unit(const std::string& unit);

Fields fields(Scene& scene); // keys outside any table
Fields fields(MeshSource& mesh);
Fields fields(std::filesystem::path& matrices);
Fields fields(Part& part);
Fields fields(Point& point);
Fields fields(RigidBody& body);
Fields fields(Spring& spring);
Fields fields(Support& support);
Fields fields(Force& force);
Fields fields(Pressure& pressure);
Fields fields(Rotation& rotation);
Fields fields(Contact& contact);
Fields fields(FrictionLaw& friction);
Fields fields(RayleighDamping& damping);
Fields fields(ModesSettings& modes);
Fields fields(EstimateSettings& estimate);
Fields fields(TransientSettings& transient);
Fields fields(CycleSettings& cycle);
Fields fields(Probe& probe);

/// The tables of a scene file in the order they are written: visit(key, member, meaning). A vector is a list of tables
/// [[key]], an optional a table that may be missing, anything else a table with defaults.
template <class Visit> void for_each_table(Scene& scene, Visit visit)
{
  visit("mesh", scene.mesh, "a mesh and how to read it");
  visit("matrices", scene.matrices, "matrices of another code instead of a mesh");
  visit("part", scene.parts, "a named volume of the mesh, or a named surface with a thickness (shell)");
  visit("point", scene.points, "a node of its own: a point mass, or where springs meet");
  visit("rigid_body", scene.rigid_bodies, "named surfaces that move as one rigid body");
  visit("spring", scene.springs, "spring and dashpot between two points or rigid bodies, or to \"ground\"");
  visit("support", scene.supports, "motions of a named group or point held still");
  visit("force", scene.forces, "force on a point, a rigid body or a named group");
  visit("pressure", scene.pressures, "pressure on a named surface");
  visit("contact", scene.contacts, "two named surfaces of matching meshes, or two points, in contact with friction");
  visit("friction", scene.friction, "Coulomb's law at every contact");
  visit("damping", scene.damping, "Rayleigh damping C = alpha M + beta K of parts that give none of their own");
  visit("modes", scene.modes, "stability of the sliding equilibrium");
  visit("estimate", scene.estimate, "energy estimate of the cycle's amplitude");
  visit("transient", scene.transient, "time integration; runs when the table is present");
  visit("cycle", scene.cycle, "limit cycle by shooting; runs when the table is present");
  visit("probe", scene.probes, "a displacement that is watched in time");
}

/// Where each value was given, by the address of the member it fills: "scene.toml, line 12" or "--set key=value".
struct Places
{
  std::string file;
  std::map<const void*, std::string> given;

  std::string at(const void* member) const;
};

/// Throws Error on what no single key can tell: names that are not defined or doubled, tables that exclude each other.
void check_scene(const Scene& scene, const Places& places);

} // namespace squeal
