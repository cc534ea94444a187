#pragma once
/// The keys of a scene file as a tree: each is bound to the member that it fills, or to tables of further keys, with
/// its unit, rule, meaning and effect on the model. Reading, range checks, the resolved text, the numbers of studies
/// and the page of keys all go through this tree.
#include "squeal/scene/numbers.hpp"

#include <functional>
#include <variant>

namespace squeal
{

/// A number or a table of an optional part. Setting one of them creates the part.
template <class Part, class Member> struct MemberTarget
{
  std::optional<Part>* part;
  Member Part::*member;
};

using DampingTarget = MemberTarget<RayleighDamping, double>;
using FrictionTarget = MemberTarget<FrictionLaw, double>;
using FrictionTableTarget = MemberTarget<FrictionLaw, FactorTable>;

/// The start of a motion: one of the words, or a state file, which the last word stands for.
struct StartTarget
{
  Choice kind;
  std::filesystem::path* file;
};

/// How a table is written.
enum class TableForm
{
  single, // [key]
  list,   // [[key]]
  braces, // key = { … }
};

struct TableEntry;

/// Tables of further keys: one that is always there, one that may be missing, or a list.
struct TableTarget
{
  TableForm form{};
  std::function<std::size_t()> size;
  std::function<void(std::size_t)> resize; // makes entries with the defaults of tables that a file has
  std::function<TableEntry(std::size_t)> entry;
};

/// The member that a key fills.
using Target = std::variant<double*, int*, long*, bool*, std::string*, std::filesystem::path*, Vec3*,
                            std::optional<Vec3>*, std::vector<Vec3>*, std::vector<std::string>*, std::vector<double>*,
                            std::array<double, 6>*, Motions*, std::map<std::string, double>*, FactorTable*,
                            DampingTarget, FrictionTarget, FrictionTableTarget, StartTarget, Choice, TableTarget>;

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
  velocity,  // a vector; zero: none
  inertia,   // moments xx, yy, zz, none negative, and products
  file,      // an existing file
  folder,    // an existing folder
};

struct SceneKey
{
  SceneKey() = default;

  /// `properties`: Need, Rule and Effect where they are not the first ones.
  template <class... Properties>
  SceneKey(const char* name_, Target target_, const char* unit_, const char* meaning_, Properties... properties)
      : name(name_), target(std::move(target_)), unit(unit_), meaning(meaning_)
  {
    (take(properties), ...);
  }

  std::string name;
  Target target;
  std::string unit; // a physical unit, or a word for the kind of value
  std::string meaning;
  Need need{};
  Rule rule{};
  Effect effect{}; // of a number

private:
  void take(Need property) { need = property; }
  void take(Rule property) { rule = property; }
  void take(Effect property) { effect = property; }
};

using SceneKeys = std::vector<SceneKey>;

/// One entry of a table.
struct TableEntry
{
  const void* member; // that the entry is
  std::string name;   // of its key `name`; empty: it has none
  std::string title;  // its name, or what it is between or on
  SceneKeys keys;
};

/// "[part]", "[[part]]" or "part".
std::string heading_of(const SceneKey& table);

/// Names an entry of a table in messages, with a blank at the end; `label`: of the table that the key is in.
std::string label_of(const SceneKey& table, const std::string& name, const std::string& label);

/// Whether an optional value is not there.
bool is_absent(const SceneKey& key);

/// Whether a key's unit is a physical one.
bool has_unit(const std::string& unit);

/// Returns the keys of a scene file, its tables in the order in which they are written.
SceneKeys keys_of(Scene& scene);

/// Keys of what joins bodies and moves them.
SceneKeys keys_of(Axis& axis);
SceneKeys keys_of(Coupling& coupling);
SceneKeys keys_of(Connector& connector);
SceneKeys keys_of(Beam& beam);
SceneKeys keys_of(AddedMass& mass);
SceneKeys keys_of(Bolt& bolt);
SceneKeys keys_of(Rotor& rotor);

/// Keys of the tables of stages and studies.
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

/// Places where values were given, for messages: "scene.toml, line 12" or "--set key=value".
struct Places
{
  std::string file;
  std::map<const void*, std::string> given; // by the address of the member

  /// Returns the place of a member; the file if it was not given.
  std::string at(const void* member) const;
};

/// Places of a scene that was checked: what it needs is given, in its file.
Places places_of(const Scene& scene);

/// The names of a list's entries.
template <class Entry> std::vector<std::string> names_of(const std::vector<Entry>& list)
{
  std::vector<std::string> names;
  for (const Entry& entry : list) names.push_back(entry.name);
  return names;
}

/// Throws Error on contradictions between keys: undefined or repeated names, tables that exclude each other.
void check_scene(const Scene& scene, const Places& places);

/// Throws Error on contradictions in what joins bodies, in the frames of supports and in loss factors.
void check_joining(const Scene& scene, const Places& places);

/// Gives contacts that a rotor drives its drive.
void take_drives(Scene& scene);

/// Gives undriven contacts without a friction of their own that of the scene, which sweeps then change elsewhere alone.
void resolve_friction(Scene& scene);

/// Finds the scene's own value of the number that a branch follows. Throws Error if there is none, or no branch from
/// it.
void resolve_branch(Scene& scene, const Places& places);

/// Gives every number of a sweep its points. Throws Error if there is no such number, or its values make no scene.
void resolve_sweep(Scene& scene, const Places& places);

/// Throws Error where a number of the sensitivity is none of the scene, or a change is at no probe or changes nothing.
void check_sensitivity(const Scene& scene, const Places& places);

/// Gives every random number its mean. Throws Error if there is no such number, or its values make no scene.
void resolve_robustness(Scene& scene, const Places& places);

} // namespace squeal
