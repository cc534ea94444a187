/// A scene back to text, and the reference of all keys, both from the fields.
#include "squeal/scene/toml.hpp"

#include <charconv>
#include <sstream>

namespace squeal
{

namespace
{

// An empty text means: leave the key out, its default says the same.

std::string print(const std::string& text)
{
  return toml_string(text);
}

/// Shortest text that reads back as the same number.
std::string print(double value)
{
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  std::string result(text, end);
  if (result.find_first_of(".e") == std::string::npos && result.size() > 15) result += ".0"; // not a 64-bit integer
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
  return print_list(list);
}

std::string print(const std::array<double, 6>& list)
{
  return print_list(list);
}

std::string print(const Motions& motions)
{
  const char* names[] = {"x", "y", "z", "rx", "ry", "rz"};
  std::string text;
  for (std::size_t i = 0; i < 6; ++i)
    if (motions[i]) text += std::string(text.empty() ? "" : " ") + names[i];
  return print(text.empty() ? std::string("none") : text);
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

/// Directions and drives that were not given are zero, which is no value of theirs.
bool says_nothing(const Field& field)
{
  const Vec3* const* vector = std::get_if<Vec3*>(&field.target);
  return vector && field.need == Need::optional && **vector == Vec3{};
}

std::string value_text(const Field& field)
{
  if (says_nothing(field)) return "";
  return std::visit(
      [](const auto& target)
      {
        if constexpr (std::is_pointer_v<std::decay_t<decltype(target)>>)
          return print(*target);
        else
          return print(target);
      },
      field.target);
}

std::string lines_of(const Fields& list)
{
  std::string text;
  for (const Field& field : list)
    if (const std::string value = value_text(field); !value.empty())
      text += field.key + " = " + value + (has_unit(field.unit) ? "  # " + field.unit : "") + "\n";
  return text;
}

struct TextWriter
{
  std::string& text;

  template <class T> void operator()(const std::string& key, std::vector<T>& list, const char*) const
  {
    for (T& entry : list) text += "\n[[" + key + "]]\n" + lines_of(fields(entry));
  }
  template <class T> void operator()(const std::string& key, std::optional<T>& table, const char*) const
  {
    if (table) text += "\n[" + key + "]\n" + lines_of(fields(*table));
  }
  template <class T> void operator()(const std::string& key, T& table, const char*) const
  {
    text += "\n[" + key + "]\n" + lines_of(fields(table));
  }
};

std::string reference_lines(const Fields& list)
{
  std::ostringstream text;
  for (const Field& field : list)
  {
    std::string note = field.need == Need::required ? "required" : value_text(field);
    note = field.unit + (note.empty() ? "" : ", " + note);
    text << "  " << field.key << std::string(field.key.size() < 18 ? 18 - field.key.size() : 1, ' ') << field.meaning
         << " [" << note << "]\n";
  }
  return text.str();
}

struct ReferenceWriter
{
  std::string& text;

  template <class T> void operator()(const std::string& key, std::vector<T>&, const char* meaning) const
  {
    T entry{};
    text += "[[" + key + "]]  " + meaning + "\n" + reference_lines(fields(entry));
  }
  template <class T> void operator()(const std::string& key, std::optional<T>&, const char* meaning) const
  {
    T entry{};
    text += "[" + key + "]  " + meaning + "\n" + reference_lines(fields(entry));
  }
  template <class T> void operator()(const std::string& key, T& table, const char* meaning) const
  {
    text += "[" + key + "]  " + meaning + "\n" + reference_lines(fields(table));
  }
};

} // namespace

std::string resolved_scene(const Scene& scene)
{
  Scene copy = scene; // the fields bind members to write to
  std::string text = lines_of(fields(copy));
  // A matrix scene brings its damping in C; the table would be refused there.
  for_each_table(copy,
                 [&](const std::string& key, auto& table, const char* meaning)
                 {
                   if (key == "damping" && copy.matrices) return;
                   TextWriter{text}(key, table, meaning);
                 });
  return text;
}

std::string scene_reference()
{
  Scene scene;
  Rotation rotation;
  std::string text = "Keys of a scene file (TOML, SI units) [unit, default]:\n" + reference_lines(fields(scene));
  for_each_table(scene, ReferenceWriter{text});
  return text + "rotation = { ... } of a contact\n" + reference_lines(fields(rotation));
}

} // namespace squeal
