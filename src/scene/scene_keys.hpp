#pragma once
/// The keys of a scene file as a tree. Each is bound to its member, or to tables of further keys, with unit, rule,
/// meaning and effect on the model. Reading, range checks, the resolved text, the numbers of studies and the page of
/// keys all go through this tree.
#include "squeal/scene/described.hpp"

namespace squeal
{

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

  /// Throws Error with the place of a member.
  [[noreturn]] void refuse(const void* member, const std::string& text) const;
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
void check_scene(Scene& scene, const Places& places);

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
