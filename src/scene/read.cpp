/// Reading of TOML tables into the members that scene_keys.cpp binds to their keys.
#include "read_values.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

/// Reads the tables of one scene and records the places of its values.
class Reader
{
public:
  Reader(Places& places, std::filesystem::path folder) : places_(places), folder_(std::move(folder)) {}

  void read_scene(const toml::table& root, Scene& scene)
  {
    std::vector<std::string> known = names_of(keys_of(scene));
    for_each_table(scene, [&](const std::string& key, auto&, const char*) { known.push_back(key); });
    check_known(root, known, "");
    for (const SceneKey& key : keys_of(scene))
      if (const toml::node* node = root.get(key.name)) read_value(key, *node, "");
    for_each_table(scene,
                   [&](const std::string& key, auto& member, const char*)
                   {
                     if (const toml::node* node = root.get(key)) read_member(key, *node, member);
                   });
  }

private:
  static std::vector<std::string> names_of(const SceneKeys& keys)
  {
    std::vector<std::string> names;
    for (const SceneKey& key : keys) names.push_back(key.name);
    return names;
  }

  /// Throws Error if a table has a key that is not known.
  static void check_known(const toml::table& table, const std::vector<std::string>& known, const std::string& label)
  {
    for (const auto& [key, value] : table)
      if (std::find(known.begin(), known.end(), key.str()) == known.end())
        throw Error(place_of(value) + ": " + label + "unknown key '" + std::string(key.str()) + "'" +
                    hint_or_list(std::string(key.str()), known));
  }

  template <class T> void read_member(const std::string& key, const toml::node& node, std::vector<T>& list)
  {
    const toml::array* array = node.as_array();
    if (!array) throw Error(place_of(node) + ": '" + key + "' is a list; write [[" + key + "]]");
    list.resize(array->size()); // at once, so that the addresses in places_ stay valid
    for (std::size_t i = 0; i < array->size(); ++i)
    {
      const toml::node& entry = *array->get(i);
      std::string label = "[[" + key + "]] ";
      if (const toml::table* table = entry.as_table(); table && (*table)["name"].is_string())
        label += shortened((*table)["name"].template value_or<std::string>("")) + " ";
      read_table(entry, list[i], label);
    }
  }

  template <class T> void read_member(const std::string& key, const toml::node& node, std::optional<T>& table)
  {
    read_table(node, table.emplace(), "[" + key + "] ");
  }

  template <class T> void read_member(const std::string& key, const toml::node& node, T& table)
  {
    if constexpr (requires { table.enabled; }) table.enabled = true;
    read_table(node, table, "[" + key + "] ");
  }

  template <class T> void read_table(const toml::node& node, T& target, const std::string& label)
  {
    const toml::table* table = node.as_table();
    if (!table) throw Error(place_of(node) + ": " + label + "is a table, not " + kind_of(node));
    places_.given[&target] = place_of(node);
    const SceneKeys keys = keys_of(target);
    check_known(*table, names_of(keys), label);
    for (const SceneKey& key : keys)
    {
      if (const toml::node* value = table->get(key.name))
        read_value(key, *value, label);
      else if (key.need == Need::required)
        throw Error(place_of(node) + ": " + label + "needs the key '" + key.name + "' [" + key.unit +
                    "]: " + key.meaning);
    }
  }

  /// Reads the value of a key into its member.
  void read_value(const SceneKey& key, const toml::node& node, const std::string& label)
  {
    squeal::read_value({key, label, folder_}, node);
    std::visit(
        [&](auto target)
        {
          if constexpr (is_inline_table<decltype(target)>) read_table(node, target->emplace(), label + key.name + " ");
          if constexpr (std::is_pointer_v<decltype(target)>) places_.given[target] = place_of(node);
          if constexpr (std::is_same_v<decltype(target), Choice>) places_.given[target.member] = place_of(node);
        },
        key.target);
  }

  Places& places_;
  std::filesystem::path folder_;
};

} // namespace

void read_tables(const toml::table& root, Scene& scene, Places& places)
{
  Reader(places, scene.file.parent_path()).read_scene(root, scene);
}

} // namespace squeal
