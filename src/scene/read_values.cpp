/// From TOML tables to the members that scene_keys.cpp binds to their keys, by the keys' rules.
#include "bound_numbers.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <sstream>

namespace squeal
{

namespace
{

/// Reads one value into any of the members that a key may have.
class ValueReader
{
public:
  explicit ValueReader(ValuePlace value) : value_(std::move(value)) {}

  void read(const toml::node& node, double& target) const { target = number(node); }
  void read(const toml::node& node, int& target) const { target = whole_number<int>(node); }
  void read(const toml::node& node, long& target) const { target = whole_number<long>(node); }
  void read(const toml::node& node, Vec3& target) const { target = vector(node); }
  void read(const toml::node& node, std::optional<Vec3>& target) const { target = vector(node); }
  void read(const toml::node& node, const Choice& target) const { read_word(node, target, nullptr); }
  void read(const toml::node& node, const StartTarget& target) const { read_word(node, target.kind, target.file); }

  void read(const toml::node& node, bool& target) const
  {
    if (!node.is_boolean()) fail(node, "true or false, not " + kind_of(node));
    target = *node.value<bool>();
  }

  void read(const toml::node& node, std::string& target) const
  {
    target = text(node);
    if (value_.key.need == Need::required && target.empty()) fail(node, "a name that is not empty");
  }

  void read(const toml::node& node, std::filesystem::path& target) const
  {
    target = absolute(text(node));
    std::string problem;
    if (value_.key.rule == Rule::folder && !is_folder(target))
      problem = "there is no folder " + target.string();
    else if (value_.key.rule == Rule::file)
      problem = problem_of_file(target);
    if (!problem.empty())
      throw Error(place(node) + value_.key.name + " = " + text_of(node) + ": " + problem +
                  " (paths are relative to the scene file)");
  }

  /// A value, or a list of them.
  template <class Value> void read(const toml::node& node, std::vector<Value>& target) const
  {
    const toml::array* array = node.as_array();
    if constexpr (std::is_same_v<Value, Vec3>) // which is a list itself
      if (array && !array->empty() && array->get(0)->is_number()) array = nullptr;
    target.assign(array ? array->size() : 1, {});
    if (!array) read(node, target[0]);
    for (std::size_t i = 0; array && i < target.size(); ++i) part(i).read(*array->get(i), target[i]);
    if (target.empty()) fail(node, "at least one value");
  }

  /// Rows of a time, or a speed, and a factor; the first number rises.
  void read(const toml::node& node, FactorTable& target) const
  {
    constexpr const char* expected = "rows [time in s or speed in m/s, factor] such as [[0, 0], [0.1, 1]]";
    const toml::array* rows = node.as_array();
    if (!rows || rows->empty()) fail(node, expected);
    target = {};
    for (std::size_t i = 0; i < rows->size(); ++i)
    {
      const toml::node& row = *rows->get(i);
      const std::vector<double> values = part(i).numbers(row, expected);
      if (values.size() != 2) fail(row, expected);
      if (i > 0 && !(values[0] > target.at.back())) fail(row, "a first number above that of the row before");
      if (value_.key.rule == Rule::not_negative && values[1] < 0) fail(node, "factors of zero or above");
      target.at.push_back(values[0]);
      target.value.push_back(values[1]);
    }
  }

  void read(const toml::node& node, std::array<double, 6>& target) const
  {
    const auto values = numbers(node, "a list of three or six numbers");
    if (values.size() != 3 && values.size() != 6) fail(node, "a list of three or six numbers");
    target.fill(0);
    std::copy(values.begin(), values.end(), target.begin());
    need_allowed(node, target);
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
      target[std::string(key.str())] = part(key.str()).finite(value, "finite numbers in the table");
  }

  template <class Part, class Member> void read(const toml::node& node, const MemberTarget<Part, Member>& target) const
  {
    if (!*target.part) target.part->emplace();
    read(node, (**target.part).*target.member);
  }

private:
  /// The place of a value with the label of its table.
  std::string place(const toml::node& node) const
  {
    return (value_.place.empty() ? place_of(node) : value_.place) + ": " + value_.label;
  }

  /// Throws Error for a value of the key that is not as expected.
  [[noreturn]] void fail(const toml::node& node, const std::string& expected, const std::string& hint) const
  {
    refuse_value(value_.key, place(node), text_of(node), expected, hint);
  }
  [[noreturn]] void fail(const toml::node& node, const std::string& expected) const { fail(node, expected, ""); }

