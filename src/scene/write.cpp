/// The resolved scene as text, and the reference of all keys.
#include "toml_values.hpp"

#include "squeal/base/markdown.hpp"
#include "squeal/scene/reference.hpp"

#include <array>
#include <charconv>
#include <sstream>

namespace squeal
{

namespace
{

// print returns the TOML text of a value. It is empty where the key is left out, since its default means the same.

std::string print(const std::string& text)
{
  return toml_string(text);
}

/// The text is the shortest that reads back as the same number.
std::string print(double value)
{
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  std::string result(text, end);
  if (result.find_first_of(".e") == std::string::npos && result.size() > 15) result += ".0"; // no TOML integer
  return result;
}

std::string print(int value)
{
  return std::to_string(value);
}

std::string print(long value)
{
  return std::to_string(value);
}

std::string print(bool value)
{
  return value ? "true" : "false";
}

std::string print(const std::filesystem::path& path)
{
  return path.empty() ? "" : print(path.string());
}

std::string print(const Vec3& vector);
std::string print(const std::vector<double>& list);

template <class List> std::string print_list(const List& list)
{
  std::string text;
  for (const auto& entry : list) text += (text.empty() ? "" : ", ") + print(entry);
  return "[" + text + "]";
}

std::string print(const Vec3& vector)
{
  return print_list(vector);
}

std::string print(const std::optional<Vec3>& vector)
{
  return vector ? print(*vector) : "";
}

std::string print(const std::vector<Vec3>& list)
{
  return list.empty() ? "" : print_list(list);
}

std::string print(const std::vector<std::string>& list)
{
  return list.empty() ? "" : print_list(list);
}

std::string print(const std::vector<double>& list)
{
  return list.empty() ? "" : print_list(list);
}

std::string print(const std::vector<int>& list)
{
  return list.size() == 1 ? print(list.front()) : print_list(list);
}

std::string print(const std::array<double, 6>& list)
{
  return print_list(list);
}

std::string print(const Motions& motions)
{
  std::string text;
  for (std::size_t i = 0; i < 6; ++i)
    if (motions[i]) text += std::string(text.empty() ? "" : " ") + motion_words[i];
  return print(text.empty() ? no_motions : text);
}

std::string print(const std::map<std::string, double>& table)
{
  std::string text;
  for (const auto& [key, value] : table) text += (text.empty() ? " " : ", ") + print(key) + " = " + print(value);
  return table.empty() ? "" : "{" + text + " }";
}

std::string print(const std::optional<Rotation>& rotation)
{
  if (!rotation) return "";
  return "{ axis = " + print(rotation->axis) + ", centre = " + print(rotation->centre) +
         ", rate = " + print(rotation->rate) + " }";
}

std::string print(const std::optional<Orthotropy>& material)
{
  if (!material) return "";
  return "{ young = " + print(material->young) + ", poisson = " + print(material->poisson) +
         ", shear = " + print(material->shear) + ", axis_1 = " + print(material->axis_1) +
         ", axis_2 = " + print(material->axis_2) + " }";
}

std::string print(const std::vector<MeasuredRatio>& measured)
{
  std::vector<std::vector<double>> rows;
  for (const auto& [frequency_hz, ratio] : measured) rows.push_back({frequency_hz, ratio});
  return rows.empty() ? "" : print_list(rows);
}

std::string print(const TimeFactor& factor)
{
  std::vector<std::vector<double>> rows;
  for (std::size_t i = 0; i < factor.time.size(); ++i) rows.push_back({factor.time[i], factor.value[i]});
  return rows.empty() ? "" : print_list(rows);
}

std::string print(const DampingTarget& target)
{
  return *target.damping ? print((**target.damping).*target.member) : "";
}

std::string print(const Choice& target)
{
  return print(std::string(target.words[target.get(target.member)]));
}

std::string print(const Start& start)
{
  return print(start.kind == StartKind::file ? start.file.string() : std::string(word(start.kind)));
}

std::string print(const CycleStart& start)
{
  return print(start.kind == CycleStartKind::file ? start.file.string() : std::string(word(start.kind)));
}

/// Whether a vector was not given. Optional vectors are directions and velocities, for which zero is no valid value.
bool is_absent(const SceneKey& key)
{
  const Vec3* const* vector = std::get_if<Vec3*>(&key.target);
  return vector && key.need == Need::optional && **vector == Vec3{};
}

std::string value_text(const SceneKey& key)
{
  if (is_absent(key)) return "";
  return std::visit(
      [](const auto& target)
      {
        if constexpr (std::is_pointer_v<std::decay_t<decltype(target)>>)
          return print(*target);
        else
          return print(target);
      },
      key.target);
}

/// The lines "key = value # unit" of a table.
std::string table_text(const SceneKeys& keys)
{
  std::string text;
  for (const SceneKey& key : keys)
    if (const std::string value = value_text(key); !value.empty())
      text += key.name + " = " + value + (has_unit(key.unit) ? "  # " + key.unit : "") + "\n";
  return text;
}

/// Appends a table of the resolved scene.
struct TextWriter
{
  std::string& text;

