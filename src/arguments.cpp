#include "squeal/arguments.hpp"

#include "squeal/base/error.hpp"
#include "squeal/base/markdown.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <unistd.h>

namespace squeal
{

namespace
{

/// The arguments of squeal's own. Units name their values.
SceneKeys keys_of(Arguments& a)
{
  return {
      {"--set", &a.overrides, "key=value", "overrides a key of the scene, e.g. --set friction.coefficient=0.25"},
      {"--output", &a.output, "DIR", "where results go (results/<scene>)"},
      {"--time-limit", &a.limits.time_limit, "S",
       "ends the run in order after S seconds, as SIGTERM, SIGINT, SIGHUP, SIGUSR1, SIGUSR2 and SIGXCPU do",
       Rule::positive},
      {"--checkpoint", &a.limits.checkpoint_interval, "S", "seconds between checkpoints [600]", Rule::positive},
      {"--restart", &a.restart, "switch",
       "goes on from the checkpoints of a run that ended early or was killed, if there are any"},
      {"--verbose", &a.verbose, "switch", "prints every result; -v as well"},
      {"--version", &a.version, "switch", "versions of squeal and of the libraries it runs on"},
      {"--help", &a.help, "switch",
       "this text; -help and -h as well; --help mesh: the keys of [mesh], or of another table"},
      {"--reference", choice_of(a.reference), "PAGE",
       "keys or results: the page of all keys, options and arguments, or of all results"},
      {"--allow-scripts", &a.allow_scripts, "switch",
       "lets the scene's geometry run commands and write files, as gmsh's statements can"},
      {"--force", &a.force, "switch", "runs even where the forecast says more than a day, or more memory than is free"},
      {"--dry-run", &a.dry_run, "switch", "checks scene and mesh, prints the model's size and the forecast, and stops"},
      {"--resolve", &a.resolve, "switch", "with --dry-run: prints the scene as well, every default written out"},
  };
}

std::vector<std::string> argument_names()
{
  Arguments unused;
  std::vector<std::string> names;
  for (const SceneKey& known : keys_of(unused)) names.push_back(known.name);
  return names;
}

bool is_switch(const SceneKey& argument)
{
  return std::holds_alternative<bool*>(argument.target);
}

/// "--output DIR"
std::string form_of(const SceneKey& argument)
{
  return argument.name + (is_switch(argument) ? "" : " " + argument.unit);
}

/// Whether it can be the name of a tool: letters alone, so that no scene with a folder or an ending is mistaken.
bool is_plain_word(const std::string& word)
{
  return !word.empty() && word.find_first_not_of("abcdefghijklmnopqrstuvwxyz") == std::string::npos;
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
  const std::vector<std::string> names = argument_names();
  const auto whole = std::ranges::find_if(names, [&](const std::string& name) { return name.starts_with(word); });
  const std::string hint = spelling_hint(whole == names.end() ? word.substr(0, 40) : *whole, names);
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

bool is_scene(const std::filesystem::path& path)
{
  return path.extension() == ".toml" || is_file(path / scene_file);
}

Arguments take_arguments(int& argc, char** argv)
{
  Arguments arguments;
  arguments.program = shell_word(argv[0]);
  arguments.command = command_of(argc, argv);
  const SceneKeys keys = keys_of(arguments);
  int kept = 1;
  for (int i = 1; i < argc; ++i)
  {
    const std::string given = argv[i], word = long_form(given);
    const auto known = std::ranges::find(keys, word, &SceneKey::name);
    if (known != keys.end() && !is_switch(*known) && i + 1 == argc)
      arguments.problem = word + " needs a value: squeal -help lists the arguments";
    else if (known != keys.end())
      try
      {
        set_by_word("argument", *known, is_switch(*known) ? "" : argv[++i]);
        if (known->name == "--help" && arguments.section.empty() && i + 1 < argc && argv[i + 1][0] != '-')
          arguments.section = argv[++i];
      }
      catch (const Error& error)
      {
        arguments.problem = error.what();
      }
    else if (word.starts_with("--") || asks_for_ranks(word))
      arguments.problem = unknown_argument(word);
    else if (arguments.scene.empty() && word[0] != '-' && is_scene(word))
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
  Arguments unused;
  std::string text;
  for (const SceneKey& known : keys_of(unused))
    text += format("  %-17s %s\n", form_of(known).c_str(), known.meaning.c_str());
  return text;
}

std::string argument_page()
{
  Arguments unused;
  std::string rows = markdown_head({"argument", "meaning"});
  for (const SceneKey& known : keys_of(unused)) rows += markdown_row({markdown_code(form_of(known)), known.meaning});
  return rows;
}

void become_tool(int argc, char** argv)
{
  namespace fs = std::filesystem;
  if (argc < 2 || !is_plain_word(argv[1]) || is_scene(argv[1])) return;
  std::error_code code;
  const fs::path program = fs::read_symlink("/proc/self/exe", code), prefix = program.parent_path().parent_path();
  for (const fs::path& folder : {prefix / "tools", prefix / "share/squeal/tools"})
  {
    const fs::path tool = folder / argv[1];
    if (!is_file(tool) || access(tool.c_str(), X_OK) != 0) continue;
    setenv("SQUEAL", program.c_str(), 0);
    execv(tool.c_str(), argv + 1);
    std::fprintf(stderr, "squeal: error: %s cannot be run: %s\n", tool.c_str(), std::strerror(errno));
    std::exit(1);
  }
}

} // namespace squeal
