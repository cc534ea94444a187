/// The number of a scene that a branch follows, found in the scene's own text and replaced there.
#include "squeal/base/error.hpp"
#include "toml_values.hpp"

#include <algorithm>
#include <charconv>

namespace squeal
{

namespace
{

/// Tables whose numbers are of the structure, its contact and its loads.
const std::vector<std::string> physical = {"part",     "point",   "rigid_body", "spring", "force",
                                           "pressure", "contact", "friction",   "damping"};

std::string text_of_number(double value)
{
  char digits[32];
  return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
}

/// The scene with all defaults, as a document.
toml::table document_of(const Scene& scene)
{
  return toml::parse(resolved_scene(scene), std::string_view("scene"));
}

std::string refusal(const std::string& key, const std::string& why)
{
  return "[branch] key = \"" + key + "\" " + why;
}

/// Throws Error if the key is not that of a number that the structure, its contact or its loads have.
double number_at(const Scene& scene, const std::string& key)
{
  const std::string table = key.substr(0, key.find('.'));
  if (table == "mesh" || table == "matrices")
    throw Error(refusal(key, "would change the mesh along the branch; name a number of " + joined(physical)));
  if (std::find(physical.begin(), physical.end(), table) == physical.end())
    throw Error(refusal(key, "is not a number of the structure, its contact or its loads" +
                                 hint_or_list(table, physical) + ", such as friction.coefficient"));
  toml::table document = document_of(scene);
  const toml::node* node = find_value(document, key);
  if (!node)
    throw Error(refusal(key, "is not in the scene: name a number as --set does, such as friction.coefficient"));
  if (!node->is_number())
    throw Error(
        refusal(key, "is " + kind_of(*node) + ", not a number; of a list name an entry, such as force.0.vector.2"));
  return *node->value<double>();
}

} // namespace

Scene scene_on_branch(const Scene& scene, double value)
{
  toml::table document = document_of(scene);
  apply_override(document, scene.branch->key + "=" + text_of_number(value));
  Scene changed;
  changed.file = scene.file;
  Places places{scene.file.string(), {}};
  read_tables(document, changed, places);
  check_scene(changed, places);
  return changed;
}

void resolve_branch(Scene& scene, const Places& places)
{
  if (!scene.branch) return;
  BranchSettings& branch = *scene.branch;
  const auto fail = [&](const void* member, const std::string& text) { throw Error(places.at(member) + ": " + text); };
  try
  {
    branch.own = number_at(scene, branch.key);
  }
  catch (const Error& error)
  {
    fail(&branch.key, error.what());
  }
  if (branch.from == branch.to)
    fail(&branch.to, "[branch] from and to are both " + text_of_number(branch.to) + ": give a range");
  if (branch.own < std::min(branch.from, branch.to) || branch.own > std::max(branch.from, branch.to))
    fail(&branch.from, "[branch] the scene has " + branch.key + " = " + text_of_number(branch.own) +
                           ", where the branch starts: it must lie between from = " + text_of_number(branch.from) +
                           " and to = " + text_of_number(branch.to));
  if (!scene.cycle.enabled)
    fail(&branch.key, "[branch] starts from the cycle of the scene: give [cycle], or enable it");
  for (const double* end : {&branch.from, &branch.to}) try
    {
      (void)scene_on_branch(scene, *end);
    }
    catch (const Error& error)
    {
      fail(end, std::string("[branch] this end is no scene: ") + error.what());
    }
}

} // namespace squeal
