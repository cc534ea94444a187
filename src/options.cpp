#include "squeal/options.hpp"

#include "squeal/base/petsc.hpp"
#include "squeal/session_options.hpp"

#include <algorithm>
#include <array>
#include <sstream>

namespace squeal
{

namespace
{

constexpr std::array stages = {"equilibrium_", "modes_",   "transient_",  "cycle_",  "cycle_full_",
                               "estimate_",    "reduced_", "attractors_", "settled_"};

// What a stage hands on to a solver object, which checks the rest itself.
constexpr std::array solver_parts = {"snes_", "ksp_", "pc_", "pep_", "eps_", "st_",
                                     "mat_",  "bv_",  "ds_", "rg_",  "vec_"};

bool begins(const std::string& name, const char* prefix)
{
  return name.rfind(prefix, 0) == 0;
}

template <class Prefixes> bool begins_with_one_of(const std::string& name, const Prefixes& prefixes)
{
  return std::any_of(prefixes.begin(), prefixes.end(), [&](const char* prefix) { return begins(name, prefix); });
}

std::string nearest_option(const std::string& option)
{
  ProgramOptions unused;
  std::vector<std::string> known;
  for (const Option& candidate : options_of(unused)) known.push_back(candidate.name);
  for (const char* stage : stages)
    for (const char* part : solver_parts) known.push_back(std::string("-") + stage + part + "…");
  const std::string nearest = nearest_word(option, known);
  return nearest.empty() ? "squeal -help lists the options" : "did you mean " + nearest + "?";
}

} // namespace

std::string problem_of_option_name(const std::string& name)
{
  const std::string option = "-" + name;
  ProgramOptions unused;
  const OptionList own = options_of(unused);
  if (std::any_of(own.begin(), own.end(), [&](const Option& known) { return option == known.name; })) return {};
  if (is_session_option(name)) return {};
  for (const char* stage : stages)
    if (begins(name, stage) && begins_with_one_of(name.substr(std::string(stage).size()), solver_parts)) return {};
  return "unknown option " + shortened(option) + "; " + nearest_option(option.substr(0, 60));
}

OptionList options_of(ProgramOptions& options)
{
  OptionList all;
  for (OptionList list :
       {options_of(options.factor), options_of(options.equilibrium), options_of(options.modes),
        options_of(options.pencil), options_of(options.estimate), options_of(options.step), options_of(options.cycle),
        options_of(options.settled), options_of(options.attractors), options_of(options.sweep)})
    all.insert(all.end(), list.begin(), list.end());
  return all;
}

std::string option_reference()
{
  ProgramOptions standard;
  std::ostringstream text;
  for (const Option& option : options_of(standard))
  {
    text << "  " << option.name;
    for (std::size_t column = option.name.size(); column < 36; ++column) text << ' ';
    text << option.meaning << " [" << value_of(option) << "]\n";
  }
  return text.str();
}

ProgramOptions read_program_options(MPI_Comm comm)
{
  ProgramOptions options;
  on_every_rank(comm, [&] { read_options(options_of(options)); });
  options.equilibrium.factor = options.step.factor = options.factor;
  options.modes.pencil = options.pencil;
  return options;
}

void check_options_used(const std::vector<std::string>& stages_run, MPI_Comm comm)
{
  PetscInt count = 0;
  char **names = nullptr, **values = nullptr;
  check(PetscOptionsLeftGet(nullptr, &count, &names, &values));
  std::string problem;
  for (PetscInt i = 0; i < count; ++i)
  {
    const std::string name = names[i];
    if (is_session_option(name)) continue;
    const auto stage =
        std::find_if(stages.begin(), stages.end(), [&](const char* prefix) { return begins(name, prefix); });
    const bool ran = stage == stages.end() || std::any_of(stages_run.begin(), stages_run.end(),
                                                          [&](const std::string& run) { return run + "_" == *stage; });
    if (ran)
      problem += (problem.empty() ? "" : "; ") + ("option -" + name + " was never used, ") + nearest_option("-" + name);
  }
  check(PetscOptionsLeftRestore(nullptr, &count, &names, &values));
  agree(comm, problem);
}

} // namespace squeal
