#include "squeal/given_options.hpp"

#include "squeal/arguments.hpp"
#include "squeal/base/error.hpp"
#include "squeal/options.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace squeal
{

namespace
{

using Strings = std::vector<std::string>;

/// An option of the whole run, PETSc's own.
struct SessionOption
{
  const char* name;
  const char* meaning;
};

// PETSc obeys them while it starts, and says itself which value it does not take.
constexpr std::array session_options = {
    SessionOption{"log_view", "[:FILE[:FORMAT]]  where the time went, one stage per step of the chain"},
    SessionOption{"log_view_memory", "  adds memory to -log_view"},
    SessionOption{"log_all", "  keeps every event"},
    SessionOption{"log_trace", "[FILE]  writes every event as it happens"},
    SessionOption{"log_exclude", "CLASSES  leaves events out"},
    SessionOption{"info", "[FILE[:CLASSES]]  PETSc's own messages"},
    SessionOption{"history", "[FILE]  keeps what PETSc prints"},
    SessionOption{"options_left", "  lists options that were not used"},
    SessionOption{"options_view", "  lists options"},
    SessionOption{"malloc", "  PETSc's own allocator"},
    SessionOption{"malloc_debug", "  checks memory"},
    SessionOption{"malloc_dump", "  lists memory that was not freed"},
    SessionOption{"malloc_view", "[FILE]  lists all memory"},
    SessionOption{"memory_view", "  memory at the end"},
    SessionOption{"no_signal_handler", "  leaves signals to the system"},
    SessionOption{"get_total_flops", "  counts operations"},
    SessionOption{"citations", "[FILE]  what to cite of PETSc"},
};

/// Why PETSc must not see an option and its value; the name stands without its dash. Empty: it may.
std::string problem_of_option(const std::string& name, const std::string& value)
{
  if (std::ranges::find(session_options, name, &SessionOption::name) != session_options.end()) return {};
  if ((name == "modes_pep_type" && value == "jd") || (name == "cycle_snes_type" && value == "aspin"))
    return "option -" + name + " " + value + ": it needs more than an operator";
  return problem_of_option_name(name);
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
      if (is_scene_folder(entry.path()) || entry.path().extension() == ".toml")
        known.push_back(folder / entry.path().filename());
  const std::string under = (std::filesystem::path("inputs") / name).string();
  return std::ranges::find(known, under) == known.end() ? spelling_hint(name.string(), known)
                                                        : "; did you mean '" + under + "'?";
}

void examine(const Strings& words)
{
  for (std::size_t i = 0; i < words.size(); ++i)
  {
    if (!is_option(words[i]))
      throw Error((is_scene_folder(words[i]) ? "a second scene '" : "there is no scene '") + shortened(words[i]) +
                  "': a scene is one file that ends in .toml, or a folder that holds a scene.toml" +
                  (is_scene_folder(words[i]) ? "; a run takes one" : hint_of_scene(words[i])));
    const bool has_value = i + 1 < words.size() && !is_option(words[i + 1]);
    const std::string name = words[i].substr(1), value = has_value ? words[++i] : "";
    if (const std::string problem = problem_of_option(name, value); !problem.empty()) throw Error(problem);
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
    examine(given.words);
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
