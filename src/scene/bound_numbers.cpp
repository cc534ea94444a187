/// Numbers of a scene, found by their keys through the table of keys, and set as a file would set them.
#include "bound_numbers.hpp"

#include "read_values.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace squeal
{

namespace
{

constexpr const char *a_number = "a number", *a_list = "a list", *a_table = "a table", *a_text = "text";

using WordsLeft = std::span<const std::string>;

/// The place that a word names in a list of this size; nothing if it names none.
std::optional<std::size_t> place_in(std::size_t size, const std::string& word)
{
  std::size_t place = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), place);
  if (error != std::errc() || end != word.data() + word.size() || place >= size) return std::nullopt;
  return place;
}

/// The value of a key, of which these words select a part.
class ValueFinder
{
public:
  ValueFinder(const SceneKey& key, std::string label, WordsLeft words)
      : key_(key), label_(std::move(label)), words_(words)
  {
  }

  FoundValue operator()(double* value) const
  {
    if (!words_.empty()) return {};
    return {a_number, BoundNumber{value, {}, key_, label_}};
  }
  FoundValue operator()(const DampingTarget& target) const
  {
    return *target.damping ? (*this)(&((**target.damping).*target.member)) : FoundValue{};
  }
  FoundValue operator()(Vec3* vector) const
  {
    const bool absent = key_.need == Need::optional && *vector == Vec3{}; // no value that can be given
    return absent ? FoundValue{} : entry_of(*vector, words_);
  }
  FoundValue operator()(std::optional<Vec3>* vector) const
  {
    return *vector ? entry_of(**vector, words_) : FoundValue{};
  }
  FoundValue operator()(std::array<double, 6>* list) const { return entry_of(*list, words_); }
  FoundValue operator()(std::vector<Vec3>* list) const
  {
    if (list->empty()) return {};
    if (words_.empty()) return {a_list};
    const auto place = place_in(list->size(), words_.front());
    return place ? entry_of((*list)[*place], words_.subspan(1)) : FoundValue{};
  }
  FoundValue operator()(std::optional<Rotation>* table) const { return of_table(*table); }
  FoundValue operator()(std::optional<Orthotropy>* table) const { return of_table(*table); }
  FoundValue operator()(bool*) const { return {words_.empty() ? "true or false" : ""}; }
  template <class Other> FoundValue operator()(const Other&) const { return {words_.empty() ? a_text : ""}; }

private:
  template <class List> FoundValue entry_of(List& list, WordsLeft words) const
  {
    if (words.empty()) return {a_list};
    const auto place = words.size() == 1 ? place_in(list.size(), words.front()) : std::nullopt;
    if (!place) return {};
    return {a_number, BoundNumber{&list[*place], std::span<double>(list), key_, label_}};
  }

  template <class Table> FoundValue of_table(std::optional<Table>& table) const;

  const SceneKey& key_;
  std::string label_;
  WordsLeft words_;
};

/// The value among these keys that the words lead to.
FoundValue find_among(const SceneKeys& keys, const std::string& label, WordsLeft words)
{
  if (words.empty()) return {a_table};
  const auto key = std::ranges::find(keys, words.front(), &SceneKey::name);
  if (key == keys.end()) return {};
  return std::visit(ValueFinder(*key, label, words.subspan(1)), key->target);
}

template <class Table> FoundValue ValueFinder::of_table(std::optional<Table>& table) const
{
  if (!table) return {};
  SceneKeys keys = keys_of(*table);
  for (SceneKey& key : keys) key.need = Need::required; // a table within braces has all of its values
  return find_among(keys, label_ + key_.name + " ", words_);
}

/// Looks for a value in each table of a scene.
struct TableFinder
{
  WordsLeft words;
  FoundValue& found;

  template <class T> void operator()(const std::string& table, std::vector<T>& list, const char*) const
  {
    if (table != words.front() || list.empty()) return;
    found = {a_list};
    if (words.size() == 1) return;
    std::optional<std::size_t> place = place_in(list.size(), words[1]);
    std::string label = "[[" + table + "]] ";
    if constexpr (requires { list.front().name; })
      if (const auto named = std::ranges::find(list, words[1], &T::name); named != list.end())
        place = static_cast<std::size_t>(named - list.begin());
    found = {};
    if (!place) return;
    if constexpr (requires { list.front().name; }) label += list[*place].name + " ";
    found = find_among(keys_of(list[*place]), label, words.subspan(2));
  }
  template <class T> void operator()(const std::string& table, std::optional<T>& entry, const char*) const
  {
    if (table == words.front() && entry) found = find_among(keys_of(*entry), "[" + table + "] ", words.subspan(1));
  }
  template <class T> void operator()(const std::string& table, T& entry, const char*) const
  {
    if (table == words.front()) found = find_among(keys_of(entry), "[" + table + "] ", words.subspan(1));
  }
};

