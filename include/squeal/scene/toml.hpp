#pragma once
/// The TOML side of scene files: where a value stands, what it is, and how overrides change it.
#include "squeal/scene/fields.hpp"

#include <toml++/toml.h>

namespace squeal
{

/// "scene.toml, line 12", or the override "--set key=value" that brought the value.
std::string place_of(const toml::node& node);

/// "text", "a number", "a list", …
std::string kind_of(const toml::node& node);

/// The value as written; lists and tables only by their kind.
std::string text_of(const toml::node& node);

/// The text as a TOML string in double quotes.
std::string toml_string(const std::string& text);

/// "; did you mean 'x'?", or all that is known when nothing is near.
std::string suggestion_or_list(const std::string& word, const std::vector<std::string>& known);

std::string joined(const std::vector<std::string>& words);

/// Applies "table.key=value" to the tables of a scene.
void apply_override(toml::table& root, const std::string& text);

/// Fills the scene from its tables and notes where each value was given.
void read_tables(const toml::table& root, Scene& scene, Places& places);

} // namespace squeal
