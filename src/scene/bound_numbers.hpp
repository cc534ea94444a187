#pragma once
/// Numbers of a scene as the members that the scene's keys bind.
#include "scene_keys.hpp"

namespace squeal
{

/// A number of a scene, with the whole value of its key where it is an entry of one.
struct BoundNumber
{
  double* value = nullptr;
  std::span<double> entries{}; // of the value that it is part of; empty: it is a value of its own
  SceneKey key;
  std::string label; // of the key's table
};

/// What a key leads to.
struct FoundValue
{
  std::string kind{}; // "a number", "text", "a list" and so on; empty: the scene has no such value
  std::optional<BoundNumber> number{};
};

/// Selects an entry of a list by its name, or else by its place. Keys with any other value than a number have a kind.
FoundValue find_number(Scene& scene, const std::string& key);

/// The shortest text that reads back as the same number.
std::string text_of_number(double value);

} // namespace squeal
