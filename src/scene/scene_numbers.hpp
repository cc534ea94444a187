#pragma once
/// Numbers of a scene that are found by their keys, with messages about those that are not.
#include "squeal/scene/numbers.hpp"

#include "scene_keys.hpp"

namespace squeal
{

/// The tables of a scene that name its numbers.
enum class NumberTable
{
  branch,
  sweep,
  sensitivity,
  uncertain,
};

inline constexpr std::array number_table_words = {"[branch]", "[sweep]", "[sensitivity]", "[[uncertain]]"};

inline Words words_of(NumberTable)
{
  return number_table_words;
}

/// The value of a number that a table names. Throws Error if the key is not that of a number that the structure, its
/// contact or its loads have.
double number_at(const Scene& scene, const std::string& key, NumberTable table);

/// Throws Error, with the place of the member, if the scene is none with this value of the number.
void need_scene(const Scene& scene, const SceneNumber& number, const std::string& place, const std::string& label);

} // namespace squeal
