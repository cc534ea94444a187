#pragma once
/// Numbers of a scene as the members that the scene's keys bind, with messages about those that are not there.
#include "scene_keys.hpp"
#include "squeal/base/error.hpp"

namespace squeal
{

/// A value that a key leads to in a scene.
struct FoundValue
{
  bool is_there = false;
  double* number = nullptr;    // null: it is none
  std::span<double> entries{}; // of the list that the number is in; empty: it is a value of its own
  SceneKey key{};
  std::string label{}; // of the key's table
  std::string title{}; // of the entry of a list that its place selects, not its name
  std::string unit = "-";
  Effect effect{};
};

/// Selects an entry of a list by its name, or else by its place.
FoundValue find_value(Scene& scene, const std::string& key);

/// An entry of a table, with those of its numbers that are not zero and that studies take.
struct EntryNumbers
{
  std::string table;
  std::string key; // that leads to it: "part.disc", "spring.0"; "friction" of a table that is no list
  std::string title;
  std::vector<SceneNumber> numbers{};
};

/// All entries of a scene, with the numbers that are of this use, or of both.
std::vector<EntryNumbers> entries_of(Scene& scene, Study use);

/// The value of a number that a table names, such as "[branch]". Throws Error if the key is not that of a number that
/// the structure, its contact or its loads have.
double number_at(const Scene& scene, const std::string& key, const std::string& table);

/// Does a check; the text of an Error of it then begins with `prefix`.
template <class Check> void prefixed(const std::string& prefix, Check check)
{
  try
  {
    check();
  }
  catch (const Error& error)
  {
    throw Error(prefix + error.what());
  }
}

/// Throws Error, with the place of the member, if the scene is none with this value of the number.
void need_scene(const Scene& scene, const SceneNumber& number, const std::string& place, const std::string& label);

/// The shortest text that reads back as the same number.
std::string text_of_number(double value);

} // namespace squeal