  /// Reads a part of the value, by the word that selects it in overrides.
  ValueReader part(std::string_view word) const
  {
    ValuePlace place = value_;
    place.path.append(".").append(word);
    return ValueReader(place);
  }
  ValueReader part(std::size_t number) const { return part(std::to_string(number)); }

  /// A word of the choice. `file`: of the last one, which stands for any other text; null: it does not.
  void read_word(const toml::node& node, const Choice& choice, std::filesystem::path* file) const
  {
    const std::vector<std::string> words(choice.words.begin(), choice.words.end() - (file ? 1 : 0));
    const std::string given = text(node);
    const auto word = static_cast<std::size_t>(std::ranges::find(words, given) - words.begin());
    const bool is_known = word < words.size();
    if (file) *file = is_known ? std::filesystem::path() : absolute(given);
    if (!is_known && !(file && is_file(*file)))
      throw Error(place(node) + value_.key.name + " = '" + given + "' is none of " + joined(words) +
                  (file ? ", and there is no file " + file->string() : hint_or_list(given, words)));
    choice.set(choice.member, word);
  }

  /// Whether names of numbers may stand for this value.
  bool takes_names() const { return value_.scene && value_.key.rule != Rule::direction; }

  /// The number that a text names, with a minus where the text begins with one; nothing: it names none. Records where
  /// it stands.
  std::optional<double> named_number(const toml::node& node) const
  {
    const auto text = node.value_exact<std::string>();
    if (!text || !takes_names()) return std::nullopt;
    const double sign = text->starts_with('-') ? -1 : 1;
    const auto named = value_.scene->numbers.find(text->substr(sign < 0 ? 1 : 0));
    if (named == value_.scene->numbers.end()) return std::nullopt;
    value_.scene->number_uses.push_back({value_.path, named->first, sign});
    return sign * named->second;
  }

  /// The hint that a message adds about a text that names no number.
  std::string hint_of_number(const toml::node& node) const
  {
    const auto text = node.value_exact<std::string>();
    if (!text || !takes_names() || value_.scene->numbers.empty()) return "";
    std::vector<std::string> names;
    for (const auto& [name, number] : value_.scene->numbers) names.push_back(name);
    return "; no number of [numbers] has that name" + hint_or_list(text->substr(text->starts_with('-') ? 1 : 0), names);
  }

  /// A finite number, of which the third power is finite as well.
  double finite(const toml::node& node, const std::string& expected) const
  {
    const std::optional<double> named = named_number(node);
    if (!named && !node.is_number()) fail(node, expected, hint_of_number(node));
    const double value = named ? *named : *node.value<double>();
    if (!std::isfinite(value)) fail(node, "a finite number");
    need_allowed(node, Rule::any, value);
    return value;
  }

  /// Throws Error for a number that a rule does not allow.
  void need_allowed(const toml::node& node, Rule rule, double value) const
  {
    const std::string problem = problem_of_number(rule, value),
                      text = text_of(node) + (node.is_string() ? " = " + text_of_number(value) : "");
    if (!problem.empty()) refuse_value(value_.key, place(node), text, problem, "");
  }

  double number(const toml::node& node) const
  {
    const std::string expected = bounds_of(value_.key.rule).expected;
    const double value = finite(node, expected + (node.is_number() ? "" : ", not " + kind_of(node)));
    need_allowed(node, value_.key.rule, value);
    return value;
  }

  template <class Integer> Integer whole_number(const toml::node& node) const
  {
    const double value = number(node);
    constexpr Integer largest = std::numeric_limits<Integer>::max();
    if (value != std::floor(value) || std::abs(value) >= static_cast<double>(largest))
      fail(node, "a whole number of at most " + std::to_string(largest));
    return static_cast<Integer>(value);
  }

  std::string text(const toml::node& node) const
  {
    if (!node.is_string()) fail(node, "text in quotes, not " + kind_of(node));
    const std::string value = *node.value<std::string>();
    const auto is_control = [](unsigned char c) { return std::iscntrl(c) != 0 && c != '\n' && c != '\t'; };
    if (std::ranges::any_of(value, is_control)) fail(node, "text without control characters");
    return value;
  }

  std::vector<double> numbers(const toml::node& node, const std::string& expected) const
  {
    const toml::array* array = node.as_array();
    if (!array) fail(node, expected + ", not " + kind_of(node));
    std::vector<double> values;
    for (std::size_t i = 0; i < array->size(); ++i)
      values.push_back(part(i).finite(*array->get(i), "finite numbers in the list"));
    return values;
  }

