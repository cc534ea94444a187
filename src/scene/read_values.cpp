/// From TOML tables to the members that scene_keys.cpp binds to their keys, by the keys' rules.
#include "squeal/base/constants.hpp"
#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
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
    return {0, infinity, true, "a positive number (above 0)"};
  case Rule::not_negative:
    return {0, infinity, false, "zero or a positive number"};
  case Rule::poisson:
    return {-1, 0.5, true, "a number above -1 and below 0.5"};
  case Rule::fraction:
    return {std::numeric_limits<double>::min(), 1, false, "a number above 0 and at most 1"};
  case Rule::below_two:
    return {0, std::nextafter(2, 0), false, "a number of 0 or above and below 2"};
  default:
    return {-infinity, infinity, false, "a finite number"};
  }
}

/// Reads one value into any of the members that a key may have.
class ValueReader
{
public:
  explicit ValueReader(const ValuePlace& value) : value_(value) {}

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
    if (value_.key.need == Need::required && target.empty()) fail(node, "a name that is not empty");
  }

  void read(const toml::node& node, const Choice& target) const
  {
    const std::vector<std::string> words(target.words.begin(), target.words.end());
    const std::string given = text(node);
    const auto place = place_of_word(given, words);
    if (!place) throw refusal(node, given, words, hint_or_list(given, words));
    target.set(target.member, *place);
  }

  void read(const toml::node& node, const StartTarget& target) const
  {
    const auto& kind = target.kind;
    const std::vector<std::string> words(kind.words.begin(), kind.words.end() - 1);
    const std::string given = text(node);
    const auto place = place_of_word(given, words);
    *target.file = place ? std::filesystem::path() : absolute(given);
    kind.set(kind.member, place.value_or(words.size()));
    if (!place && !is_file(*target.file))
      throw refusal(node, given, words, ", and there is no file " + target.file->string());
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
    target.clear();
    const auto add = [&](const toml::node& entry)
    {
      Value value{};
      read(entry, value);
      target.push_back(value);
    };
    if (!array)
      add(node);
    else
      for (const toml::node& entry : *array) add(entry);
    if (target.empty()) fail(node, "at least one value");
  }

  /// Rows of a time, or a speed, and a factor.
  void read(const toml::node& node, FactorTable& target) const
  {
    target = {};
    for (const auto& [at, factor] :
         rows_of_two(node, "rows [time in s or speed in m/s, factor] such as [[0, 0], [0.1, 1]]"))
    {
      if (value_.key.rule == Rule::not_negative && factor < 0) fail(node, "factors of zero or above");
      target.at.push_back(at);
      target.value.push_back(factor);
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
    {
      if (!value.is_number()) fail(value, "finite numbers in the table");
      need_computable(value, *value.value<double>(), "finite numbers in the table");
      target[std::string(key.str())] = *value.value<double>();
    }
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
  [[noreturn]] void fail(const toml::node& node, const std::string& expected) const
  {
    refuse_value(value_.key, place(node), text_of(node), expected);
  }

  /// Throws Error for what is not finite, and where the third power would not be.
  void need_computable(const toml::node& node, double value, const std::string& expected) const
  {
    if (!std::isfinite(value)) fail(node, expected);
    if (const std::string problem = problem_of_number(Rule::any, value); !problem.empty()) fail(node, problem);
  }

  double number(const toml::node& node) const
  {
    if (!node.is_number()) fail(node, std::string(bounds_of(value_.key.rule).text) + ", not " + kind_of(node));
    const double value = *node.value<double>();
    if (const std::string problem = problem_of_number(value_.key.rule, value); !problem.empty()) fail(node, problem);
    return value;
  }

  template <class Integer> Integer whole_number(const toml::node& node) const
  {
    number(node);
    const auto value = node.value<std::int64_t>();
    if (!value || *value > std::numeric_limits<Integer>::max() || *value < std::numeric_limits<Integer>::min())
      fail(node, "a whole number of at most " + std::to_string(std::numeric_limits<Integer>::max()));
    return static_cast<Integer>(*value);
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
    for (const toml::node& entry : *array)
    {
      if (!entry.is_number()) fail(entry, "finite numbers in the list");
      need_computable(entry, *entry.value<double>(), "finite numbers in the list");
      values.push_back(*entry.value<double>());
    }
    return values;
  }

  /// Rows of two numbers, of which the first rises.
  std::vector<std::pair<double, double>> rows_of_two(const toml::node& node, const std::string& expected) const
  {
    const toml::array* rows = node.as_array();
    if (!rows || rows->empty()) fail(node, expected);
    std::vector<std::pair<double, double>> result;
    for (const toml::node& row : *rows)
    {
      const std::vector<double> values = numbers(row, expected);
      if (values.size() != 2) fail(row, expected);
      if (!result.empty() && !(values[0] > result.back().first))
        fail(row, "a first number above that of the row before");
      result.emplace_back(values[0], values[1]);
    }
    return result;
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

  static std::optional<std::size_t> place_of_word(const std::string& word, const std::vector<std::string>& words)
  {
    const auto found = std::ranges::find(words, word);
    if (found == words.end()) return std::nullopt;
    return static_cast<std::size_t>(found - words.begin());
  }

  /// `more`: after the words that are allowed.
  Error refusal(const toml::node& node, const std::string& given, const std::vector<std::string>& words,
                const std::string& more) const
  {
    return Error(place(node) + value_.key.name + " = '" + given + "' is none of " + joined(words) + more);
  }

  const ValuePlace& value_;
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
  const char *const begin = word.data() + (word.starts_with('+') ? 1 : 0), *const end = word.data() + word.size();
  const auto is_read = [&](auto& number)
  {
    const auto [stop, error] = std::from_chars(begin, end, number);
    return error == std::errc() && stop == end;
  };
  const std::string no_label;
  const std::filesystem::path no_folder;
  const auto read = [&](const auto& value) { read_value({key, no_label, no_folder, place}, toml::value(value)); };
  std::int64_t whole = 0;
  double number = 0;
  const bool is_switch = std::holds_alternative<bool*>(key.target),
             takes_number = std::holds_alternative<double*>(key.target) || std::holds_alternative<int*>(key.target) ||
                            std::holds_alternative<long*>(key.target);
  if (is_switch && (word.empty() || word == "true" || word == "false"))
    read(word != "false");
  else if (takes_number && is_read(whole))
    read(whole);
  else if (takes_number && is_read(number))
    read(number);
  else
    read(word);
}

std::string problem_of_number(Rule rule, double value)
{
  const Bounds bounds = bounds_of(rule);
  const bool inside =
      bounds.open ? value > bounds.least && value < bounds.greatest : value >= bounds.least && value <= bounds.greatest;
  if (!std::isfinite(value)) return "a finite number";
  if (!inside) return bounds.text;
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

void refuse_value(const SceneKey& key, const std::string& place, const std::string& text, const std::string& expected)
{
  throw Error(place + key.name + " = " + text + ": expected " + expected +
              (has_unit(key.unit) ? " [" + key.unit + "]" : ""));
}

} // namespace squeal