  template <class T> void operator()(const std::string& key, std::vector<T>& list, const char*) const
  {
    for (T& entry : list) text += "\n[[" + key + "]]\n" + table_text(keys_of(entry));
  }
  template <class T> void operator()(const std::string& key, std::optional<T>& table, const char*) const
  {
    if (table) text += "\n[" + key + "]\n" + table_text(keys_of(*table));
  }
  template <class T> void operator()(const std::string& key, T& table, const char*) const
  {
    text += "\n[" + key + "]\n" + table_text(keys_of(table));
  }
};

/// A table of the help: its head and a line "key meaning [unit, default]" for each key.
std::string help_table(const std::string& head, const char* meaning, const SceneKeys& keys)
{
  std::ostringstream text;
  text << head << "  " << meaning << "\n";
  for (const SceneKey& key : keys)
  {
    std::string note = key.need == Need::required ? "required" : value_text(key);
    note = key.unit + (note.empty() ? "" : ", " + note);
    text << "  " << key.name << std::string(key.name.size() < 18 ? 18 - key.name.size() : 1, ' ') << key.meaning << " ["
         << note << "]\n";
  }
  return text.str();
}

/// What a key's value must be: one of its words, or a number by its rule. Empty: the unit says it.
std::string rule_text(const SceneKey& key)
{
  static constexpr std::array rules = {
      "",          "above 0",       "0 or above",     "above -1, below 0.5", "above 0, at most 1",
      "direction", "existing file", "existing folder"};
  Words words;
  if (const auto* choice = std::get_if<Choice>(&key.target)) words = choice->words;
  if (std::holds_alternative<Start*>(key.target)) words = words_of(StartKind::file);
  if (std::holds_alternative<CycleStart*>(key.target)) words = words_of(CycleStartKind::file);
  std::string text = rules.at(static_cast<std::size_t>(key.rule));
  for (const char* one : words) text += (text.empty() ? "" : ", ") + markdown_code(one);
  return text;
}

/// A section of the page of keys: heading, and a row for each key.
std::string page_table(const std::string& head, const char* meaning, const SceneKeys& keys)
{
  static constexpr std::array effects = {"",        "load", "friction",        "contact",
                                         "damping", "mass", "stiffness, mass", "mesh"};
  std::string text = "\n### " + markdown_code(head) + ": " + meaning + "\n\n" +
                     markdown_head({"key", "unit", "default", "value", "changes", "meaning"});
  for (const SceneKey& key : keys)
    text += markdown_row({markdown_code(key.name), key.unit,
                          key.need == Need::required ? "required" : markdown_code(value_text(key)), rule_text(key),
                          effects.at(static_cast<std::size_t>(key.effect)), key.meaning});
  return text;
}

/// Appends a table of a reference.
struct ReferenceWriter
{
  std::string& text;
  std::string (*table_text)(const std::string& head, const char* meaning, const SceneKeys& keys);

  template <class T> void operator()(const std::string& key, std::vector<T>&, const char* meaning) const
  {
    T entry{};
    text += table_text("[[" + key + "]]", meaning, keys_of(entry));
  }
  template <class T> void operator()(const std::string& key, std::optional<T>&, const char* meaning) const
  {
    T entry{};
    text += table_text("[" + key + "]", meaning, keys_of(entry));
  }
  template <class T> void operator()(const std::string& key, T& table, const char* meaning) const
  {
    text += table_text("[" + key + "]", meaning, keys_of(table));
  }
};

/// Appends the names of a table's keys.
struct NamesWriter
{
  std::vector<std::string>& names;

  template <class T> void operator()(const std::string&, std::vector<T>&, const char*) const {}
  template <class T> void operator()(const std::string& key, std::optional<T>&, const char* meaning) const
  {
    T entry{};
    (*this)(key, entry, meaning);
  }
  template <class T> void operator()(const std::string& key, T& table, const char*) const
  {
    for (const SceneKey& own : keys_of(table)) names.push_back(key + "." + own.name);
  }
};

} // namespace

std::string resolved_scene(const Scene& scene)
{
  Scene copy = scene; // keys_of binds members that can be written
  std::string text = table_text(keys_of(copy));
  for_each_table(copy, TextWriter{text});
  return text;
}

std::vector<std::string> scene_key_names()
{
  Scene scene;
  std::vector<std::string> names;
  for (const SceneKey& own : keys_of(scene)) names.push_back(own.name);
  for_each_table(scene, NamesWriter{names});
  return names;
}

std::string scene_reference()
{
  Scene scene;
  Rotation rotation;
  Orthotropy orthotropy;
  std::string text = help_table("Keys of a scene file (TOML, SI units)", "[unit, default]:", keys_of(scene));
  for_each_table(scene, ReferenceWriter{text, help_table});
  return text + help_table("rotation = { ... }", "of a contact or a part", keys_of(rotation)) +
         help_table("orthotropic = { ... }", "of a part", keys_of(orthotropy));
}

std::string scene_page()
{
  Scene scene;
  Rotation rotation;
  Orthotropy orthotropy;
  std::string text = page_table("scene", "at the top of the file", keys_of(scene));
  for_each_table(scene, ReferenceWriter{text, page_table});
  return text + page_table("rotation = { … }", "of a contact or a part, which its numbers change", keys_of(rotation)) +
         page_table("orthotropic = { … }", "of a part, which its numbers change", keys_of(orthotropy));
}

} // namespace squeal
