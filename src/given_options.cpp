#include "squeal/given_options.hpp"

#include "squeal/base/error.hpp"
#include "squeal/options.hpp"
#include "squeal/session_options.hpp"
#include "squeal/solver_options.hpp"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

namespace squeal
{

namespace
{

using Strings = std::vector<std::string>;

constexpr std::size_t largest_file = 1 << 20; // [byte] of options
constexpr std::size_t most_files = 20;        // of options, so that files that name each other come to an end

bool is_letter(const std::string& word, std::size_t place)
{
  return place < word.size() && std::isalpha(static_cast<unsigned char>(word[place]));
}

/// PETSc takes -name and --name for options, and -3 for a value.
bool is_option(const std::string& word)
{
  return word.size() > 1 && word[0] == '-' && (is_letter(word, 1) || (word[1] == '-' && is_letter(word, 2)));
}

class Examiner
{
public:
  void examine(const Strings& words, const std::string& source)
  {
    for (std::size_t i = 0; i < words.size() && given.problem.empty(); ++i)
    {
      if (!is_option(words[i])) continue;
      const bool has_value = i + 1 < words.size() && !is_option(words[i + 1]);
      examine_option(words[i].substr(1), has_value ? words[i + 1] : "", source);
    }
  }

  /// Passes a file that does not exist.
  void examine_file(const std::string& name)
  {
    if (!given.problem.empty() || !is_file(name)) return;
    std::ifstream stream(name, std::ios::binary);
    std::string text(largest_file + 1, '\0');
    stream.read(text.data(), static_cast<std::streamsize>(text.size()));
    text.resize(static_cast<std::size_t>(stream.gcount()));
    if (text.size() > largest_file || text.find('\0') != std::string::npos)
      given.problem = "file " + shortened(name) + ": it holds no options";
    else if (++files_ > most_files)
      given.problem = "option -options_file " + shortened(name) + ": more than 20 files name one another";
    else if (!words_in(text).empty())
      given.sources.push_back("file " + shortened(name));
    std::istringstream lines(text);
    int number = 0;
    for (std::string line; given.problem.empty() && std::getline(lines, line);)
      examine_line(words_in(line), "file " + shortened(name) + ", line " + std::to_string(++number));
  }

  GivenOptions given;

private:
  /// An option and its value, or an alias, and then perhaps a comment.
  void examine_line(const Strings& words, const std::string& place)
  {
    const auto end = std::find_if(words.begin(), words.end(), [](const std::string& word) { return word[0] == '#'; });
    const Strings line(words.begin(), end);
    if (line.empty() || line[0][0] == '!' || line[0][0] == '%') return;
    if (line[0] == "alias" && line.size() == 3) return;
    if (!is_option(line[0]))
      given.problem = place + ": '" + shortened(line[0]) + "' is no option";
    else if (line.size() > 2 || (line.size() == 2 && is_option(line[1])))
      given.problem = place + ": it must hold one option and its value, but goes on with " + shortened(line.back());
    else
      examine_option(line[0].substr(1), line.size() > 1 ? line[1] : "", " (" + place + ")");
  }

  void examine_option(const std::string& name, const std::string& value, const std::string& source)
  {
    std::string problem = problem_of_option_name(name);
    if (problem.empty()) problem = problem_of_session_option(name, value);
    if (problem.empty()) problem = problem_of_solver_type(name, value);
    if (const std::string file = file_written_by(name, value); !file.empty()) given.written.push_back(file);
    if (!problem.empty())
      given.problem = problem + source;
    else if (names_options_file(name))
      examine_file(value);
  }

  std::size_t files_ = 0;
};

} // namespace

GivenOptions given_options(int argc, char** argv)
{
  Examiner examiner;
  const Strings line(argv + std::min(argc, 1), argv + argc);
  const char *home = std::getenv("HOME"), *variable = std::getenv("PETSC_OPTIONS");
  const Strings from_variable = words_in(variable ? variable : "");
  const auto skips = [](const Strings& words)
  { return std::find(words.begin(), words.end(), "-skip_petscrc") != words.end(); };
  if (!skips(line) && !skips(from_variable))
  {
    if (home) examiner.examine_file(std::string(home) + "/.petscrc");
    std::error_code none;
    if (!home || !std::filesystem::equivalent(home, ".", none)) examiner.examine_file(".petscrc");
    examiner.examine_file("petscrc");
  }
  if (!from_variable.empty()) examiner.given.sources.push_back("the variable PETSC_OPTIONS");
  examiner.examine(from_variable, " (in PETSC_OPTIONS)");
  examiner.examine(line, "");
  return std::move(examiner.given);
}

} // namespace squeal
