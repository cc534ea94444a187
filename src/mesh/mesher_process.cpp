/// Starts squeal_mesher beside the program and reads its answer from a pipe.
///
/// It is spawned and not forked: a fork would copy the memory that MPI has registered. Its environment has no variables
/// of MPI or of a scheduler's launcher, so that no library in it takes itself for a rank of this run.
#include "mesher_process.hpp"

#include "squeal/base/error.hpp"
#include "squeal/base/run_control.hpp"

#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
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

constexpr std::chrono::seconds longest_wait{3600}, report_after{30};

/// A file descriptor that is closed at the end.
class Descriptor
{
public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() { close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  operator int() const { return number_; }
  void close()
  {
    if (number_ >= 0) ::close(number_);
    number_ = -1;
  }

private:
  int number_;
};

/// The mesher beside the program, or one folder up for programs in a folder of the build.
fs::path mesher_program()
{
  std::error_code code;
  const fs::path folder = fs::read_symlink("/proc/self/exe", code).parent_path();
  for (const fs::path& place : {folder, folder.parent_path()})
    if (is_file(place / "squeal_mesher")) return place / "squeal_mesher";
  throw Error("the mesher " + (folder / "squeal_mesher").string() +
              " is missing: it belongs beside the program; build or install squeal again");
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

std::vector<std::string> arguments_of(const MesherTask& task)
{
  std::vector<std::string> arguments = {mesher_program().string(), word(task.rights), task.file};
  for (const auto& [name, value] : task.parameters)
  {
    arguments.push_back(name);
    arguments.push_back(format("%.17g", value));
  }
  return arguments;
}

/// Starts the mesher, which writes its answer to `answer`.
pid_t start(const MesherTask& task, int answer)
{
  std::vector<std::string> arguments = arguments_of(task), environment = environment_without_mpi();
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, answer, answer_descriptor);
  pid_t child = -1;
  const int failed = posix_spawn(&child, arguments[0].c_str(), &actions, nullptr, pointers_to(arguments).data(),
                                 pointers_to(environment).data());
  posix_spawn_file_actions_destroy(&actions);
  if (failed) throw Error("the mesher " + arguments[0] + " cannot be started: " + std::strerror(failed));
  return child;
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

} // namespace

MesherAnswer run_mesher(const MesherTask& task)
{
  int ends[2] = {-1, -1};
  if (pipe2(ends, O_CLOEXEC) != 0) throw Error(std::string("the mesher cannot be started: ") + std::strerror(errno));
  // A descriptor that already has the mesher's number would keep its close-on-exec flag; so copies get larger numbers
  // than both.
  const Descriptor from(ends[0]);
  Descriptor low(ends[1]), to(fcntl(low, F_DUPFD_CLOEXEC, 10));
  const pid_t child = start(task, to);
  to.close();
  low.close();
  const std::string bytes = read_answer(from, task.file);
  if (bytes.empty()) kill(child, SIGKILL); // it has ended or has taken too long
  int status = 0;
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
      throw Error(task.file + ": it starts a program, as SystemCall does, which no file may do; --allow-scripts lets "
                              "a geometry that you trust run what it holds");
    throw Error(task.file + ": the mesher (gmsh) " + end_of(status) +
                ": the file is malformed, or gmsh cannot mesh this geometry; try it in gmsh itself");
  }
}

} // namespace squeal
