/// From the tables of a scene file to the values of their keys.
#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>

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

} // namespace squeal
