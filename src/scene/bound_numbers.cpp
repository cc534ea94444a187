/// Numbers of a scene, found by their keys through the tree of keys, and set as a file would set them.
#include "bound_numbers.hpp"

#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>
#include <charconv>

namespace squeal
{

namespace
{

using WordsLeft = std::span<const std::string>;

/// The place that a word names in a list of this size; nothing if it names none.
std::optional<std::size_t> place_in(std::size_t size, const std::string& word)
{
  std::size_t place = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), place);
  if (error != std::errc() || end != word.data() + word.size() || place >= size) return std::nullopt;
  return place;
}

/// The number that a member is; null: it is none.
double* number_of(const Target& target)
{
  if (double* const* number = std::get_if<double*>(&target)) return *number;
  if (const auto* damping = std::get_if<DampingTarget>(&target)) return &((**damping->part).*damping->member);
  const auto* friction = std::get_if<FrictionTarget>(&target);
  return friction ? &((**friction->part).*friction->member) : nullptr;
}

/// The numbers that a member lists. In a list of vectors the first of the words selects one, and is taken out of them.
std::span<double> numbers_of(const Target& target, WordsLeft& words)
{
  if (Vec3* const* vector = std::get_if<Vec3*>(&target)) return **vector;
  if (auto* const* vector = std::get_if<std::optional<Vec3>*>(&target)) return ***vector;
  if (auto* const* list = std::get_if<std::array<double, 6>*>(&target)) return **list;
  if (auto* const* list = std::get_if<std::vector<double>*>(&target)) return **list;
  auto* const* vectors = std::get_if<std::vector<Vec3>*>(&target);
  const auto place = vectors && !words.empty() ? place_in((*vectors)->size(), words.front()) : std::nullopt;
  if (!place) return {};
  words = words.subspan(1);
  return (**vectors)[*place];
}

std::vector<std::string> keys_in(const std::vector<SceneNumber>& numbers)
{
  std::vector<std::string> keys;
  for (const SceneNumber& number : numbers) keys.push_back(number.key);
  return keys;
}

FoundValue find_among(const SceneKeys& keys, const std::string& label, WordsLeft words);

/// The value in a table, of which the first word selects an entry if it is a list.
FoundValue find_in_table(const SceneKey& key, const std::string& label, WordsLeft words)
{
  const auto& table = std::get<TableTarget>(key.target);
  if (table.form != TableForm::list) return find_among(table.entry(0).keys, label_of(key, "", label), words);
  if (words.empty()) return {true};
  const std::string& selector = words.front();
  for (std::size_t i = 0; i < table.size(); ++i)
    if (const TableEntry entry = table.entry(i); entry.name == selector)
      return find_among(entry.keys, label_of(key, entry.name, label), words.subspan(1));
  const auto place = place_in(table.size(), selector);
  if (!place) return {};
  const TableEntry entry = table.entry(*place);
  FoundValue found = find_among(entry.keys, label_of(key, entry.name, label), words.subspan(1));
  found.title = entry.title;
  return found;
}

/// The value among these keys that the words lead to.
FoundValue find_among(const SceneKeys& keys, const std::string& label, WordsLeft words)
{
  if (words.empty()) return {true};
  const auto key = std::ranges::find(keys, words.front(), &SceneKey::name);
  if (key == keys.end() || is_absent(*key)) return {};
  words = words.subspan(1);
  FoundValue found;
  if (std::holds_alternative<TableTarget>(key->target))
    found = find_in_table(*key, label, words);
  else if (double* const number = number_of(key->target); number && words.empty())
    found = {true, number, {}, *key, label};
  else if (const std::span<double> entries = numbers_of(key->target, words); words.size() == 1)
  {
    if (const auto place = place_in(entries.size(), words.front()))
      found = {true, &entries[*place], entries, *key, label};
  }
  else
    found.is_there = words.empty();
  if (found.effect == Effect::nothing) found.effect = key->effect;
  if (found.unit == "-" && has_unit(key->unit)) found.unit = key->unit;
  return found;
}

} // namespace

std::string text_of_number(double value)
{
  char digits[32];
  return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
}

FoundValue find_value(Scene& scene, const std::string& key)
{
  return find_among(keys_of(scene), "", words_of_key(key));
}

