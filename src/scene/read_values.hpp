#pragma once
/// Values of a scene file that are no tables: from TOML to the member of a key, by the key's rule.
#include "toml_values.hpp"

namespace squeal
{

/// The key of a value and what messages and paths need besides.
struct ValuePlace
{
  const SceneKey& key;
  const std::string& label;            // of the key's table
  const std::filesystem::path& folder; // that paths are relative to
};

/// What a value should be instead, by a rule; empty: the rule allows it.
std::string problem_of_number(Rule rule, double value);

/// Throws Error for a value of a key that is not as expected. `place`: of the value, with the label of the table.
[[noreturn]] void refuse_value(const SceneKey& key, const std::string& place, const std::string& text,
                               const std::string& expected);

/// Sets the member of a key that is no table. Throws Error for a value that is not of the key's kind, or outside its
/// rule.
void read_value(const ValuePlace& value, const toml::node& node);

} // namespace squeal
