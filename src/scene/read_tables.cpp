/// From the tables of a scene file to the values of their keys, with named numbers in place of their names.
#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

/// Whether names of numbers may stand for values of a member.
bool holds_numbers(const SceneKey& key)
{
  return key.rule != Rule::direction &&
         std::visit(
             [](const auto& target)
             {
               using Kind = std::remove_cvref_t<decltype(target)>;
               return !std::is_same_v<Kind, bool*> && !std::is_same_v<Kind, std::string*> &&
                      !std::is_same_v<Kind, std::filesystem::path*> && !std::is_same_v<Kind, Motions*> &&
                      !std::is_same_v<Kind, std::vector<std::string>*> && !std::is_same_v<Kind, Choice> &&
                      !std::is_same_v<Kind, StartTarget> && !std::is_same_v<Kind, TableTarget>;
             },
             key.target);
}

/// Puts named numbers into a value in place of their names, and records where they stand.
class NumberNames
{
public:
  explicit NumberNames(Scene& scene) : scene_(scene) {}

  /// Whether any of them is in the list, which stands at the key.
  bool put_into(toml::array& list, const std::string& key)
  {
    bool any = false;
    for (std::size_t i = 0; i < list.size(); ++i)
    {
      const std::string place = key + "." + std::to_string(i);
      toml::node& entry = *list.get(i);
      if (toml::array* inner = entry.as_array()) any = put_into(*inner, place) || any;
      if (toml::table* table = entry.as_table())
        for (auto&& [name, value] : *table)
          if (const auto number = use(value, place + "." + std::string(name.str())))
          {
            table->insert_or_assign(name, *number);
            any = true;
          }
      if (const auto number = use(entry, place))
      {
        list.replace(list.cbegin() + static_cast<std::ptrdiff_t>(i), *number);
        any = true;
      }
    }
    return any;
  }

private:
  /// The number that a text names, with a minus where the text begins with one; nothing: it names none.
  std::optional<double> use(const toml::node& node, const std::string& key)
  {
    const auto text = node.value_exact<std::string>();
    if (!text) return std::nullopt;
    const bool negative = text->starts_with('-');
    const auto named = scene_.numbers.find(text->substr(negative ? 1 : 0));
    if (named == scene_.numbers.end()) return std::nullopt;
    const double sign = negative ? -1 : 1;
    scene_.number_uses.push_back({key, named->first, sign});
    return sign * named->second;
  }

  Scene& scene_;
};

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
    toml::array copy; // of one entry, the value
    node.visit([&](const auto& value) { copy.push_back(value); });
    if (holds_numbers(key) && put_names(copy, path))
      read_value({key, label, folder_, place_of(node)}, *copy.get(0));
    else
      read_own(key, node, label);
    if (const void* const member = member_of(key.target)) places_.given[member] = place_of(node);
  }

  /// A value that names no number.
  void read_own(const SceneKey& key, const toml::node& node, const std::string& label) const
  {
    try
    {
      read_value({key, label, folder_}, node);
    }
    catch (const Error& error)
    {
      auto text = node.value_exact<std::string>();
      for (std::size_t i = 0; node.is_array() && !text && i < node.as_array()->size(); ++i)
        text = node.as_array()->get(i)->value_exact<std::string>();
      if (!text || !holds_numbers(key) || scene_.numbers.empty()) throw;
      std::vector<std::string> names;
      for (const auto& [name, value] : scene_.numbers) names.push_back(name);
      throw Error(error.what() + std::string("; no number of [numbers] has that name") +
                  hint_or_list(text->substr(text->starts_with('-') ? 1 : 0), names));
    }
  }

  /// Puts named numbers into a list of one value.
  bool put_names(toml::array& value, const std::string& path)
  {
    const std::size_t before = scene_.number_uses.size();
    const bool any = NumberNames(scene_).put_into(value, path);
    for (std::size_t i = before; i < scene_.number_uses.size(); ++i) // take the place in the list of one out
      scene_.number_uses[i].key.erase(path.size(), 2);
    return any;
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
