#include "squeal/report/report.hpp"
#include "squeal/report/results_folder.hpp"
#include "squeal/run.hpp"

#include <cstdio>
#include <thread>

namespace
{

using namespace squeal;

struct Arguments
{
  std::filesystem::path scene, output;
  std::vector<std::string> overrides;
  bool dry_run = false, help = false, version = false;
  std::string problem; // said after MPI is up, once
};

bool is_scene_folder(const std::string& word)
{
  return std::filesystem::is_regular_file(std::filesystem::path(word) / "scene.toml");
}

/// Takes squeal's own arguments out of argv; what stays is PETSc's.
Arguments take_arguments(int& argc, char** argv)
{
  Arguments arguments;
  int kept = 1;
  for (int i = 1; i < argc; ++i)
  {
    const std::string word = argv[i];
    const bool has_value = i + 1 < argc;
    if (word == "-help" || word == "--help" || word == "-h")
      arguments.help = true;
    else if (word == "--version")
      arguments.version = true;
    else if (word == "--dry-run")
      arguments.dry_run = true;
    else if (word == "--set" || word == "--output")
    {
      if (!has_value)
        arguments.problem = word + " needs a value: " + (word == "--set" ? "--set key=value" : "--output DIR");
      else if (word == "--set")
        arguments.overrides.push_back(argv[++i]);
      else
        arguments.output = argv[++i];
    }
    else if (word.rfind("--", 0) == 0)
      arguments.problem =
          "unknown argument " + word + "; did you mean " +
          nearest_word(word, std::vector<std::string>{"--set", "--output", "--dry-run", "--help", "--version"}) + "?";
    else if (arguments.scene.empty() && word[0] != '-' && (word.ends_with(".toml") || is_scene_folder(word)))
      arguments.scene =
          word.ends_with(".toml") ? std::filesystem::path(word) : std::filesystem::path(word) / "scene.toml";
    else
      argv[kept++] = argv[i];
  }
  argc = kept;
  argv[argc] = nullptr;
  return arguments;
}

void print_help()
{
  std::printf(
      "squeal %s: friction-induced vibration of a finite-element structure\n\n"
      "  mpirun -n 2 squeal SCENE [--set key=value]… [--output DIR] [--dry-run] [options]\n\n"
      "  SCENE             a scene file (.toml), or a folder that holds a scene.toml\n"
      "  --set key=value   overrides a key of the scene, e.g. --set friction.coefficient=0.25\n"
      "  --output DIR      where results go (results/<scene>)\n"
      "  --version         versions of squeal and of the libraries it runs on\n"
      "  --dry-run         checks scene and mesh, prints the resolved scene and the model's size, and stops\n"
      "  exit code: 0 all converged, 2 a stage did not (the report says which), 1 an error\n\n"
      "%s\n"
      "Algorithm options (PETSc options database) [default]\n%s\n"
      "Options of the solvers themselves, PETSc's and SLEPc's, follow the prefixes -modes_pep_ -modes_st_\n"
      "-cycle_snes_ -cycle_full_snes_ -cycle_full_ksp_: e.g. -cycle_snes_monitor, -modes_pep_monitor,\n"
      "-cycle_full_ksp_rtol 1e-3. Of the whole run: -log_view (one stage per step of the chain), -options_file FILE.\n",
      SQUEAL_VERSION, scene_reference().c_str(), option_reference().c_str());
}

/// The default place of the results: named after the scene's folder when the file is called scene.toml.
std::filesystem::path default_output(const std::filesystem::path& scene)
{
  const auto name = scene.stem() == "scene" ? std::filesystem::absolute(scene).parent_path().filename() : scene.stem();
  return std::filesystem::path("results") / name;
}

void print_versions()
{
  for (const auto& [name, version] : versions()) std::printf("%-7s %s\n", name.c_str(), version.c_str());
}

void check_leftover_words(int argc, char** argv)
{
  if (argc > 1 && argv[1][0] != '-')
    throw Error(std::string("unexpected argument '") + argv[1] +
                "': a scene is one file that ends in .toml, or a folder that holds a scene.toml");
}

int run_program(const Arguments& arguments, int argc, char** argv)
{
  const MPI_Comm comm = PETSC_COMM_WORLD;
  if (!arguments.problem.empty()) throw Error(arguments.problem);
  check_leftover_words(argc, argv);
  if (arguments.scene.empty()) throw Error("no scene given; usage: squeal SCENE [options], squeal -help explains them");
  const ProgramOptions options = read_program_options(comm);
  Scene scene;
  on_every_rank(comm, [&] { scene = read_scene(arguments.scene, arguments.overrides); });
  if (arguments.dry_run)
  {
    dry_run(scene, options, comm);
    return 0;
  }
  const auto output = arguments.output.empty() ? default_output(arguments.scene) : arguments.output;
  on_rank_zero(comm, [&] { check_outputs(scene, output); });
  ResultsFolder results(output, comm);
  write_request(scene, results.run(), results.partial(), comm);
  scene.transient.save_state = results.meanwhile(scene.transient.save_state);
  scene.cycle.save_state = results.meanwhile(scene.cycle.save_state);
  return static_cast<int>(run(scene, options, results, comm));
}

} // namespace

int main(int argc, char** argv)
{
  const Arguments arguments = take_arguments(argc, argv);
  Session session(argc, argv, nullptr);
  const int rank = rank_of(PETSC_COMM_WORLD);
  if (arguments.help || arguments.version)
  {
    if (rank == 0) arguments.help ? print_help() : print_versions();
    return 0;
  }
  try
  {
    return run_program(arguments, argc, argv);
  }
  catch (const LibraryError& error)
  {
    // Perhaps this rank's alone: the others would wait for ever. The lowest failing rank speaks first and ends all.
    std::this_thread::sleep_for(std::chrono::milliseconds(300 * rank));
    std::fprintf(stderr, "squeal: error on rank %d: %s\n", rank, error.what());
    MPI_Abort(PETSC_COMM_WORLD, 1);
  }
  catch (const Error& error)
  {
    if (rank == 0) std::fprintf(stderr, "squeal: error: %s\n", error.what());
  }
  catch (const std::exception& error)
  {
    std::this_thread::sleep_for(std::chrono::milliseconds(300 * rank));
    std::fprintf(stderr, "squeal: failure on rank %d: %s\n", rank, error.what());
    MPI_Abort(PETSC_COMM_WORLD, 1);
  }
  return 1;
}
