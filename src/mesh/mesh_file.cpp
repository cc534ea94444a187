/// Mesh files and geometries: what gmsh may be given is checked, then squeal_mesher beside the program is started, and
/// its answer read from a pipe.
///
/// The mesher is spawned and not forked: a fork would copy the memory that MPI has registered. Its environment has no
/// variables of MPI or of a scheduler's launcher. So no library in it takes itself for a rank of this run.
#include "squeal/mesh/mesh_file.hpp"

#include "squeal/base/error.hpp"
#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace squeal
{

namespace fs = std::filesystem;

namespace
{

std::string content_of(const fs::path& file)
{
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

bool is_letter(char c)
{
  return std::isalnum(static_cast<unsigned char>(c)) || c == '_';
}

/// Words, quoted texts with the quote before them, and single characters; without comments.
std::vector<std::string> tokens_of(const std::string& text)
{
  std::vector<std::string> tokens;
  for (std::size_t i = 0, end = 0; i < text.size(); i = end)
  {
    const char c = text[i];
    end = i + 1;
    if (text.compare(i, 2, "//") == 0)
      end = text.find('\n', i);
    else if (text.compare(i, 2, "/*") == 0)
      end = text.find("*/", i + 2) + 1; // the last / is a token without a meaning
    else if (c == '"' || c == '\'')
    {
      end = std::min(text.find(c, i + 1), text.size());
      tokens.push_back(text.substr(i, end - i));
      ++end;
    }
    else if (is_letter(c))
    {
      while (end < text.size() && is_letter(text[end])) ++end;
      tokens.push_back(text.substr(i, end - i));
    }
    else if (!std::isspace(static_cast<unsigned char>(c)))
      tokens.emplace_back(1, c);
    if (end == std::string::npos || end == 0) break; // a comment without an end
  }
  return tokens;
}

/// Appends the names in the list of DefineConstant that begins at `i`, outside of braces: after "[" or ",".
void append_parameters(const std::vector<std::string>& tokens, std::size_t i, std::vector<std::string>& names)
{
  const auto is_one_of = [&](const char* symbols)
  { return tokens[i].size() == 1 && std::string(symbols).find(tokens[i]) != std::string::npos; };
  for (int depth = 0; i < tokens.size(); ++i)
  {
    depth += is_one_of("[{(");
    depth -= is_one_of("]})");
    if (depth == 0) return;
    if (depth == 1 && is_letter(tokens[i][0]) && (tokens[i - 1] == "[" || tokens[i - 1] == ","))
      names.push_back(tokens[i]);
  }
}

void scan(const fs::path& file, MeshInput& input)
{
  input.files.push_back(file);
  const std::vector<std::string> tokens = tokens_of(content_of(file));
  for (std::size_t i = 0; i + 2 < tokens.size(); ++i)
  {
    if (tokens[i] == "DefineConstant") append_parameters(tokens, i + 1, input.parameters);
    const bool include = tokens[i] == "Include", shape = tokens[i] == "ShapeFromFile"; // ShapeFromFile("...")
    const std::string& name = tokens[shape ? i + 2 : i + 1];
    if ((!include && !shape && tokens[i] != "Merge") || (name[0] != '"' && name[0] != '\'')) continue;
    const fs::path target = file.parent_path() / name.substr(1);
    if (!is_file(target) || std::ranges::find(input.files, target) != input.files.end()) continue;
    if (include || is_geometry(target))
      scan(target, input);
    else
      input.files.push_back(target);
  }
}

/// A format that gmsh recognises by the ending, and how its files begin.
struct Format
{
  const char* ending;
  const char* beginning;
};

constexpr std::array formats = {Format{".msh", "$"},          Format{".unv", "-1"},        Format{".vtk", "# vtk"},
                                Format{".step", "ISO-10303"}, Format{".stp", "ISO-10303"}, Format{".med", "\x89HDF"}};

/// The beginning of a file as a message shows it.
std::string quoted(std::string text)
{
  text = text.substr(0, std::min<std::size_t>(text.find_first_of("\r\n"), 40));
  for (char& c : text)
    if (c < ' ' || c > '~') c = '?';
  return "\"" + text + "\"";
}

} // namespace

bool is_geometry(const fs::path& file)
{
  return file.extension() == ".geo" || file.extension() == ".geo_unrolled";
}

MeshInput scan_mesh_input(const fs::path& file)
{
  if (!is_file(file)) throw Error(shortened(file) + ": no such mesh file");
  if (!std::ifstream(file)) throw Error(shortened(file) + ": cannot be read");
  MeshInput input{{}, {file}};
  if (is_geometry(file))
  {
    input.files.clear();
    scan(file, input);
  }
  // gmsh runs the options beside a file after it.
  if (const fs::path options = file.string() + ".opt"; is_file(options)) input.files.push_back(options);
  return input;
}

void check_first_bytes(const fs::path& file)
{
  std::string ending = file.extension().string(), text(64, '\0');
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  std::ifstream stream(file, std::ios::binary);
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (ending == ".unv") text.erase(0, text.find_first_not_of(' '));
  for (const Format& format : formats)
    if (ending == format.ending && !text.starts_with(format.beginning))
      throw Error(shortened(file) + ": it begins with " + quoted(text) + ", where a file of the ending " + ending +
                  " begins with \"" + format.beginning +
                  "\"; gmsh would run it as a script. If it is a geometry, let its name end in .geo");
}

namespace
{

constexpr std::chrono::seconds longest_wait{3600}, report_after{30};

/// Throws Error if the geometry does not define one of the given parameters.
void check_parameters(const MeshSource& source, const std::vector<std::string>& known)
{
  for (const auto& [name, value] : source.parameters)
    if (std::find(known.begin(), known.end(), name) == known.end())
      throw Error(source.file.string() + ": no parameter '" + name + "' in its DefineConstant lists" +
                  spelling_hint(name, known));
}

/// Throws Error for a file that the mesher must not see.
void check_source(const MeshSource& source)
{
  const MeshInput input = scan_mesh_input(source.file);
  if (source.statements == Statements::listed) check_first_bytes(source.file);
  if (is_geometry(source.file))
    check_parameters(source, input.parameters);
  else if (!source.parameters.empty() || !source.size_field.empty())
    throw Error(source.file.string() + ": [mesh.parameters] and mesh.size_field need a .geo geometry; a mesh file has "
                                       "none. Remove them");
}

/// The mesher beside the program, or one folder up for programs in a folder of the build.
fs::path mesher_program()
{
  std::error_code code;
  const fs::path folder = fs::read_symlink("/proc/self/exe", code).parent_path();
  for (const fs::path& place : {folder, folder.parent_path()})
    if (is_file(place / "squeal_mesher")) return place / "squeal_mesher";
  throw Error("the mesher " + (folder / "squeal_mesher").string() +
              " is missing: it belongs beside the program; build or install squeal again, and not with "
              "-DSQUEAL_GMSH=OFF, which leaves matrices and points alone");
}

std::vector<std::string> environment_without_mpi()
{
  constexpr std::array prefixes = {"OMPI_",  "OPAL_",  "ORTE_",  "PRTE_", "PMIX_",  "PMI_", "MPI_",
                                   "MPICH_", "HYDRA_", "I_MPI_", "MV2_",  "SLURM_", "PALS_"};
  std::vector<std::string> kept;
  for (char** variable = environ; *variable; ++variable)
  {
    bool mpi = false;
    for (const char* prefix : prefixes) mpi = mpi || std::strncmp(*variable, prefix, std::strlen(prefix)) == 0;
    if (!mpi) kept.emplace_back(*variable);
  }
  return kept;
}

std::vector<char*> pointers_to(std::vector<std::string>& texts)
{
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

std::vector<std::string> arguments_of(const MeshSource& source)
{
  const char* rights = source.statements == Statements::any ? free_mesher : shut_in_mesher;
  std::vector<std::string> arguments = {mesher_program().string(), rights, source.file.string(),
                                        source.size_field.string(), std::to_string(source.refine)};
  for (const auto& [name, value] : source.parameters)
  {
    arguments.push_back(name);
    arguments.push_back(format("%.17g", value));
  }
  return arguments;
}

/// Starts the mesher, which writes its answer to `answer`. Returns 0 or an error number.
int start(std::vector<std::string> arguments, int answer, pid_t& child)
{
  std::vector<std::string> environment = environment_without_mpi();
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, answer, answer_descriptor);
  const int failed = posix_spawn(&child, arguments[0].c_str(), &actions, nullptr, pointers_to(arguments).data(),
                                 pointers_to(environment).data());
  posix_spawn_file_actions_destroy(&actions);
  return failed;
}

/// Reads until the mesher closes its end. Returns nothing if it took too long, or the run is asked to end.
std::string read_answer(int pipe, const std::string& file)
{
  const auto began = std::chrono::steady_clock::now();
  auto reported = began;
  std::string bytes;
  std::vector<char> part(1 << 20);
  while (true)
  {
    pollfd waiting{pipe, POLLIN, 0};
    const int ready = poll(&waiting, 1, 1000);
    const auto now = std::chrono::steady_clock::now();
    if (now - began > longest_wait || is_asked_here()) return {};
    if (now - reported > report_after)
    {
      reported = now;
      std::printf("  gmsh is at work on %s since %.0f s\n", file.c_str(),
                  std::chrono::duration<double>(now - began).count());
      std::fflush(stdout);
    }
    if (ready <= 0) continue;
    const ssize_t size = read(pipe, part.data(), part.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) return bytes;
    bytes.append(part.data(), static_cast<std::size_t>(size));
  }
}

/// How the mesher ended, for the message of an answer that is missing.
std::string end_of(int status)
{
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) return "was killed, perhaps because memory ran out";
  if (WIFSIGNALED(status)) return format("crashed (signal %d, %s)", WTERMSIG(status), strsignal(WTERMSIG(status)));
  return format("ended with exit code %d and gave no mesh", WIFEXITED(status) ? WEXITSTATUS(status) : -1);
}

/// Runs the mesher. Throws Error if it cannot be started, is killed by a signal, or takes longer than an hour.
MesherAnswer run_mesher(const MeshSource& source)
{
  const std::vector<std::string> arguments = arguments_of(source);
  const std::string& file = arguments[2];
  int ends[2] = {-1, -1}, status = 0;
  if (pipe2(ends, O_CLOEXEC) != 0) throw Error(std::string("the mesher cannot be started: ") + std::strerror(errno));
  // A descriptor that already has the mesher's number would keep its close-on-exec flag; so the copy gets a larger one.
  const int to = fcntl(ends[1], F_DUPFD_CLOEXEC, 10);
  pid_t child = -1;
  const int failed = start(arguments, to, child);
  close(to);
  close(ends[1]);
  const std::string bytes = failed ? std::string() : read_answer(ends[0], file);
  close(ends[0]);
  if (failed) throw Error("the mesher " + arguments[0] + " cannot be started: " + std::strerror(failed));
  if (bytes.empty()) kill(child, SIGKILL); // it has ended or has taken too long
  while (waitpid(child, &status, 0) < 0 && errno == EINTR)
  {
  }
  try
  {
    return unpacked(bytes);
  }
  catch (const std::exception&)
  {
    if (WIFSIGNALED(status) && WTERMSIG(status) == SIGSYS)
      throw Error(file + ": it starts a program, as SystemCall does, which no file may do; --allow-scripts lets a "
                         "geometry that you trust run what it holds");
    throw Error(file + ": the mesher (gmsh) " + end_of(status) +
                ": the file is malformed, or gmsh cannot mesh this geometry; try it in gmsh itself");
  }
}

} // namespace

FileMesh read_mesh_file(const MeshSource& source)
{
  check_source(source);
  const std::string name = source.file.string();
  MesherAnswer answer = run_mesher(source);
  if (!answer.left_open.empty())
    std::printf("  %s is not shut in on this system: %s\n", name.c_str(), answer.left_open.c_str());
  // A file that cannot be opened may be one that the script wanted to write.
  const bool refused = source.statements == Statements::listed && answer.problem.find("open file") != std::string::npos;
  if (!answer.problem.empty())
    throw Error(name + ": gmsh cannot read or mesh it: " + answer.problem +
                (refused ? "; no file is written unless --allow-scripts is given" : ""));
  for (Vec3& node : answer.mesh.nodes) node = source.scale * node;
  for (auto& [parents, middle] : answer.mesh.middles) middle = source.scale * middle;
  return std::move(answer.mesh);
}

} // namespace squeal
