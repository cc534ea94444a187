#include "squeal/arguments.hpp"
#include "squeal/base/error.hpp"
#include "squeal/options.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>

namespace squeal
{

namespace
{

using Strings = std::vector<std::string>;

/// The value that an option of PETSc's takes.
enum class Value
{
  flag,   // nothing, or true or false
  file,   // nothing, or a file that can be written, with more behind a colon
  viewer, // [ascii][:file[:format[:append]]]
  text,
};

struct SessionOption
{
  const char* name;
  Value value;
  const char* meaning;
};

// PETSc obeys them while it starts, and ends the process at the first value that it does not take.
constexpr std::array session_options = {
    SessionOption{"log_view", Value::viewer, "[:FILE[:FORMAT]]  where the time went, one stage per step of the chain"},
    SessionOption{"log_view_memory", Value::flag, "  adds memory to -log_view"},
    SessionOption{"log_trace", Value::file, "[FILE]  writes every event as it happens"},
    SessionOption{"info", Value::file, "[FILE[:CLASSES]]  PETSc's own messages"},
    SessionOption{"history", Value::file, "[FILE]  keeps what PETSc prints"},
    SessionOption{"options_left", Value::flag, "  lists options that were not used"},
    SessionOption{"options_view", Value::flag, "  lists options"},
    SessionOption{"malloc_debug", Value::flag, "  checks memory"},
    SessionOption{"memory_view", Value::flag, "  memory at the end"},
    SessionOption{"citations", Value::file, "[FILE]  what to cite of PETSc"},
};

bool is_one_of(const std::string& word, std::initializer_list<const char*> words)
{
  return std::ranges::any_of(words, [&](const char* known) { return word == known; });
}

Strings parts_of(const std::string& value)
{
  Strings parts;
  std::istringstream stream(value);
  for (std::string part; std::getline(stream, part, ':');) parts.push_back(part);
  return parts;
}

/// Tries whether the file can be written, so that a long run does not end without it. Leaves none behind.
std::string problem_of_new_file(const std::string& name)
{
  if (name.empty()) return {};
  std::error_code none;
  const bool is_new = !std::filesystem::exists(name, none);
  if (!std::ofstream(name, std::ios::app)) return shortened(name) + " cannot be written: " + std::strerror(errno);
  if (is_new) std::filesystem::remove(name, none);
  return {};
}

/// The file that PETSc writes by a value; empty: it writes none.
std::string written_by(Value kind, const Strings& parts)
{
  if (kind == Value::viewer) return parts.size() > 1 ? parts[1] : "";
  return kind == Value::file && !parts.empty() ? parts[0] : "";
}

std::string problem_of_viewer(const Strings& parts)
{
  if (!parts.empty() && !is_one_of(parts[0], {"", "ascii"}))
    return "no viewer is called '" + shortened(parts[0]) + "'; write :FILE, :FILE:FORMAT or nothing";
  const std::string formats = "ascii_info, ascii_info_detail, ascii_matlab, ascii_xml, ascii_csv, ascii_flamegraph";
  if (parts.size() > 2 && !is_one_of(parts[2], {"", "default"}) &&
      (", " + formats + ",").find(", " + parts[2] + ",") == std::string::npos)
    return "no format is called '" + shortened(parts[2]) + "'; known: " + formats;
  return {};
}

std::string problem_of_value(Value kind, const std::string& value)
{
  const Strings parts = parts_of(value);
  if (parts.empty() || kind == Value::text) return {};
  if (kind == Value::flag)
    return is_one_of(value, {"true", "false", "yes", "no", "on", "off", "1", "0"}) ? "" : "it is true or false";
  const std::string problem = kind == Value::viewer ? problem_of_viewer(parts) : "";
  return problem.empty() ? problem_of_new_file(written_by(kind, parts)) : problem;
}

/// The kind of value of an option of the session, or of one by which a solver prints; nothing: another option.
std::optional<Value> kind_of(const std::string& name)
{
  const auto of_session = std::ranges::find(session_options, name, &SessionOption::name);
  if (of_session != session_options.end()) return of_session->value;
  return is_printing_option(name) && solver_prefix_of(name) ? std::optional(Value::viewer) : std::nullopt;
}

/// Why PETSc must not see an option and its value; the name stands without its dash. Empty: it may.
std::string problem_of_option(const std::string& name, const std::string& value)
{
  std::string problem;
  if (const std::optional<Value> kind = kind_of(name))
    problem = problem_of_value(*kind, value);
  else if (name.ends_with("_type") && (value.empty() || (name == "modes_pep_type" && value == "jd") ||
                                       (name == "cycle_snes_type" && value == "aspin")))
    problem = "it takes a type that needs no more than an operator";
  else
    return problem_of_option_name(name);
  return problem.empty() ? "" : "option -" + name + " " + shortened(value) + ": " + problem;
}

bool is_letter(const std::string& word, std::size_t place)
{
  return place < word.size() && std::isalpha(static_cast<unsigned char>(word[place]));
}

/// PETSc takes -name and --name for options, and -3 for a value.
bool is_option(const std::string& word)
{
  return word.size() > 1 && word[0] == '-' && (is_letter(word, 1) || (word[1] == '-' && is_letter(word, 2)));
}

/// A scene whose name is near to this one; empty: there is none.
std::string hint_of_scene(const std::string& word)
{
  const std::filesystem::path given = std::filesystem::path(word).lexically_normal();
  const std::filesystem::path name = given.has_filename() ? given : given.parent_path();
  Strings known;
  std::error_code failed;
  for (const auto& folder : {name.parent_path(), std::filesystem::path("inputs")})
    for (const auto& entry : std::filesystem::directory_iterator(folder.empty() ? "." : folder, failed))
      if (is_scene(entry.path())) known.push_back(folder / entry.path().filename());
  const std::string under = (std::filesystem::path("inputs") / name).string();
  return std::ranges::find(known, under) == known.end() ? spelling_hint(name.string(), known)
                                                        : "; did you mean '" + under + "'?";
}

void examine(GivenOptions& given)
{
  const Strings& words = given.words;
  for (std::size_t i = 0; i < words.size(); ++i)
  {
    if (!is_option(words[i]))
      throw Error((is_scene(words[i]) ? "a second scene '" : "there is no scene '") + shortened(words[i]) +
                  "': a scene is one file that ends in .toml, or a folder that holds a scene.toml" +
                  (is_scene(words[i]) ? "; a run takes one: take the other out" : hint_of_scene(words[i])));
    const bool has_value = i + 1 < words.size() && !is_option(words[i + 1]);
    const std::string name = words[i].substr(1), value = has_value ? words[++i] : "";
    if (const std::string problem = problem_of_option(name, value); !problem.empty()) throw Error(problem);
    const std::string file = written_by(kind_of(name).value_or(Value::text), parts_of(value));
    if (!file.empty()) given.written.push_back(file);
  }
}

/// The words of a file, without comments.
Strings words_of_file(const std::string& name)
{
  std::ifstream stream(name);
  if (!is_file(name) || !stream)
    throw Error("option -options_file " + shortened(name) + ": there is no such file, or it cannot be read");
  Strings all;
  for (std::string line; std::getline(stream, line);)
  {
    const Strings words = words_in(line.substr(0, line.find('#')));
    all.insert(all.end(), words.begin(), words.end());
  }
  return all;
}

} // namespace

GivenOptions given_options(int argc, char** argv)
{
  const char* variable = std::getenv("PETSC_OPTIONS");
  Strings from_variable = words_in(variable ? variable : "");
  GivenOptions given;
  given.from_variable = !from_variable.empty();
  Strings words = std::move(from_variable);
  words.insert(words.end(), argv + std::min(argc, 1), argv + argc);
  try
  {
    for (std::size_t i = 0; i < words.size(); ++i)
      if (words[i] != "-options_file")
        given.words.push_back(words[i]);
      else
        for (std::string& word : words_of_file(++i < words.size() ? words[i] : ""))
          given.words.push_back(std::move(word));
    examine(given);
  }
  catch (const Error& error)
  {
    given.problem = error.what();
  }
  return given;
}

bool is_printing_option(const std::string& name)
{
  constexpr std::array views = {"_view",           "_view_pre",       "_view_solution",  "_view_mat",
                                "_view_pmat",      "_view_rhs",       "_view_values",    "_view_vectors",
                                "_error_relative", "_error_absolute", "_error_backward", "_converged_reason",
                                "_converged_rate"};
  return std::ranges::any_of(views, [&](const char* ending) { return name.ends_with(ending); }) ||
         (name.find("_monitor") != std::string::npos && !name.ends_with("_monitor_cancel"));
}

std::string session_option_reference()
{
  std::string text = "  -options_file FILE  more options; # begins a comment\n";
  for (const SessionOption& option : session_options)
    text += std::string("  -") + option.name + " " + option.meaning + "\n";
  return text;
}

} // namespace squeal
