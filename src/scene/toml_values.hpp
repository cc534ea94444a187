#pragma once
/// Values of TOML documents: where they are given, their text, and how overrides change them.
#include "scene_keys.hpp"

#include <toml++/toml.h>

namespace squeal
{

/// Returns "scene.toml, line 12", or the override "--set key=value" that gave the value.
std::string place_of(const toml::node& node);

/// Returns "text", "a number", "a list", and so on.
std::string kind_of(const toml::node& node);

/// Returns the value as it is written; of a list or table its kind only.
std::string text_of(const toml::node& node);

/// Returns the text as a TOML string.
std::string toml_string(const std::string& text);

/// Returns the words with commas between them.
std::string joined(const std::vector<std::string>& words);

/// Returns "; did you mean 'x'?", or the list of known words if none is near.
std::string hint_or_list(const std::string& word, const std::vector<std::string>& known);

/// The parser's message, without the names of its own macros.
std::string text_of(const toml::parse_error& error);

/// Applies "table.key=value" to the tables of a scene.
void apply_override(toml::table& root, const std::string& text);

/// The words of a key between its dots; a word in quotes may hold dots.
std::vector<std::string> words_of_key(const std::string& key);

/// The numbers that a rule allows.
struct Bounds
{
  double least, greatest;
  bool open;                   // the bounds themselves are excluded
  const char *expected, *page; // in messages, and on the page of keys
};

const Bounds& bounds_of(Rule rule);

/// The values that a rule wants instead of one; empty: the rule allows it.
std::string problem_of_number(Rule rule, double value);

/// The entries that a key wants instead of these; empty: it allows them. A direction becomes a unit vector.
std::string problem_of_list(Rule rule, std::span<double> entries);

/// Throws Error for a value of a key that is not as expected. `place`: of the value, with the label of the table;
/// `hint`: said last.
[[noreturn]] void refuse_value(const SceneKey& key, const std::string& place, const std::string& text,
                               const std::string& expected, const std::string& hint);

/// The key of a value and what messages and paths need besides.
struct ValuePlace
{
  const SceneKey& key;
  std::string label;            // of the key's table
  std::filesystem::path folder; // that paths are relative to
  std::string place{};          // empty: that of the node
  std::string path{};           // of the value, as overrides name it
  Scene* scene = nullptr;       // whose named numbers may stand for it, and where these are recorded; null: none may
};

/// Sets the member of a key that is no table. Throws Error for a value that is not of the key's kind, or outside its
/// rule.
void read_value(const ValuePlace& value, const toml::node& node);

/// Fills the scene from its tables and records where each value was given.
void read_tables(const toml::table& root, Scene& scene, Places& places);

} // namespace squeal