  /// Returns a list of three numbers, or of a direction its unit vector, which may be given as "x", "-y" and so on.
  Vec3 vector(const toml::node& node) const
  {
    Vec3 v{};
    if (value_.key.rule == Rule::direction && node.is_string())
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
    need_allowed(node, v);
    return v;
  }

  void need_allowed(const toml::node& node, std::span<double> entries) const
  {
    if (const std::string problem = problem_of_list(value_.key.rule, entries); !problem.empty()) fail(node, problem);
  }

  std::filesystem::path absolute(const std::string& text) const
  {
    return text.empty() ? std::filesystem::path() : (value_.folder / text).lexically_normal();
  }

  const ValuePlace value_;
};

} // namespace

void read_value(const ValuePlace& value, const toml::node& node)
{
  const ValueReader reader(value);
  std::visit(
      [&](const auto& target)
      {
        using Kind = std::remove_cvref_t<decltype(target)>;
        if constexpr (std::is_pointer_v<Kind>)
          reader.read(node, *target);
        else if constexpr (!std::is_same_v<Kind, TableTarget>)
          reader.read(node, target);
      },
      value.key.target);
}

void set_by_word(const std::string& place, const SceneKey& key, const std::string& word)
{
  if (auto* const* list = std::get_if<std::vector<std::string>*>(&key.target)) return (*list)->push_back(word);
  const bool is_switch = std::holds_alternative<bool*>(key.target),
             takes_number = std::holds_alternative<double*>(key.target) || std::holds_alternative<int*>(key.target) ||
                            std::holds_alternative<long*>(key.target);
  toml::table given{{"value", word}};
  if (is_switch || takes_number) try
    {
      given = toml::parse("value = " + (is_switch && word.empty() ? "true" : word));
    }
    catch (const toml::parse_error&) // the text is no such value, which is refused
    {
    }
  read_value({key, "", {}, place}, *given.get("value"));
}

const Bounds& bounds_of(Rule rule)
{
  constexpr double infinity = std::numeric_limits<double>::infinity();
  constexpr Bounds any{-infinity, infinity, false, "a finite number", ""};
  constexpr auto no_bounds = [=](const char* page) {
    return Bounds{any.least, any.greatest, any.open, any.expected, page};
  };
  static constexpr std::array bounds = {
      any,
      Bounds{0, infinity, true, "a positive number (above 0)", "above 0"},
      Bounds{0, infinity, false, "zero or a positive number", "0 or above"},
      Bounds{-1, 0.5, true, "a number above -1 and below 0.5", "above -1, below 0.5"},
      Bounds{std::numeric_limits<double>::min(), 1, false, "a number above 0 and at most 1", "above 0, at most 1"},
      no_bounds("direction"),
      no_bounds("zero: none"),
      no_bounds("no negative xx, yy or zz"),
      no_bounds("existing file"),
      no_bounds("existing folder"),
      Bounds{0, 2 - std::numeric_limits<double>::epsilon(), false, "a number of 0 or above and below 2",
             "0 or above, below 2"}};
  return bounds[static_cast<std::size_t>(rule)];
}

std::string problem_of_number(Rule rule, double value)
{
  const Bounds& bounds = bounds_of(rule);
  const bool inside =
      bounds.open ? value > bounds.least && value < bounds.greatest : value >= bounds.least && value <= bounds.greatest;
  if (!std::isfinite(value)) return "a finite number";
  if (!inside) return bounds.expected;
  return std::abs(value) > largest_number ? "a number of at most 1e100 in size, so that powers of it are finite" : "";
}

std::string problem_of_list(Rule rule, std::span<double> entries)
{
  if (rule == Rule::inertia && std::min({entries[0], entries[1], entries[2]}) < 0) return "no negative xx, yy or zz";
  if (rule != Rule::direction) return {};
  const double length = std::hypot(entries[0], entries[1], entries[2]);
  if (length == 0) return "a direction, not the zero vector";
  if (std::abs(length - 1) > 1e-15) // a unit vector keeps its digits
    for (double& x : entries) x /= length;
  return {};
}

void refuse_value(const SceneKey& key, const std::string& place, const std::string& text, const std::string& expected,
                  const std::string& hint)
{
  throw Error(place + key.name + " = " + text + ": expected " + expected +
              (has_unit(key.unit) ? " [" + key.unit + "]" : "") + hint);
}

} // namespace squeal