namespace
{

/// Appends the numbers among these keys.
void append_numbers(const SceneKeys& keys, const std::string& path, Study use, std::vector<SceneNumber>& numbers)
{
  const auto add = [&](const std::string& key, double value)
  {
    if (value != 0) numbers.push_back({key, value});
  };
  for (const SceneKey& key : keys)
  {
    if (is_absent(key)) continue;
    const std::string own = path + "." + key.name;
    WordsLeft none;
    if (const auto* table = std::get_if<TableTarget>(&key.target))
      append_numbers(table->entry(0).keys, own, use, numbers);
    else if (key.study != use && key.study != Study::derive_and_double)
      continue;
    else if (const double* number = number_of(key.target))
      add(own, *number);
    else
      for (std::size_t i = 0; const double value : numbers_of(key.target, none))
        add(own + "." + std::to_string(i++), value);
  }
}

} // namespace

std::vector<EntryNumbers> entries_of(Scene& scene, Study use)
{
  std::vector<EntryNumbers> entries;
  for (const SceneKey& key : keys_of(scene))
  {
    const auto* table = std::get_if<TableTarget>(&key.target);
    for (std::size_t i = 0; table && i < table->size(); ++i)
    {
      const auto [member, name, title, own] = table->entry(i);
      const bool plain =
          std::ranges::all_of(name, [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-'; });
      const std::string word = name.empty() ? std::to_string(i) : plain ? name : toml_string(name);
      const std::string path = table->form == TableForm::list ? key.name + "." + word : key.name;
      append_numbers(own, path, use, entries.emplace_back(EntryNumbers{key.name, path, title}).numbers);
    }
  }
  return entries;
}

std::vector<SceneNumber> driven_by(const Scene& scene, std::span<const SceneNumber> numbers)
{
  std::vector<SceneNumber> driven;
  for (const auto& [key, value] : numbers)
  {
    if (!key.starts_with(named_numbers))
      driven.push_back({key, value});
    else
      for (const NumberUse& use : scene.number_uses)
        if (named_numbers + use.name == key) driven.push_back({use.key, use.sign * value});
  }
  return driven;
}

NumberDescription description_of(const Scene& scene, const std::string& key)
{
  const std::array asked = {SceneNumber{key, 0}};
  if (const std::vector<SceneNumber> driven = driven_by(scene, asked);
      key.starts_with(named_numbers) && !driven.empty())
  {
    NumberDescription description = description_of(scene, driven.front().key);
    description.name = joined(keys_in(driven));
    return description;
  }
  Scene copy = scene; // keys bind members that can be written
  const FoundValue found = find_value(copy, key);
  const bool spins = key.starts_with("part.") &&
                     std::ranges::any_of(scene.parts, [](const Part& part) { return part.rotation.has_value(); });
  const bool stiffens = found.effect == Effect::mass && spins;
  return {found.unit, found.title, stiffens ? Effect::stiffness_and_mass : found.effect};
}

Places places_of(const Scene& scene)
{
  Places places{scene.file.string(), {}};
  for (const Part& part : scene.parts)
    if (!part.material.orthotropy) places.given[&part.material.poisson] = places.file;
  for (const Force& force : scene.forces) places.given[&force.vector] = places.file;
  return places;
}

Scene scene_with(const Scene& scene, std::span<const SceneNumber> numbers)
{
  Scene changed = scene;
  Places places = places_of(changed);
  for (const auto& [key, value] : numbers)
    if (key.starts_with(named_numbers)) changed.numbers[key.substr(std::string(named_numbers).size())] = value;
  for (const auto& [key, value] : driven_by(scene, numbers))
  {
    const std::string given = "--set " + key + "=" + text_of_number(value);
    const FoundValue number = find_value(changed, key);
    if (!number.number) throw Error(given + ": the scene has no such number");
    const std::string place = given + ": " + number.label;
    const bool is_listed = !number.entries.empty();
    std::string problem = problem_of_number(is_listed ? Rule::any : number.key.rule, value);
    *number.number = value;
    if (problem.empty() && is_listed) problem = problem_of_list(number.key.rule, number.entries);
    if (!problem.empty()) refuse_value(number.key, place, text_of_number(value), problem, "");
    places.given[number.number] = given;
    if (key.starts_with("rotor.")) take_drives(changed);
  }
  check_scene(changed, places);
  return changed;
}

} // namespace squeal
