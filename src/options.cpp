#include "squeal/options.hpp"

#include "squeal/base/free_memory.hpp"
#include "squeal/base/markdown.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/scene/scene.hpp"
#include "squeal/session_options.hpp"
#include "squeal/solver_options.hpp"

#include <algorithm>
#include <sstream>

namespace squeal
{

namespace
{

std::string nearest_option(const std::string& option)
{
  ProgramOptions unused;
  std::vector<std::string> known;
  for (const Option& candidate : options_of(unused)) known.push_back(candidate.name);
  for (const SolverPrefix& prefix : solver_prefixes) known.push_back(std::string("-") + prefix.text + "…");
  for (const std::string& key : scene_key_names())
  {
    std::string as_option = "-" + key;
    std::replace(as_option.begin(), as_option.end(), '.', '_');
    if (as_option == option) return "it is a key of the scene: --set " + key + "=…";
  }
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
  if (is_session_option(name) || solver_prefix_of(name)) return {};
  return "unknown option " + shortened(option) + "; " + nearest_option(option.substr(0, 60));
}

OptionList options_of(ProgramOptions& options)
{
  OptionList all;
  for (OptionList list : {options_of(options.factor), options_of(options.equilibrium), options_of(options.modes),
                          options_of(options.pencil), options_of(options.estimate), options_of(options.step),
                          options_of(options.cycle), options_of(options.settled), options_of(options.attractors),
                          options_of(options.sweep), options_of(options.robustness), options_of(options.response)})
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

std::string option_page()
{
  ProgramOptions standard;
  std::string text = markdown_head({"option", "default", "values", "meaning"});
  for (const Option& option : options_of(standard))
  {
    std::string values;
    for (const char* one : words_of(option)) values += (values.empty() ? "" : ", ") + markdown_code(one);
    text += markdown_row({markdown_code(option.name), markdown_code(value_of(option)), values, option.meaning});
  }
  return text;
}

ProgramOptions read_program_options(MPI_Comm comm)
{
  ProgramOptions options;
  on_every_rank(comm, [&] { read_options(options_of(options)); });
  constexpr double part = 0.5; // of the free memory: the rest is for matrices, W and reduced models
  options.factor.by_memory = 1e-9 * part * free_memory(comm) / ranks_of(comm);
  options.factor.known = no_analyses();
  options.equilibrium.factor = options.step.factor = options.factor;
  options.modes.pencil = options.pencil;
  return options;
}

void check_options_used(const std::vector<Stage>& stages_run, MPI_Comm comm)
{
  PetscInt count = 0;
  char **names = nullptr, **values = nullptr;
  check(PetscOptionsLeftGet(nullptr, &count, &names, &values));
  std::string problem;
  for (PetscInt i = 0; i < count; ++i)
  {
    const SolverPrefix* prefix = solver_prefix_of(names[i]);
    if (!prefix || std::ranges::find(stages_run, prefix->stage) == stages_run.end()) continue;
    if (is_solver_view(names[i])) continue; // the stage found its answer without this solver
    problem += (problem.empty() ? "" : "; ") + ("option -" + std::string(names[i]) + " was never used");
  }
  check(PetscOptionsLeftRestore(nullptr, &count, &names, &values));
  agree(comm, problem.empty() ? "" : problem + ": leave it out; earlier results stay as they were");
}

} // namespace squeal
