#pragma once
/// Numbers of a scene that are found by their keys, with messages about those that are not.
#include "scene_keys.hpp"

namespace squeal
{

/// The value of a number. `table`: "[branch]" or "[sweep]", for messages. Throws Error if the key is not that of a
/// number that the structure, its contact or its loads have.
double number_at(const Scene& scene, const std::string& key, const std::string& table);

/// Throws Error, with the place of the member, if the scene is none with this value of the number.
void need_scene(const Scene& scene, const SceneNumber& number, const std::string& place, const std::string& label);

} // namespace squeal
