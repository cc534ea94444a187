#include "squeal/session_options.hpp"

#include "squeal/base/error.hpp"

#include <algorithm>
#include <array>
#include <sstream>
#include <unistd.h>

namespace squeal
{

namespace fs = std::filesystem;
using Strings = std::vector<std::string>;

namespace
{

/// What an option of the session takes.
enum class Value
{
  flag,         // nothing, or true or false
  options_file, // a file that exists, and holds options
  write_file,   // nothing, or a file that can be written
  viewer,       // [ascii][:file[:format]]
  info,         // nothing, or file[:classes]
  text,
};

struct SessionOption
{
  const char* name;
  Value value;
  const char* meaning;
};

constexpr std::array session_options = {
    SessionOption{"log_view", Value::viewer, "[:FILE[:FORMAT]]  where the time went, one stage per step of the chain"},
    SessionOption{"log_view_memory", Value::flag, "  adds memory to -log_view"},
    SessionOption{"log_all", Value::flag, "  keeps every event"},
    SessionOption{"log_trace", Value::write_file, "[FILE]  writes every event as it happens"},
    SessionOption{"log_exclude", Value::text, "CLASSES  leaves events out"},
    SessionOption{"info", Value::info, "[FILE[:CLASSES]]  PETSc's own messages"},
    SessionOption{"history", Value::write_file, "[FILE]  keeps what PETSc prints"},
    SessionOption{"options_file", Value::options_file, "FILE  more options"},
    SessionOption{"options_left", Value::flag, "  lists options that were not used"},
    SessionOption{"options_view", Value::flag, "  lists options"},
    SessionOption{"skip_petscrc", Value::flag, "  leaves files .petscrc out"},
    SessionOption{"malloc", Value::flag, "  PETSc's own allocator"},
    SessionOption{"malloc_debug", Value::flag, "  checks memory"},
    SessionOption{"malloc_dump", Value::flag, "  lists memory that was not freed"},
    SessionOption{"malloc_view", Value::write_file, "[FILE]  lists all memory"},
    SessionOption{"memory_view", Value::flag, "  memory at the end"},
    SessionOption{"no_signal_handler", Value::flag, "  leaves signals to the system"},
    SessionOption{"get_total_flops", Value::flag, "  counts operations"},
    SessionOption{"citations", Value::write_file, "[FILE]  what to cite of PETSc"},
};

constexpr SessionOption solver_view{"", Value::viewer, ""};

// How options end by which solvers print.
constexpr std::array views = {"_view",           "_view_pre",       "_view_solution",  "_view_mat",
                              "_view_pmat",      "_view_rhs",       "_view_values",    "_view_vectors",
                              "_error_relative", "_error_absolute", "_error_backward", "_converged_reason",
                              "_converged_rate"};

const SessionOption* find_option(const std::string& name)
{
  const auto found = std::find_if(session_options.begin(), session_options.end(),
                                  [&](const auto& option) { return name == option.name; });
  return found == session_options.end() ? nullptr : &*found;
}

bool is_one_of(const std::string& word, std::initializer_list<const char*> words)
{
  return std::any_of(words.begin(), words.end(), [&](const char* known) { return word == known; });
}

std::string problem_of_new_file(const std::string& name)
{
  const fs::path file(name), folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  constexpr std::size_t longest = 250, longest_path = 4000; // of names on Linux, with what PETSc appends
  if (file.filename().string().size() > longest || name.size() > longest_path) return "the name is too long";
  if (is_folder(file)) return shortened(name) + " is a folder";
  if (!is_folder(folder)) return "there is no folder " + shortened(folder);
  if (access((is_file(file) ? file : folder).c_str(), W_OK) != 0) return shortened(name) + " cannot be written";
  return {};
}

std::vector<std::string> parts_of(const std::string& value)
{
  std::vector<std::string> parts;
  std::istringstream stream(value);
  for (std::string part; std::getline(stream, part, ':');) parts.push_back(part);
  return parts;
}

/// The option of the session, or the one by which a solver prints; null if it is neither.
const SessionOption* find_printing_option(const std::string& name)
{
  const SessionOption* option = find_option(name);
  const bool is_monitor = name.find("_monitor") != std::string::npos && !name.ends_with("_monitor_cancel");
  return option || !(is_solver_view(name) || is_monitor) ? option : &solver_view;
}

/// The file that the option writes; empty if it writes none.
std::string file_of(const SessionOption& option, const std::string& value)
{
  const std::vector<std::string> parts = parts_of(value);
  switch (option.value)
  {
  case Value::write_file:
    return value;
  case Value::viewer:
    return parts.size() > 1 ? parts[1] : "";
  case Value::info:
    return parts.empty() ? "" : parts[0];
  default:
    return {};
  }
}

/// [ascii][:file[:format[:append]]]
std::string problem_of_viewer(const std::string& value)
{
  const std::vector<std::string> parts = parts_of(value);
  if (!parts.empty() && !is_one_of(parts[0], {"", "ascii"}))
    return "no viewer is called '" + shortened(parts[0]) + "'; write :FILE, :FILE:FORMAT or nothing";
  const Strings formats = {"ascii_info", "ascii_info_detail", "ascii_matlab",
                           "ascii_xml",  "ascii_csv",         "ascii_flamegraph"};
  if (parts.size() > 2 && !is_one_of(parts[2], {"", "default"}) &&
      std::ranges::find(formats, parts[2]) == formats.end())
  {
    std::string list;
    for (const std::string& format : formats) list += (list.empty() ? "" : ", ") + format;
    return "no format is called '" + shortened(parts[2]) + "'; known: " + list;
  }
  return parts.size() > 4 || (parts.size() > 3 && parts[3] != "append") ? "it has too many parts" : "";
}

std::string problem_of_value(const SessionOption& option, const std::string& value)
{
  if (value.empty()) return option.value == Value::options_file ? "it needs the name of a file" : "";
  if (option.value == Value::flag)
    return is_one_of(value, {"true", "false", "yes", "no", "on", "off", "1", "0"}) ? "" : "it is true or false";
  if (option.value == Value::options_file)
    return is_file(value) && access(value.c_str(), R_OK) == 0 ? "" : "there is no such file, or it cannot be read";
  const std::string file = file_of(option, value);
  std::string problem = option.value == Value::viewer ? problem_of_viewer(value) : "";
  if (problem.empty() && !file.empty()) problem = problem_of_new_file(file);
  return problem;
}

} // namespace

bool is_session_option(const std::string& name)
{
  return find_option(name) != nullptr;
}

bool is_solver_view(const std::string& name)
{
  return std::ranges::any_of(views, [&](const char* ending) { return name.ends_with(ending); });
}

std::string problem_of_session_option(const std::string& name, const std::string& value)
{
  const SessionOption* option = find_printing_option(name);
  const std::string problem = option ? problem_of_value(*option, value) : "";
  return problem.empty() ? "" : "option -" + name + " " + shortened(value) + ": " + problem;
}

std::string file_written_by(const std::string& name, const std::string& value)
{
  const SessionOption* option = find_printing_option(name);
  return option ? file_of(*option, value) : "";
}

bool names_options_file(const std::string& name)
{
  const SessionOption* option = find_option(name);
  return option && option->value == Value::options_file;
}

std::string session_option_reference()
{
  std::string text;
  for (const SessionOption& option : session_options)
    text += std::string("  -") + option.name + " " + option.meaning + "\n";
  return text;
}

} // namespace squeal
