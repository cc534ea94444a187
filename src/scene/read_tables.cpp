/// From the tables of a scene file to the values of their keys.
#include "bound_numbers.hpp"
#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace squeal
{

namespace
{

/// Reads the tables of one scene and records the places of its values.
class Reader
{
public:
  Reader(Scene& scene, Places& places) : scene_(scene), places_(places), folder_(scene.file.parent_path()) {}

  /// `place`, `label`: of the table; `path`: of its keys, with a dot at the end.
  void read_keys(const toml::table& table, const SceneKeys& keys, const std::string& place, const std::string& label,
                 const std::string& path)
  {
    std::vector<std::string> known;
    for (const SceneKey& key : keys) known.push_back(key.name);
    for (const auto& [key, value] : table)
      if (std::ranges::find(known, key.str()) == known.end())
        throw Error(place_of(value) + ": " + label + "unknown key '" + std::string(key.str()) + "'" +
                    hint_or_list(std::string(key.str()), known));
    for (const SceneKey& key : keys)
    {
      if (const toml::node* value = table.get(key.name))
        read_key(key, *value, label, path + key.name);
      else if (key.need == Need::required)
        throw Error(place + ": " + label + "needs the key '" + key.name + "' [" + key.unit + "]: " + key.meaning);
    }
  }

private:
  void read_key(const SceneKey& key, const toml::node& node, const std::string& label, const std::string& path)
  {
    if (const auto* tables = std::get_if<TableTarget>(&key.target)) return read_tables(key, *tables, node, label, path);
    read_value({key, label, folder_, "", path, &scene_}, node);
    if (const void* const member = member_of(key.target)) places_.given[member] = place_of(node);
  }

  void read_tables(const SceneKey& key, const TableTarget& tables, const toml::node& node, const std::string& label,
                   const std::string& path)
  {
    const bool is_list = tables.form == TableForm::list;
    if (is_list && !node.is_array())
      throw Error(place_of(node) + ": '" + key.name + "' is a list; write " + heading_of(key));
    const std::size_t size = is_list ? node.as_array()->size() : 1;
    tables.resize(size); // at once, so that the addresses in places_ stay valid
    for (std::size_t i = 0; i < size; ++i)
    {
      const toml::node& entry = is_list ? *node.as_array()->get(i) : node;
      const toml::table* table = entry.as_table();
      const std::string name = table && is_list ? (*table)["name"].value_or<std::string>("") : "";
      const std::string entry_label = label_of(key, name, label), place = place_of(entry);
      if (!table) throw Error(place + ": " + entry_label + "is a table, not " + kind_of(entry));
      const auto [member, own_name, title, keys] = tables.entry(i);
      places_.given[member] = place;
      read_keys(*table, keys, place, entry_label, path + (is_list ? "." + std::to_string(i) : "") + ".");
    }
  }

  /// The member that checks of a scene name; null: they name none.
  static const void* member_of(const Target& target)
  {
    return std::visit(
        [](const auto& of) -> const void*
        {
          using Kind = std::remove_cvref_t<decltype(of)>;
          if constexpr (std::is_pointer_v<Kind>) return of;
          if constexpr (std::is_same_v<Kind, Choice>) return of.member;
          if constexpr (std::is_same_v<Kind, StartTarget>) return of.kind.member;
          return nullptr;
        },
        target);
  }

  Scene& scene_;
  Places& places_;
  std::filesystem::path folder_;
};

} // namespace

void read_tables(const toml::table& root, Scene& scene, Places& places)
{
  Reader(scene, places).read_keys(root, keys_of(scene), scene.file.string(), "", "");
}

// Values of TOML documents, and overrides from the command line: --set table.key=value.

namespace
{

/// The source name of an override; it tells overrides from values of the file.
constexpr const char* override_prefix = "--set ";

/// Returns "a.b=v" as the table { a = { b = v } }. A value that is not TOML is taken as a string.
toml::table parse_override(const std::string& text)
{
  const auto equals = text.find('=');
  const std::string source = override_prefix + text;
  if (equals == std::string::npos || equals == 0)
    throw Error(source + ": expected KEY=VALUE, such as friction.coefficient=0.3");
  const std::string key = text.substr(0, equals) + " = ";
  const std::string value = text.substr(equals + 1);
  try
  {
    return toml::parse(key + value, source);
  }
  catch (const toml::parse_error&)
  {
  }
  try
  {
    return toml::parse(key + toml_string(value), source);
  }
  catch (const toml::parse_error& error)
  {
    throw Error(source + ": " + text_of(error) + "; expected KEY=VALUE, KEY such as part.disc.young");
  }
}

void merge(toml::table& into, toml::table& from);

/// Returns the entry of a list with this name, or else with this index; null if there is none. `known`: its names.
toml::node* entry_of(toml::array& list, const std::string& wanted, std::vector<std::string>& known)
{
  toml::node* entry = nullptr;
  for (std::size_t i = 0; i < list.size(); ++i)
  {
    const toml::table* candidate = list.get(i)->as_table();
    const std::string index = std::to_string(i);
    const std::string name = candidate ? (*candidate)["name"].value_or(index) : index;
    known.push_back(name);
    if (wanted == name || (!entry && wanted == index)) entry = list.get(i);
  }
  return entry;
}

/// Moves the values of `from` into the entries of a list, which it selects by name or by index.
void merge_list(const std::string& key, toml::array& list, toml::table& from)
{
  for (auto&& [selector, value] : from)
  {
    const std::string wanted(selector.str());
    std::vector<std::string> known;
    toml::node* entry = entry_of(list, wanted, known);
    if (!entry)
      throw Error(place_of(value) + ": " + key + " has no entry '" + wanted + "'" +
                  (list.is_array_of_tables() ? hint_or_list(wanted, known) : "; known: " + joined(known)));
    if (entry->is_table() != value.is_table())
      throw Error(place_of(value) + ": expected " + key + "." + wanted + (entry->is_table() ? ".KEY=VALUE" : "=VALUE"));
    if (entry->is_table())
      merge(*entry->as_table(), *value.as_table());
    else
      value.visit([&](auto& typed) { list.replace(list.cbegin() + std::stol(wanted), std::move(typed)); });
  }
}

/// Moves the values of `from` into the same keys of `into`.
void merge(toml::table& into, toml::table& from)
{
  for (auto&& [key, value] : from)
  {
    toml::node* present = into.get(key.str());
    if (value.is_table() && present && present->is_table())
      merge(*present->as_table(), *value.as_table());
    else if (value.is_table() && present && present->is_array())
      merge_list(std::string(key.str()), *present->as_array(), *value.as_table());
    else
      value.visit([&](auto& typed) { into.insert_or_assign(key.str(), std::move(typed)); });
  }
}

/// The names that an override goes through, from the outermost table on.
std::vector<std::string> names_of(const toml::table& change)
{
  std::vector<std::string> names;
  for (const toml::table* table = &change; table && !table->empty();)
  {
    names.emplace_back(table->begin()->first.str());
    table = table->begin()->second.as_table();
  }
  return names;
}

} // namespace

std::string text_of(const toml::parse_error& error)
{
  const std::string text(error.description());
  return text.substr(0, text.find(" (TOML_"));
}

std::vector<std::string> words_of_key(const std::string& key)
{
  return names_of(parse_override(key + "=0"));
}

std::string place_of(const toml::node& node)
{
  const auto& source = node.source();
  const std::string path = source.path ? *source.path : "scene";
  if (path.rfind(override_prefix, 0) == 0) return path;
  return path + ", line " + std::to_string(source.begin.line);
}

std::string toml_string(const std::string& text)
{
  std::ostringstream result;
  result << toml::toml_formatter(toml::value(text), toml::format_flags::allow_unicode_strings);
  return result.str();
}

std::string kind_of(const toml::node& node)
{
  if (node.is_string()) return "text";
  if (node.is_number()) return "a number";
  if (node.is_boolean()) return "true or false";
  if (node.is_array()) return "a list";
  return node.is_table() ? "a table" : "a date";
}

std::string text_of(const toml::node& node)
{
  if (node.is_array() || node.is_table()) return kind_of(node);
  if (const auto number = node.value_exact<double>(); number && std::isfinite(*number)) return text_of_number(*number);
  std::ostringstream text;
  text << toml::node_view<const toml::node>(node);
  return text.str();
}

std::string joined(const std::vector<std::string>& words)
{
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

std::string hint_or_list(const std::string& word, const std::vector<std::string>& known)
{
  const std::string near = spelling_hint(word, known);
  return near.empty() ? "; known: " + joined(known) : near;
}

void apply_override(toml::table& root, const std::string& text)
{
  toml::table change = parse_override(text);
  merge(root, change);
}

} // namespace squeal
