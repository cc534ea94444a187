#include "squeal/arguments.hpp"

#include "squeal/base/error.hpp"
#include "squeal/base/markdown.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

namespace squeal
{

namespace
{

/// A number of seconds above 0; otherwise sets the problem.
void read_seconds(const std::string& word, const std::string& value, double& seconds, std::string& problem)
{
  char* end = nullptr;
  seconds = std::strtod(value.c_str(), &end);
  if (*end != 0 || !(seconds > 0)) problem = word + " " + value + ": it needs a number of seconds above 0";
}

/// An argument of squeal's own: how it is written, what the help says, and what it does. Those with a value name it.
struct Argument
{
  const char* name;
  const char* value; // null: it takes none
  const char* meaning;
  void (*take)(Arguments& arguments, const std::string& value);
};

const std::array known_arguments = {
    Argument{"--set", "key=value", "overrides a key of the scene, e.g. --set friction.coefficient=0.25",
             [](Arguments& arguments, const std::string& value) { arguments.overrides.push_back(value); }},
    Argument{"--output", "DIR", "where results go (results/<scene>)",
             [](Arguments& arguments, const std::string& value) { arguments.output = value; }},
    Argument{"--time-limit", "S",
             "ends the run in order after S seconds, as SIGTERM, SIGINT, SIGHUP, SIGUSR1, SIGUSR2 and SIGXCPU do",
             [](Arguments& arguments, const std::string& value)
             { read_seconds("--time-limit", value, arguments.limits.time_limit, arguments.problem); }},
    Argument{"--checkpoint", "S", "seconds between checkpoints [600]",
             [](Arguments& arguments, const std::string& value)
             { read_seconds("--checkpoint", value, arguments.limits.checkpoint_interval, arguments.problem); }},
    Argument{"--restart", nullptr,
             "goes on from the checkpoints of a run that ended early or was killed, if there are any",
             [](Arguments& arguments, const std::string&) { arguments.restart = true; }},
    Argument{"--verbose", nullptr, "prints every result before the short table; -v as well",
             [](Arguments& arguments, const std::string&) { arguments.length = TableLength::full; }},
    Argument{"--version", nullptr, "versions of squeal and of the libraries it runs on",
             [](Arguments& arguments, const std::string&) { arguments.version = true; }},
    Argument{"--help", nullptr, "this text; -help and -h as well; --help mesh: the keys of [mesh], or of another table",
             [](Arguments& arguments, const std::string&) { arguments.help = true; }},
    Argument{"--reference", "PAGE", "keys or results: the page of all keys, options and arguments, or of all results",
             [](Arguments& arguments, const std::string& value)
             {
               arguments.reference = value;
               if (value != "keys" && value != "results")
                 arguments.problem = "--reference " + shortened(value) + ": it takes keys or results";
             }},
    Argument{"--allow-scripts", nullptr,
             "lets the scene's geometry run commands and write files, as gmsh's statements can",
             [](Arguments& arguments, const std::string&) { arguments.allow_scripts = true; }},
    Argument{"--force", nullptr, "runs even where the forecast says more than a day, or more memory than is free",
             [](Arguments& arguments, const std::string&) { arguments.force = true; }},
    Argument{"--dry-run", nullptr,
             "checks scene and mesh, prints the resolved scene, the model's size and the forecast, and stops",
             [](Arguments& arguments, const std::string&) { arguments.dry_run = true; }}};

std::vector<std::string> argument_names()
{
  std::vector<std::string> names;
  for (const Argument& known : known_arguments) names.emplace_back(known.name);
  return names;
}

/// Whether a word asks for a number of ranks, which only the launcher can give.
bool asks_for_ranks(const std::string& word)
{
  const std::array words = {"-n", "-np", "-ranks", "--n", "--np", "--ranks"};
  return std::ranges::find(words, word.substr(0, word.find('='))) != words.end();
}

std::string unknown_argument(const std::string& word)
{
  const std::string unknown = "unknown argument " + shortened(word);
  if (asks_for_ranks(word))
    return unknown + "; ranks are given before the program: RANKS=4 tools/run SCENE, or mpirun -n 4 squeal SCENE";
  const std::string hint = spelling_hint(word.substr(0, 40), argument_names());
  return unknown + (hint.empty() ? "; squeal -help lists the arguments" : hint);
}

/// An argument of squeal's own with two dashes, also where it was given with one, or in short.
std::string long_form(const std::string& word)
{
  if (word == "-h") return "--help";
  if (word == "-v") return "--verbose";
  const std::vector<std::string> names = argument_names();
  return std::ranges::find(names, "-" + word) == names.end() ? word : "-" + word;
}

/// A word in quotes where a shell would take it apart.
std::string shell_word(const std::string& word)
{
  constexpr const char* plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./:,@%";
  if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) return word;
  std::string quoted = "'";
  for (const char letter : word) quoted += letter == '\'' ? "'\\''" : std::string(1, letter);
  return quoted + "'";
}

std::string command_of(int argc, char** argv)
{
  std::string text = shell_word(argv[0]);
  for (int i = 1; i < argc; ++i) text.append(" ").append(shell_word(argv[i]));
  return text;
}

} // namespace

bool is_scene_folder(const std::filesystem::path& folder)
{
  return is_file(folder / scene_file);
}

Arguments take_arguments(int& argc, char** argv)
{
  Arguments arguments;
  arguments.program = shell_word(argv[0]);
  arguments.command = command_of(argc, argv);
  int kept = 1;
  for (int i = 1; i < argc; ++i)
  {
    const std::string given = argv[i], word = long_form(given);
    const auto known = std::ranges::find_if(known_arguments, [&](const Argument& one) { return word == one.name; });
    if (known != known_arguments.end() && !known->value)
    {
      known->take(arguments, {});
      if (arguments.help && arguments.section.empty() && i + 1 < argc && argv[i + 1][0] != '-')
        arguments.section = argv[++i];
    }
    else if (known != known_arguments.end() && i + 1 < argc)
      known->take(arguments, argv[++i]);
    else if (known != known_arguments.end())
      arguments.problem = word + " needs a value: squeal -help lists the arguments";
    else if (word.starts_with("--") || asks_for_ranks(word))
      arguments.problem = unknown_argument(word);
    else if (arguments.scene.empty() && word[0] != '-' && (word.ends_with(".toml") || is_scene_folder(word)))
      arguments.scene =
          word.ends_with(".toml") ? std::filesystem::path(word) : std::filesystem::path(word) / scene_file;
    else
      argv[kept++] = argv[i];
  }
  argc = kept;
  argv[argc] = nullptr;
  return arguments;
}

std::string argument_reference()
{
  std::string text;
  for (const Argument& known : known_arguments)
  {
    const std::string name = std::string(known.name) + (known.value ? std::string(" ") + known.value : "");
    text += format("  %-17s %s\n", name.c_str(), known.meaning);
  }
  return text;
}

std::string argument_page()
{
  std::string rows = markdown_head({"argument", "meaning"});
  for (const Argument& known : known_arguments)
    rows +=
        markdown_row({markdown_code(known.name + (known.value ? std::string(" ") + known.value : "")), known.meaning});
  return rows;
}

} // namespace squeal
