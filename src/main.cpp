#include "squeal/arguments.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/checkpoint.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/forecast.hpp"
#include "squeal/report/results_folder.hpp"
#include "squeal/run.hpp"

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <new>
#include <thread>
#include <unistd.h>

namespace
{

using namespace squeal;

/// The default place of the results: named after the scene's folder when the file is called scene.toml.
std::filesystem::path default_output(const std::filesystem::path& scene)
{
  const auto whole = std::filesystem::absolute(scene).lexically_normal();
  return std::filesystem::path("results") /
         (scene.filename() == scene_file ? whole.parent_path().filename() : whole.stem());
}

/// Why a file that PETSc would write may not be written: it is the scene or a result. Empty: it may.
std::string problem_of_written(const std::vector<std::string>& files, const Arguments& arguments)
{
  if (arguments.scene.empty()) return {};
  std::vector<std::filesystem::path> taken = {arguments.scene};
  const auto place = arguments.output.empty() ? default_output(arguments.scene) : arguments.output;
  for (const char* name : words_of<ResultFile>) taken.push_back(place / name);
  for (const std::string& file : files)
    if (std::ranges::any_of(taken, [&](const auto& other) { return is_same_file(file, other); }))
      return "the output " + shortened(file) + " of PETSc's would fall on the scene or a result: name another file";
  return {};
}

/// The words that PETSc starts with; it looks for no others. Where something is wrong with them there are none.
std::vector<std::string> options_for_petsc(Arguments& arguments, int argc, char** argv)
{
  GivenOptions given = given_options(argc, argv);
  arguments.options_in_variable = given.from_variable;
  if (given.problem.empty()) given.problem = problem_of_written(given.written, arguments);
  if (arguments.problem.empty()) arguments.problem = given.problem;
  if (!given.problem.empty()) given.words.clear();
  unsetenv("PETSC_OPTIONS");
  given.words.insert(given.words.begin(), "-skip_petscrc");
  return std::move(given.words);
}

void print_help()
{
  std::string prefixes;
  for (const SolverPrefix& prefix : solver_prefixes) prefixes += std::string(" -") + prefix.text;
  std::printf("squeal %s: friction-induced vibration of a finite-element structure\n\n"
              "  mpirun -n 2 squeal SCENE [--set key=value]… [--output DIR] [--dry-run] [options]\n\n"
              "  SCENE             a scene file (.toml), or a folder that holds a scene.toml\n"
              "%s"
              "  exit code: 0 all converged, 2 a stage did not (the report says which), 3 asked to end, 1 an error\n\n"
              "  squeal run|plot|report|mesh|matrices|sound|uff|chart|convergence …: the tools; each explains itself "
              "by --help\n\n"
              "Keys of a scene file: squeal --reference keys, or of a table, squeal --help contact\n\n"
              "Algorithm options (PETSc options database) [default]\n%s\n"
              "Options of the solvers themselves, PETSc's, SLEPc's and MUMPS's, follow the prefixes\n %s\n"
              "e.g. -cycle_snes_monitor, -modes_pep_monitor, -factor_mat_mumps_icntl_14 50.\n\n"
              "Options of the whole run, PETSc's:\n%s",
              SQUEAL_VERSION, argument_reference().c_str(), option_reference().c_str(), prefixes.c_str(),
              session_option_reference().c_str());
}

/// The keys of a table, as the page of keys has them. Returns whether there is such a table.
bool print_section(const std::string& name)
{
  const std::string page = scene_reference();
  for (const std::string& head : {"[" + name + "]", "[[" + name + "]]", name, name + " = { … }"})
    if (const std::size_t begin = page.find("### `" + head + "`"); begin != std::string::npos)
    {
      const std::size_t end = page.find("\n### ", begin);
      std::printf("%s\n", page.substr(begin + 4, end == std::string::npos ? end : end - begin - 4).c_str());
      return true;
    }
  std::fprintf(stderr, "squeal: error: --help %s: no such table; squeal --reference keys lists them\n",
               shortened(name).c_str());
  return false;
}

/// The page inputs/KEYS.md.
void print_key_page()
{
  std::string prefixes;
  for (const SolverPrefix& prefix : solver_prefixes) prefixes += std::string(" `-") + prefix.text + "`";
  std::printf(
      "# Keys and options\n\n"
      "`squeal --reference keys` writes this page from the program's own tables. [README.md](README.md) is the "
      "guide.\n\n"
      "## Keys of a scene\n\n"
      "A default of *required* must be given; no default means that a key may be absent. The column *changes* names "
      "what\n"
      "is made again where a number changes. Motions are any of `x`, `y`, `z`, `rx`, `ry` and `rz` in one text, or "
      "`all`,\n"
      "or `none`. A direction is a text such as `\"x\"` or `\"-y\"`, or a vector.\n%s"
      "\n## Arguments\n\n%s\n## Options\n\n"
      "Options are of PETSc's database: of the command line, and of the variable `PETSC_OPTIONS`.\n\n%s"
      "\n## Options of solvers\n\nOptions of PETSc's, SLEPc's and MUMPS's own solvers follow the prefixes%s.\n"
      "One that no solver asks for is an error. Those of the whole run are:\n\n```text\n%s```\n",
      scene_reference().c_str(), argument_page().c_str(), option_page().c_str(), prefixes.c_str(),
      session_option_reference().c_str());
}

/// The page that is asked for.
void print_page(const Arguments& arguments)
{
  if (arguments.help)
    print_help();
  else if (arguments.version)
    for (const auto& [name, version] : versions()) std::printf("%-7s %s\n", name.c_str(), version.c_str());
  else if (arguments.reference == ReferencePage::results)
    std::fputs(result_page().c_str(), stdout);
  else
    print_key_page();
}

/// Throws Error if a state file could not be written after the work. The results' folder will be made.
void check_state_file(const std::string& key, const std::filesystem::path& file, const std::filesystem::path& output)
{
  if (file.empty()) return;
  const auto folder = file.parent_path(),
             results = (std::filesystem::absolute(output) / ".").lexically_normal().parent_path();
  const std::string label = key + " = " + shortened(file) + ": ";
  if (!file.has_filename() || is_folder(file) || file == results) throw Error(label + "it is a folder; name a file");
  if (std::error_code failed; !is_file(file) && std::filesystem::exists(file, failed))
    throw Error(label + "it is a device or a pipe, which the state would replace; name a file");
  if (folder == results) return;
  if (!is_folder(folder)) throw Error(label + "there is no folder " + shortened(folder) + "; make it first");
  if (access((is_file(file) ? file : folder).c_str(), W_OK) != 0 || access(folder.c_str(), W_OK) != 0)
    throw Error(label + "it cannot be written; name a file where you may write");
}

/// The program, the ranks, the scene, the options and the contents of input files, by which checkpoints are
/// distinguished from those of another run. Options of the session, about logs and memory, do not matter. Of one rank.
std::string request_text(const Scene& scene, const std::vector<std::filesystem::path>& inputs, ProgramOptions options)
{
  std::string text =
      format("squeal %s on %d ranks\n", SQUEAL_VERSION, ranks_of(PETSC_COMM_WORLD)) + resolved_scene(scene);
  for (const SceneKey& option : options_of(options)) text += option.name + " " + word_of_value(option) + "\n";
  for (const std::filesystem::path& file : inputs)
  {
    if (file == scene.file || !is_file(file)) continue;
    std::ifstream stream(file, std::ios::binary);
    std::vector<char> block(1 << 20);
    std::uint64_t sum = empty_check_sum;
    while (stream.read(block.data(), static_cast<std::streamsize>(block.size())) || stream.gcount() > 0)
      sum = check_sum({block.data(), static_cast<std::size_t>(stream.gcount())}, sum);
    text += format("file %s %016" PRIx64 "\n", file.filename().c_str(), sum);
  }
  return text;
}

int run_program(const Arguments& arguments)
{
  const MPI_Comm comm = PETSC_COMM_WORLD;
  agree(comm, arguments.problem);
  if (arguments.scene.empty()) throw Error("no scene given; usage: squeal SCENE [options], squeal -help explains them");
  if (arguments.options_in_variable && rank_of(comm) == 0)
    std::printf("options come from the command line and from the variable PETSC_OPTIONS\n");
  ProgramOptions options = read_program_options(comm);
  options.arguments = arguments;
  Scene scene;
  on_every_rank(comm, [&] { scene = read_scene(arguments.scene, arguments.overrides); });
  if (scene.mesh && arguments.allow_scripts) scene.mesh->statements = Statements::any;
  const auto output = arguments.output.empty() ? default_output(arguments.scene) : arguments.output;
  on_rank_zero(comm,
               [&]
               {
                 check_state_file("[transient] save_state", scene.transient.save_state, output);
                 check_state_file("[cycle] save_state", scene.cycle.save_state, output);
               });
  if (arguments.dry_run)
  {
    dry_run(scene, options, comm);
    return 0;
  }
  begin_run_control(arguments.limits);
  ResultsFolder results(output, comm);
  std::string request;
  on_rank_zero(comm,
               [&]
               {
                 const std::vector<std::filesystem::path> inputs = inputs_of(scene);
                 check_outputs(scene, inputs, results.place());
                 request = request_text(scene, inputs, options);
                 std::error_code ignored;
                 if (!arguments.restart) std::filesystem::remove_all(results.checkpoints(), ignored);
               });
  broadcast(request, comm);
  on_every_rank(comm, [&] { open_checkpoints({results.checkpoints(), request, arguments.restart}); });
  write_request(scene, results.run(), results.partial(), comm);
  try
  {
    return static_cast<int>(run(scene, options, results, comm));
  }
  catch (const OutOfMemory& error)
  {
    throw OutOfMemory(error.what() + results.keep_finished());
  }
  catch (const LibraryError& error)
  {
    throw LibraryError(error.what() + results.keep_finished());
  }
  catch (const std::bad_alloc&)
  {
    throw LibraryError(out_of_memory_text + results.keep_finished());
  }
}

/// Ends all ranks after a failure that may be this rank's alone: the others would wait for ever. The lowest failing
/// rank reports first. A single rank ends by itself, without the text of MPI_Abort.
void end_all(int rank, const char* kind, const char* text)
{
  if (ranks_of(PETSC_COMM_WORLD) == 1)
  {
    std::fprintf(stderr, "squeal: %s: %.3000s\n", kind, text);
    std::fflush(nullptr);
    std::_Exit(1);
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(300 * rank));
  std::fprintf(stderr, "squeal: %s on rank %d: %.3000s\n", kind, rank, text);
  MPI_Abort(PETSC_COMM_WORLD, 1);
}

/// Prints an error that all ranks share; its text is cut, since a name in it may have any length.
void print_error(int rank, const std::exception& error)
{
  if (rank == 0) std::fprintf(stderr, "squeal: error: %.3000s\n", error.what());
}

/// Without a launcher Open MPI would start a daemon beside this process, for processes that it may start. That takes a
/// third of a start's time. It would also make a folder inside one that all runs of a machine share and the last of
/// them removes. About one start of a thousand fails by that. It takes settings of its own from the environment alone,
/// before MPI is up.
void stay_alone()
{
  if (!launched_rank().empty()) return;
  setenv("OMPI_MCA_ess_singleton_isolated", "1", 0);
  setenv("OMPI_MCA_orte_create_session_dirs", "0", 0);
}

} // namespace

