/// Reading of TOML tables into the members that scene_keys.cpp binds to their keys.
#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace squeal
{

namespace
{

/// The numbers that a rule allows.
struct Bounds
{
  double least, greatest;
  bool open; // the bounds themselves are excluded
  const char* text;
};

Bounds bounds_of(Rule rule)
{
  constexpr double infinity = std::numeric_limits<double>::infinity();
  switch (rule)
  {
  case Rule::positive:
    return {0, infinity, true, "a positive number"};
  case Rule::not_negative:
    return {0, infinity, false, "zero or a positive number"};
  case Rule::poisson:
    return {-1, 0.5, true, "a number above -1 and below 0.5"};
  case Rule::fraction:
    return {0, 1, false, "a number from 0 to 1"};
  default:
    return {-infinity, infinity, false, "a finite number"};
  }
}

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
        label += (*table)["name"].template value_or<std::string>("") + " ";
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
    key_ = &key;
    label_ = label;
    std::visit(
        [&](auto target)
        {
          if constexpr (std::is_pointer_v<decltype(target)>)
          {
            read(node, *target);
            places_.given[target] = place_of(node);
          }
          else
            read(node, target);
          if constexpr (std::is_same_v<decltype(target), Choice>) places_.given[target.member] = place_of(node);
        },
        key.target);
  }

  /// Throws Error for a value of the current key that is not as expected.
  [[noreturn]] void fail(const toml::node& node, const std::string& expected) const
  {
    const std::string unit = has_unit(key_->unit) ? " [" + key_->unit + "]" : "";
    throw Error(place_of(node) + ": " + label_ + key_->name + " = " + text_of(node) + ": expected " + expected + unit);
  }

  double number(const toml::node& node) const
  {
    const Bounds bounds = bounds_of(key_->rule);
    if (!node.is_number()) fail(node, std::string(bounds.text) + ", not " + kind_of(node));
    const double value = *node.value<double>();
    const bool inside = bounds.open ? value > bounds.least && value < bounds.greatest
                                    : value >= bounds.least && value <= bounds.greatest;
    if (!inside || !std::isfinite(value)) fail(node, bounds.text);
    return value;
  }

  template <class Integer> Integer whole_number(const toml::node& node) const
  {
    number(node);
    const auto value = node.value<std::int64_t>();
    if (!value || *value > std::numeric_limits<Integer>::max() || *value < std::numeric_limits<Integer>::min())
      fail(node, "a whole number");
    return static_cast<Integer>(*value);
  }

  std::string text(const toml::node& node) const
  {
    if (!node.is_string()) fail(node, "text in quotes, not " + kind_of(node));
    return *node.value<std::string>();
  }

  std::vector<double> numbers(const toml::node& node, const std::string& expected) const
  {
    const toml::array* array = node.as_array();
    if (!array) fail(node, expected + ", not " + kind_of(node));
    std::vector<double> values;
    for (const toml::node& entry : *array)
    {
      if (!entry.is_number() || !std::isfinite(*entry.value<double>())) fail(entry, "finite numbers in the list");
      values.push_back(*entry.value<double>());
    }
    return values;
  }

  /// Returns a list of three numbers, or of a direction its unit vector, which may be given as "x", "-y" and so on.
  Vec3 vector(const toml::node& node) const
  {
    Vec3 v{};
    if (key_->rule == Rule::direction && node.is_string())
    {
      std::string axis = text(node);
      const double sign = axis.rfind('-', 0) == 0 ? -1 : 1;
      if (sign < 0) axis.erase(0, 1);
      const auto* const found = std::find(motion_words.begin(), motion_words.begin() + 3, axis);
      if (found == motion_words.begin() + 3) fail(node, "x, y, z, -x, -y, -z or a list of three numbers");
      v[static_cast<std::size_t>(found - motion_words.begin())] = sign;
      return v;
    }
    const auto values = numbers(node, "a list of three numbers");
    if (values.size() != 3) fail(node, "a list of three numbers, not of " + std::to_string(values.size()));
    std::copy(values.begin(), values.end(), v.begin());
    if (key_->rule != Rule::direction) return v;
    const double length = std::hypot(v[0], v[1], v[2]);
    if (length == 0) fail(node, "a direction, not the zero vector");
    if (std::abs(length - 1) > 1e-15) // a unit vector keeps its digits
      for (double& x : v) x /= length;
    return v;
  }

  std::filesystem::path absolute(const std::string& text) const
  {
    return text.empty() ? std::filesystem::path() : (folder_ / text).lexically_normal();
  }

  void read(const toml::node& node, double& target) const { target = number(node); }
  void read(const toml::node& node, int& target) const { target = whole_number<int>(node); }
  void read(const toml::node& node, long& target) const { target = whole_number<long>(node); }
  void read(const toml::node& node, Vec3& target) const { target = vector(node); }
  void read(const toml::node& node, std::optional<Vec3>& target) const { target = vector(node); }

  void read(const toml::node& node, bool& target) const
  {
    if (!node.is_boolean()) fail(node, "true or false, not " + kind_of(node));
    target = *node.value<bool>();
  }

  void read(const toml::node& node, std::string& target) const
  {
    target = text(node);
    if (key_->need == Need::required && target.empty()) fail(node, "a name that is not empty");
  }

  void read(const toml::node& node, const Choice& target) const
  {
    const std::string given = text(node);
    const std::vector<std::string> words(target.words.begin(), target.words.end());
    const auto found = std::find(words.begin(), words.end(), given);
    if (found == words.end())
      throw Error(place_of(node) + ": " + label_ + key_->name + " = '" + given + "' is none of " + joined(words) +
                  hint_or_list(given, words));
    target.set(target.member, static_cast<std::size_t>(found - words.begin()));
  }

  void read(const toml::node& node, Start& target) const { read_start<StartKind>(node, target); }
  void read(const toml::node& node, CycleStart& target) const { read_start<CycleStartKind>(node, target); }

  /// A word of the kinds of start, or a state file.
  template <class Kind, class Target> void read_start(const toml::node& node, Target& target) const
  {
    const std::string given = text(node);
    const Words kinds = words_of(Kind::file);
    std::vector<std::string> words;
    for (std::size_t place = 0; place < kinds.size(); ++place)
    {
      const auto kind = static_cast<Kind>(place);
      if (kind == Kind::file) continue;
      words.emplace_back(word(kind));
      if (given != words.back()) continue;
      target = {kind, {}};
      return;
    }
    target = {Kind::file, absolute(given)};
    if (!is_file(target.file))
      throw Error(place_of(node) + ": " + label_ + key_->name + " = '" + given + "' is none of " + joined(words) +
                  ", and there is no file " + target.file.string());
  }

  void read(const toml::node& node, std::filesystem::path& target) const
  {
    target = absolute(text(node));
    const std::string what = key_->rule == Rule::folder ? "folder" : "file";
    const bool exists = key_->rule == Rule::folder ? is_folder(target)
                        : key_->rule == Rule::file ? is_file(target)
                                                   : true;
    if (!exists)
      throw Error(place_of(node) + ": " + label_ + key_->name + " = " + text_of(node) + ": there is no " + what + " " +
                  target.string() + " (paths are relative to the scene file)");
  }

  void read(const toml::node& node, std::vector<Vec3>& target) const
  {
    const toml::array* array = node.as_array();
    target.clear();
    if (!array || (!array->empty() && array->get(0)->is_number()))
      target.push_back(vector(node));
    else
      for (const toml::node& entry : *array) target.push_back(vector(entry));
    if (target.empty() || target.size() > 2) fail(node, "one or two directions");
  }

  void read(const toml::node& node, std::vector<std::string>& target) const
  {
    const toml::array* array = node.as_array();
    target.clear();
    if (!array)
      target.push_back(text(node));
    else
      for (const toml::node& entry : *array) target.push_back(text(entry));
    if (target.empty()) fail(node, "at least one name");
  }

  /// A number, or a list of numbers.
  template <class Number> void read_numbers(const toml::node& node, std::vector<Number>& target) const
  {
    const toml::array* array = node.as_array();
    target.clear();
    const auto add = [&](const toml::node& entry)
    {
      Number value{};
      read(entry, value);
      target.push_back(value);
    };
    if (!array)
      add(node);
    else
      for (const toml::node& entry : *array) add(entry);
    if (target.empty()) fail(node, "at least one number");
  }

  void read(const toml::node& node, std::vector<double>& target) const { read_numbers(node, target); }
  void read(const toml::node& node, std::vector<int>& target) const { read_numbers(node, target); }

  /// Rows of a time and a factor, the times rising.
  void read(const toml::node& node, TimeFactor& target) const
  {
    const std::string expected = "rows [time in s, factor] such as [[0, 0], [0.1, 1]]";
    const toml::array* rows = node.as_array();
    if (!rows || rows->empty()) fail(node, expected);
    target = {};
    for (const toml::node& row : *rows)
    {
      const std::vector<double> values = numbers(row, expected);
      if (values.size() != 2) fail(row, expected);
      if (!target.time.empty() && !(values[0] > target.time.back())) fail(row, "a time after that of the row before");
      if (key_->rule == Rule::not_negative && values[1] < 0) fail(row, "a factor of zero or above");
      target.time.push_back(values[0]);
      target.value.push_back(values[1]);
    }
  }

  void read(const toml::node& node, std::array<double, 6>& target) const
  {
    const auto values = numbers(node, "a list of three or six numbers");
    if (values.size() != 3 && values.size() != 6) fail(node, "a list of three or six numbers");
    if (std::min({values[0], values[1], values[2]}) < 0) fail(node, "no negative xx, yy or zz");
    target.fill(0);
    std::copy(values.begin(), values.end(), target.begin());
  }

  void read(const toml::node& node, Motions& target) const
  {
    target.fill(false);
    std::istringstream words(text(node));
    for (std::string word; words >> word;)
    {
      const auto found = std::find(motion_words.begin(), motion_words.end(), word);
      if (word == all_motions)
        target.fill(true);
      else if (found != motion_words.end())
        target[found - motion_words.begin()] = true;
      else if (word != no_motions)
        fail(node, "some of x y z rx ry rz with blanks between, all, or none");
    }
  }

  void read(const toml::node& node, std::map<std::string, double>& target) const
  {
    const toml::table* table = node.as_table();
    if (!table) fail(node, "a table of numbers, such as { size = 4000 }");
    for (const auto& [key, value] : *table)
    {
      if (!value.is_number() || !std::isfinite(*value.value<double>())) fail(value, "finite numbers in the table");
      target[std::string(key.str())] = *value.value<double>();
    }
  }

  void read(const toml::node& node, std::optional<Rotation>& target) { read_inline_table(node, target); }
  void read(const toml::node& node, std::optional<Orthotropy>& target) { read_inline_table(node, target); }

  template <class T> void read_inline_table(const toml::node& node, std::optional<T>& target)
  {
    const std::string label = label_;
    read_table(node, target.emplace(), label + key_->name + " ");
  }

  void read(const toml::node& node, const DampingTarget& target) const
  {
    if (!*target.damping) target.damping->emplace();
    (**target.damping).*target.member = number(node);
  }

  Places& places_;
  std::filesystem::path folder_;
  const SceneKey* key_ = nullptr; // the key that is being read, for messages
  std::string label_;             // of the key's table, for messages
};

} // namespace

void read_tables(const toml::table& root, Scene& scene, Places& places)
{
  Reader(places, scene.file.parent_path()).read_scene(root, scene);
}

} // namespace squeal
