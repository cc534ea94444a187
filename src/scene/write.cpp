/// The resolved scene as text, and the page of all keys.
#include "bound_numbers.hpp"
#include "toml_values.hpp"

#include "squeal/base/markdown.hpp"

#include <array>
#include <concepts>
#include <ranges>

namespace squeal
{

namespace
{

/// The TOML text of values. Where a named number stands, its name does.
class Printer
{
public:
  explicit Printer(Scene& scene)
  {
    for (const NumberUse& use : scene.number_uses)
      if (const double* number = find_value(scene, use.key).number)
        names_[number] = toml_string((use.sign < 0 ? "-" : "") + use.name);
  }

  /// The TOML text of a key's value; empty if it is left out, since its default means the same.
  std::string value_text(const SceneKey& key) const
  {
    if (is_absent(key)) return "";
    return std::visit(
        [this](const auto& target)
        {
          if constexpr (std::is_pointer_v<std::remove_cvref_t<decltype(target)>>)
            return print(*target);
          else
            return print(target);
        },
        key.target);
  }

private:
  std::string print(const std::string& text) const { return toml_string(text); }

  /// The text is the shortest that reads back as the same number, or the name of the number that stands there.
  std::string print(const double& value) const
  {
    if (const auto name = names_.find(&value); name != names_.end()) return name->second;
    std::string text = text_of_number(value);
    if (text.find_first_of(".e") == std::string::npos && text.size() > 15) text += ".0"; // no TOML integer
    return text;
  }

  template <std::integral Whole> std::string print(Whole value) const
  {
    return std::is_same_v<Whole, bool> ? (value ? "true" : "false") : std::to_string(value);
  }

  std::string print(const std::filesystem::path& path) const { return print(path.string()); }

  std::string print(const Motions& motions) const
  {
    std::string text;
    for (std::size_t i = 0; i < 6; ++i)
      if (motions[i]) text += std::string(text.empty() ? "" : " ") + motion_words[i];
    return print(text.empty() ? no_motions : text);
  }

  /// A vector, or a list of any values.
  template <std::ranges::range List> std::string print(const List& list) const
  {
    std::string text;
    for (const auto& entry : list) text += (text.empty() ? "" : ", ") + print(entry);
    return "[" + text + "]";
  }

  std::string print(const FactorTable& factor) const
  {
    std::vector<std::array<double, 2>> rows;
    for (std::size_t i = 0; i < factor.at.size(); ++i) rows.push_back({factor.at[i], factor.value[i]});
    return print(rows);
  }

  std::string print(const std::optional<Vec3>& vector) const { return print(*vector); }

  std::string print(const std::map<std::string, double>& table) const
  {
    std::string text;
    for (const auto& [key, value] : table) text += (text.empty() ? " " : ", ") + print(key) + " = " + print(value);
    return "{" + text + " }";
  }

  template <class Part, class Member> std::string print(const MemberTarget<Part, Member>& target) const
  {
    return print((**target.part).*target.member);
  }

  std::string print(const Choice& target) const { return print(std::string(target.words[target.get(target.member)])); }

  std::string print(const StartTarget& target) const
  {
    return target.file->empty() ? print(target.kind) : print(*target.file);
  }

  /// The form with braces.
  std::string print(const TableTarget& target) const
  {
    std::string text;
    for (const SceneKey& key : target.entry(0).keys)
      if (!is_absent(key)) text += (text.empty() ? " " : ", ") + key.name + " = " + value_text(key);
    return "{" + text + " }";
  }

