/// Names of a scene's numbers, and checks of the tables that name them.
#include "squeal/scene/numbers.hpp"

#include "bound_numbers.hpp"
#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>
#include <boost/algorithm/string.hpp>
#include <fstream>

namespace squeal
{

namespace
{

/// Tables whose numbers are of the structure, its contact and its loads.
const std::vector<std::string> physical = {"part",    "point", "rigid_body", "coupling", "spring",   "connector",
                                           "beam",    "mass",  "support",    "force",    "pressure", "bolt",
                                           "gravity", "rotor", "contact",    "friction", "damping"};

/// Tables on which the mesh or the given matrices depend.
constexpr std::array of_the_mesh = {"mesh", "matrices"};

std::vector<std::string> named_keys(const Scene& scene)
{
  std::vector<std::string> keys;
  for (const auto& [name, value] : scene.numbers) keys.push_back(named_numbers + name);
  return keys;
}

} // namespace

std::vector<SceneNumber> numbers_of(std::span<const std::string> keys, std::span<const double> values)
{
  std::vector<SceneNumber> numbers;
  for (std::size_t i = 0; i < values.size(); ++i) numbers.push_back({keys[i], values[i]});
  return numbers;
}

double number_at(const Scene& scene, const std::string& key, const std::string& table)
{
  if (key.starts_with(named_numbers))
  {
    const auto own = scene.numbers.find(key.substr(std::string(named_numbers).size()));
    if (own == scene.numbers.end())
      throw Error(table + " key = \"" + key + "\" is none of [numbers]" + hint_or_list(key, named_keys(scene)));
    const std::array named = {SceneNumber{key, 0}};
    const std::vector<SceneNumber> driven = driven_by(scene, named);
    if (driven.empty())
      throw Error(table + " key = \"" + key + "\" stands nowhere in the scene: give its name for a value");
    for (const SceneNumber& number : driven) (void)number_at(scene, number.key, table + " by " + key);
    return own->second;
  }
  const auto refusal = [&](const std::string& why) { return Error(table + " key = \"" + key + "\" " + why); };
  const std::string first = key.substr(0, key.find('.'));
  if (std::ranges::find(of_the_mesh, first) != of_the_mesh.end())
    throw refusal("would change the mesh; name a number of " + joined(physical));
  if (std::find(physical.begin(), physical.end(), first) == physical.end())
    throw refusal("is not a number of the structure, its contact or its loads" + hint_or_list(first, physical) +
                  ", such as " + friction_coefficient_key);
  Scene copy = scene; // keys bind members that can be written
  const FoundValue found = find_value(copy, key);
  if (!found.is_there)
    throw refusal(std::string("is not in the scene: name a number as --set does, such as ") + friction_coefficient_key);
  if (!found.number) throw refusal("is not a number; of a list name an entry, such as force.0.vector.2");
  const auto has_own = [](const Contact& contact) { return contact.friction.has_value(); };
  if (first == "friction" && !scene.contacts.empty() && std::ranges::all_of(scene.contacts, has_own))
    throw refusal("changes nothing, since each contact has friction of its own: name that, as contact.0.friction");
  return *found.number;
}

void need_scene(const Scene& scene, const SceneNumber& number, const std::string& place, const std::string& label)
{
  prefixed(place + ": " + label, [&] { (void)scene_with(scene, std::span(&number, 1)); });
}

namespace
{

/// The cells of a line without blanks and quotes around them.
std::vector<std::string> cells_of(const std::string& line)
{
  std::vector<std::string> cells;
  boost::split(cells, line, boost::is_any_of(","));
  for (std::string& cell : cells) boost::trim_if(cell, boost::is_any_of(" \t\r\""));
  return cells;
}

double number_in(const std::string& cell, const std::string& place, const std::string& key)
{
  char* end = nullptr;
  const double value = std::strtod(cell.c_str(), &end);
  if (cell.empty() || *end != 0 || !std::isfinite(value))
    throw Error(place + ": " + key + " = '" + shortened(cell) + "': expected a finite number");
  return value;
}

/// Reads keys and design points from a CSV file: keys in the first line, then a line of values for each point. Empty
/// lines and lines that begin with # are left out. Throws Error, with the line, for what is no number, for lines of
/// another length and for a key that is there twice.
void read_design_table(const std::filesystem::path& file, std::vector<std::string>& keys,
                       std::vector<std::vector<double>>& points)
{
  std::ifstream stream(file);
  int number = 0;
  for (std::string line; std::getline(stream, line);)
  {
    const std::string place = file.string() + ", line " + std::to_string(++number);
    if (constexpr const char* mark = "\xEF\xBB\xBF"; number == 1 && line.starts_with(mark)) line.erase(0, 3); // UTF-8's
    const std::vector<std::string> cells = cells_of(line);
    if (cells == std::vector<std::string>{""} || cells.front().starts_with('#')) continue;
    if (keys.empty())
    {
      keys = cells;
      if (cells.size() == 1 && cells[0].find(';') != std::string::npos)
        throw Error(place + ": '" + shortened(cells[0]) +
                    "' has semicolons: put commas between the keys, and points in numbers");
      for (const std::string& key : cells)
        if (std::ranges::count(cells, key) > 1) throw Error(place + ": the key '" + key + "' is there twice");
      continue;
    }
    if (cells.size() != keys.size())
      throw Error(place + ": " + std::to_string(cells.size()) + " values for " + std::to_string(keys.size()) +
                  " keys: give one each, with a comma between them");
    std::vector<double>& point = points.emplace_back();
    for (std::size_t i = 0; i < cells.size(); ++i) point.push_back(number_in(cells[i], place, keys[i]));
  }
  if (points.empty())
    throw Error(file.string() + " holds no points: give a line of keys such as friction.coefficient,numbers.clamp, and "
                                "a line of values for each point");
}

/// Takes over the points of the file, whose numbers are of the scene; what makes no scene fails as a point.
void take_design(SweepSettings& sweep, const Scene& scene, const Places& places)
{
  if (sweep.from != sweep.to || !sweep.values.empty())
    places.refuse(&sweep.table, "[sweep] table holds all values: take from, to and values out");
  std::vector<std::string> keys;
  read_design_table(sweep.table, keys, sweep.design);
  if (!sweep.key.empty() && sweep.key != keys) places.refuse(&sweep.key, "[sweep] table holds the keys: take key out");
  sweep.key = keys;
  for (const std::string& key : sweep.key)
    prefixed(sweep.table.string() + ": ", [&] { (void)number_at(scene, key, "[sweep] table:"); });
}

/// Throws Error for what is neither a list of values nor a grid.
void check_form(const SweepSettings& sweep, const Places& places)
{
  std::vector<double> sorted = sweep.values;
  std::ranges::sort(sorted);
  const auto twice = std::ranges::adjacent_find(sorted);
  if (!sorted.empty() && (sweep.from != sweep.to || sweep.points != SweepSettings{}.points))
    places.refuse(&sweep.values, "[sweep] values exclude from, to and points: keep one form");
  if (twice != sorted.end())
    places.refuse(&sweep.values, "[sweep] values holds " + text_of_number(*twice) + " twice: take one of them out");
  if (!sorted.empty()) return;
  if (sweep.from == sweep.to)
    places.refuse(places.given.contains(&sweep.to) ? static_cast<const void*>(&sweep.to) : &sweep.key,
                  "[sweep] from and to are both " + text_of_number(sweep.to) + ": give a range, or values");
  if (sweep.points < 2)
    places.refuse(&sweep.points, "[sweep] points = " + std::to_string(sweep.points) + ": a grid has at least two");
}

} // namespace

void resolve_branch(Scene& scene, const Places& places)
{
  if (!scene.branch) return;
  BranchSettings& branch = *scene.branch;
  prefixed(places.at(&branch.key) + ": ", [&] { branch.own = number_at(scene, branch.key, "[branch]"); });
  if (branch.from == branch.to)
    places.refuse(&branch.to, "[branch] from and to are both " + text_of_number(branch.to) + ": give a range");
  if (branch.own < std::min(branch.from, branch.to) || branch.own > std::max(branch.from, branch.to))
    places.refuse(&branch.from, "[branch] the scene has " + branch.key + " = " + text_of_number(branch.own) +
                                    ", where the branch starts: it must lie between from = " +
                                    text_of_number(branch.from) + " and to = " + text_of_number(branch.to));
  if (!scene.cycle.enabled)
    places.refuse(&branch.key, "[branch] starts from the cycle of the scene: give [cycle], or enable it");
  for (const double* end : {&branch.from, &branch.to})
    need_scene(scene, {branch.key, *end}, places.at(end), "[branch] this end is no scene: ");
}

void resolve_sweep(Scene& scene, const Places& places)
{
  if (!scene.sweep) return;
  SweepSettings& sweep = *scene.sweep;
  if (!sweep.table.empty()) take_design(sweep, scene, places);
  if (sweep.key.empty())
    places.refuse(&sweep, "[sweep] needs the key 'key', the number that changes, or 'table', a file of points");
  if (!sweep.table.empty()) return;
  if (sweep.key.size() > 1)
    places.refuse(&sweep.key,
                  "[sweep] names " + std::to_string(sweep.key.size()) + " numbers: give one, or a table of points");
  const std::string& key = sweep.key.front();
  prefixed(places.at(&sweep.key) + ": ", [&] { (void)number_at(scene, key, "[sweep]"); });
  check_form(sweep, places);
  if (sweep.values.empty())
    for (const double* end : {&sweep.from, &sweep.to})
      need_scene(scene, {key, *end}, places.at(end), "[sweep] this end is no scene: ");
  for (const double value : sweep.values)
    need_scene(scene, {key, value}, places.at(&sweep.values), "[sweep] one of the values is no scene: ");
}

namespace
{

/// Whether a contact has this number from a rotor.
bool is_of_a_rotor(const Scene& scene, const std::string& key)
{
  for (std::size_t i = 0; i < scene.contacts.size(); ++i)
    if (scene.contacts[i].driven_by >= 0 && key.starts_with(format("contact.%zu.rotation", i))) return true;
  return false;
}

} // namespace

std::vector<SceneNumber> sensitive_numbers(const Scene& scene)
{
  std::vector<SceneNumber> numbers;
  for (const std::string& key : scene.sensitivity->numbers)
    numbers.push_back({key, number_at(scene, key, "[sensitivity]")});
  if (!numbers.empty()) return numbers;
  Scene copy = scene;
  for (const EntryNumbers& entry : entries_of(copy, Study::derive))
    if (!scene.matrices || entry.table != "damping") // C is given
      std::ranges::copy_if(entry.numbers, std::back_inserter(numbers),
                           [&](const SceneNumber& number) { return !is_of_a_rotor(scene, number.key); });
  return numbers;
}

std::vector<SceneComponent> components_of(const Scene& scene)
{
  std::vector<SceneComponent> components;
  Scene copy = scene;
  const std::vector<EntryNumbers> entries = entries_of(copy, Study::double_it);
  for (const auto& [table, key, title, numbers] : entries)
  {
    if (numbers.empty()) continue;
    const bool unique =
        std::ranges::none_of(entries, [&](const EntryNumbers& other)
                             { return other.table == table && other.title == title && other.key != key; });
    SceneComponent& component =
        components.emplace_back(SceneComponent{table, unique ? title : key + " (" + title + ")", numbers});
    for (SceneNumber& number : component.doubled) number.value *= 2;
  }
  std::string rest;
  for (const Superelement& element : scene.superelements) rest += (rest.empty() ? "" : " and ") + element.name;
  if (!rest.empty()) components.push_back({"superelement", rest});
  if (scene.matrices) components.push_back({"matrices", ""});
  return components;
}

std::vector<std::string> contact_names(const Scene& scene)
{
  Scene copy = scene;
  std::vector<std::string> names;
  for (const EntryNumbers& entry : entries_of(copy, Study::nothing))
    if (entry.table == "contact") names.push_back(entry.title);
  return names;
}

std::vector<SceneNumber> from_zero(const Scene& scene, const SceneNumber& number)
{
  std::vector<SceneNumber> numbers{number};
  const auto is_loss = [](const SceneNumber& driven) { return driven.key.ends_with(".loss_factor"); };
  if (std::ranges::any_of(driven_by(scene, numbers), is_loss) && scene.damping.loss_frequency == 0)
    numbers.push_back({"damping.loss_frequency", scene.modes.band});
  return numbers;
}

namespace
{

/// Each number once, and with values beside its own. Throws Error.
void check_numbers(const Scene& scene)
{
  const std::vector<SceneNumber> numbers = sensitive_numbers(scene);
  for (const auto& [key, value] : numbers)
  {
    if (std::ranges::count(numbers, key, &SceneNumber::key) > 1)
      throw Error("[sensitivity] numbers names \"" + key + "\" twice: take one of them out");
    constexpr double little = 1e-9; // beside any number of use
    if (value == 0)
      prefixed("[sensitivity] " + key + " is 0, and nothing beside that is a scene: leave it out, or give it a value. ",
               [&] {
                 (void)scene_with(scene, from_zero(scene, {key, little}));
               });
  }
}

} // namespace

void check_sensitivity(const Scene& scene, const Places& places)
{
  if (scene.sensitivity) prefixed(places.at(&scene.sensitivity->numbers) + ": ", [&] { check_numbers(scene); });
  const std::vector<std::string> probes = names_of(scene.probes);
  for (const Change& change : scene.changes)
  {
    if (!scene.sensitivity) places.refuse(&change, "[[change]] is part of [sensitivity]: give that table too");
    if (std::ranges::find(probes, change.probe) == probes.end())
      places.refuse(&change.probe,
                    "[[change]] probe = \"" + change.probe + "\" is not defined" + hint_or_list(change.probe, probes));
    if (change.mass == 0 && change.damping == 0 && change.stiffness == 0)
      places.refuse(&change, "[[change]] at " + change.probe + " has neither mass, damping nor stiffness");
  }
}

} // namespace squeal