/// Makes a direction a unit vector. Throws Error for an entry of a list that its key does not allow.
void finish_list(const BoundNumber& number, const std::string& place)
{
  const std::span<double> entries = number.entries;
  const auto fail = [&](const std::string& expected)
  { refuse_value(number.key, place, text_of_number(*number.value), expected); };
  if (entries.size() == 6 && std::min({entries[0], entries[1], entries[2]}) < 0) fail("no negative xx, yy or zz");
  if (number.key.rule != Rule::direction) return;
  const double length = std::hypot(entries[0], entries[1], entries[2]);
  if (length == 0) fail("a direction, not the zero vector");
  if (std::abs(length - 1) > 1e-15) // a unit vector keeps its digits
    for (double& x : entries) x /= length;
}

/// Finds the keys of a table, and how many words of a number's key come before one of them.
struct KeysFinder
{
  const std::string& table;
  SceneKeys& keys;
  std::size_t& words;

  template <class T> void operator()(const std::string& key, std::vector<T>&, const char*) const
  {
    T entry{};
    take(key, keys_of(entry), 2);
  }
  template <class T> void operator()(const std::string& key, std::optional<T>&, const char*) const
  {
    T entry{};
    take(key, keys_of(entry), 1);
  }
  template <class T> void operator()(const std::string& key, T& member, const char*) const
  {
    take(key, keys_of(member), 1);
  }

private:
  void take(const std::string& key, SceneKeys found, std::size_t before) const
  {
    if (key != table) return;
    keys = std::move(found);
    words = before;
  }
};

/// Unit and effect of a number, whatever entries a scene has.
struct NumberMeaning
{
  std::string unit = "-";
  Effect effect{};
};

NumberMeaning meaning_of(const std::vector<std::string>& words)
{
  Scene scene;
  Rotation rotation;
  Orthotropy orthotropy;
  const std::map<std::string, SceneKeys> nested{{"rotation", keys_of(rotation)}, {"orthotropic", keys_of(orthotropy)}};
  SceneKeys keys;
  std::size_t place = 0;
  for_each_table(scene, KeysFinder{words.front(), keys, place});
  NumberMeaning meaning;
  for (; place < words.size(); ++place)
  {
    const auto found = std::ranges::find(keys, words[place], &SceneKey::name);
    if (found == keys.end()) break;
    if (meaning.effect == Effect::nothing) meaning.effect = found->effect;
    if (has_unit(found->unit)) meaning.unit = found->unit;
    const auto below = nested.find(found->name);
    keys = below == nested.end() ? SceneKeys() : below->second;
  }
  return meaning;
}

} // namespace

std::string text_of_number(double value)
{
  char digits[32];
  return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
}

FoundValue find_number(Scene& scene, const std::string& key)
{
  const std::vector<std::string> words = words_of_key(key);
  FoundValue found;
  for_each_table(scene, TableFinder{words, found});
  return found;
}

std::string unit_of_number(const std::string& key)
{
  return meaning_of(words_of_key(key)).unit;
}

Effect effect_of_number(const Scene& scene, const std::string& key)
{
  const std::vector<std::string> words = words_of_key(key);
  const Effect effect = meaning_of(words).effect;
  const bool spins = words.front() == "part" &&
                     std::ranges::any_of(scene.parts, [](const Part& part) { return part.rotation.has_value(); });
  return effect == Effect::mass && spins ? Effect::stiffness_and_mass : effect;
}

Scene scene_with(const Scene& scene, std::span<const SceneNumber> numbers)
{
  Scene changed = scene;
  Places places{scene.file.string(), {}};
  for (const Part& part : changed.parts)
    if (!part.material.orthotropy) places.given[&part.material.poisson] = places.file;
  for (const auto& [key, value] : numbers)
  {
    const std::string given = "--set " + key + "=" + text_of_number(value);
    const FoundValue found = find_number(changed, key);
    if (!found.number) throw Error(given + ": the scene has no such number");
    const BoundNumber& number = *found.number;
    const std::string place = given + ": " + number.label;
    const Rule rule = number.entries.empty() ? number.key.rule : Rule::any;
    if (const std::string problem = problem_of_number(rule, value); !problem.empty())
      refuse_value(number.key, place, text_of_number(value), problem);
    *number.value = value;
    if (!number.entries.empty()) finish_list(number, place);
    places.given[number.value] = given;
  }
  check_scene(changed, places);
  return changed;
}

} // namespace squeal