int main(int argc, char** argv)
{
  if (std::error_code failed; std::filesystem::current_path(failed).empty()) // MPI would fail in a text of its own
  {
    std::fprintf(stderr, "squeal: error: the working folder no longer exists: change to another\n");
    return 1;
  }
  become_tool(argc, argv);
  Arguments arguments = take_arguments(argc, argv);
  std::vector<std::string> options = options_for_petsc(arguments, argc, argv);
  std::vector<char*> words = {argv[0]};
  for (std::string& option : options) words.push_back(option.data());
  argc = static_cast<int>(words.size());
  words.push_back(nullptr);
  argv = words.data();
  stay_alone();
  Session session(argc, argv, nullptr);
  end_with_launcher();
  const int rank = rank_of(PETSC_COMM_WORLD);
  if (arguments.help && !arguments.section.empty()) return rank != 0 || print_section(arguments.section) ? 0 : 1;
  if (arguments.help || arguments.version || arguments.reference != ReferencePage::none)
  {
    if (rank == 0) print_page(arguments);
    return 0;
  }
  try
  {
    return run_program(arguments);
  }
  catch (const Interrupted&)
  {
    if (rank == 0)
      std::printf("ended %s before the first stage: the same command begins again\n", who_asked_to_end().c_str());
    return static_cast<int>(ExitCode::interrupted);
  }
  catch (const OutOfMemory& error)
  {
    print_error(rank, error);
  }
  catch (const LibraryError& error)
  {
    end_all(rank, "error", error.what());
  }
  catch (const Error& error)
  {
    print_error(rank, error);
  }
  catch (const std::bad_alloc&)
  {
    end_all(rank, "error", out_of_memory_text);
  }
  catch (const std::exception& error)
  {
    end_all(rank, "failure", error.what());
  }
  return 1;
}
