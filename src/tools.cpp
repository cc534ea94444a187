/// Tools as words of the program: "squeal plot RESULTS" runs tools/plot, of the sources or of the installation.
#include "squeal/tools.hpp"

#include "squeal/arguments.hpp"
#include "squeal/base/error.hpp"

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <unistd.h>

namespace squeal
{

namespace
{

/// Whether it can be the name of a tool: letters alone, so that no scene with a folder or an ending is mistaken.
bool is_plain_word(const std::string& word)
{
  return !word.empty() && word.find_first_not_of("abcdefghijklmnopqrstuvwxyz") == std::string::npos;
}

} // namespace

void become_tool(int argc, char** argv)
{
  namespace fs = std::filesystem;
  if (argc < 2 || !is_plain_word(argv[1]) || is_scene_folder(argv[1])) return;
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