  std::map<const double*, std::string> names_;
};

/// Whether a key is a table with a heading of its own.
bool is_section(const SceneKey& key)
{
  const auto* table = std::get_if<TableTarget>(&key.target);
  return table && table->form != TableForm::braces;
}

/// The lines "key = value # unit" of a table.
std::string table_text(const Printer& printer, const SceneKeys& keys)
{
  std::string text;
  for (const SceneKey& key : keys)
    if (!is_section(key) && !is_absent(key))
      text += key.name + " = " + printer.value_text(key) + (has_unit(key.unit) ? "  # " + key.unit : "") + "\n";
  return text;
}

/// The keys of a table, of which an entry is made if there is none.
SceneKeys keys_of_table(const TableTarget& table)
{
  if (table.size() == 0) table.resize(1);
  return table.entry(0).keys;
}

/// The rule of a key's value: one of its words, or the range of a number. Empty: the unit says it.
std::string rule_text(const SceneKey& key)
{
  Words words;
  if (const auto* choice = std::get_if<Choice>(&key.target)) words = choice->words;
  if (const auto* start = std::get_if<StartTarget>(&key.target)) // the last word stands for a file
    words = start->kind.words.first(start->kind.words.size() - 1);
  std::string text = bounds_of(key.rule).page;
  for (const char* one : words) text += (text.empty() ? "" : ", ") + markdown_code(one);
  return text;
}

/// A section of the page of keys: heading, and a row for each key.
std::string page_table(const Printer& printer, const std::string& head, const std::string& meaning,
                       const SceneKeys& keys)
{
  static constexpr std::array effects = {"",        "load", "friction",        "gap", "drive",
                                         "damping", "mass", "stiffness, mass", "mesh"};
  std::string text = "\n### " + markdown_code(head) + ": " + meaning + "\n\n" +
                     markdown_head({"key", "unit", "default", "value", "changes", "meaning"});
  for (const SceneKey& key : keys)
    if (!is_section(key))
      text += markdown_row({markdown_code(key.name), key.unit,
                            key.need == Need::required ? "required" : markdown_code(printer.value_text(key)),
                            rule_text(key), effects.at(static_cast<std::size_t>(key.effect)), key.meaning});
  return text;
}

} // namespace

std::string word_of_value(const SceneKey& key)
{
  if (const auto* choice = std::get_if<Choice>(&key.target)) return choice->words[choice->get(choice->member)];
  Scene none;
  return Printer(none).value_text(key);
}

std::string resolved_scene(const Scene& scene)
{
  Scene copy = scene; // keys bind members that can be written
  const Printer printer(copy);
  const SceneKeys keys = keys_of(copy);
  std::string text = table_text(printer, keys);
  for (const SceneKey& key : keys)
    if (is_section(key))
      for (std::size_t i = 0; i < std::get<TableTarget>(key.target).size(); ++i)
      {
        const std::string heading = heading_of(key);
        text += "\n" + heading + "\n" + table_text(printer, std::get<TableTarget>(key.target).entry(i).keys);
      }
  return text;
}

std::vector<std::string> scene_key_names()
{
  Scene scene;
  std::vector<std::string> names;
  for (const SceneKey& key : keys_of(scene))
    if (!is_section(key))
      names.push_back(key.name);
    else if (const auto& table = std::get<TableTarget>(key.target); table.form == TableForm::single)
      for (const SceneKey& own : keys_of_table(table)) names.push_back(key.name + "." + own.name);
  return names;
}

std::string scene_reference()
{
  Scene scene;
  const Printer printer(scene);
  const SceneKeys keys = keys_of(scene);
  std::string text = page_table(printer, "scene", "at the top of the file", keys);
  std::map<std::string, SceneKeys> in_braces;
  for (const SceneKey& key : keys)
    if (is_section(key))
    {
      const SceneKeys own = keys_of_table(std::get<TableTarget>(key.target));
      text += page_table(printer, heading_of(key), key.meaning, own);
      for (const SceneKey& one : own)
        if (const auto* table = std::get_if<TableTarget>(&one.target)) in_braces[one.name] = keys_of_table(*table);
    }
  for (const auto& [name, own] : in_braces)
    text += page_table(printer, name + " = { … }", "in the braces of a key, which says what its numbers change", own);
  return text;
}

} // namespace squeal
