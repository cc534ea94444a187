#include "squeal/options.hpp"

#include "squeal/arguments.hpp"
#include "squeal/base/free_memory.hpp"
#include "squeal/base/markdown.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/scene/scene.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

std::string nearest_option(const std::string& option)
{
  ProgramOptions unused;
  std::vector<std::string> known;
  for (const SceneKey& candidate : options_of(unused)) known.push_back(candidate.name);
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

SceneKeys options_of(ProgramOptions& options)
{
  ContactSettings& contact = options.step.contact;
  ShootingOptions& shooting = options.cycle.shooting;
  return {
      {"-factor", choice_of(options.factor.kind), "word",
       "factorisation for the step and the equilibrium: supernodal or mumps, both on all ranks"},
      {"-factor_limit", &options.factor.limit, "GB",
       "[GB] largest share of a rank in a supernodal factor; beyond it several ranks take MUMPS; -1: half of the free "
       "memory. Every run prints its choice, with what is foreseen"},
      {"-modes_shapes", choice_of(options.modes.shapes), "word",
       "modes whose shapes fields.h5 holds: the unstable ones, or all"},
      {"-transient_refuse", &options.step.refuse, "switch",
       "false: march even where theta and the step falsify growth rates"},
      {"-transient_contact_solver", choice_of(contact.solver), "word",
       "block Gauss-Seidel, or the projection fixed point (fixed_point)"},
      {"-transient_contact_tolerance", &contact.tolerance, "-",
       "largest natural map of a pair over the largest reaction", Rule::positive},
      {"-transient_contact_rho", &contact.rho, "-",
       "step of the fixed point over 1/lambda_max(W); 0: chosen by the program", Rule::below_two},
      {"-cycle_samples", &options.cycle.samples, "-", "number of displacements over the last period in fields.h5",
       Rule::positive},
      {"-reduced_modes", &options.cycle.reduced_modes, "-",
       "largest number of complex modes of a reduced model: the followed one and the nearest in frequency",
       Rule::positive},
      {"-cycle_subspace_newtons", &shooting.subspace_newtons, "-",
       "Newton iterations on the period and the paper's six amplitudes; 0: they are not tried", Rule::not_negative},
      {"-cycle_finish", choice_of(shooting.finish), "word", "finish in the full space: multisecant or none"},
      {"-cycle_max_periods", &shooting.max_periods, "-",
       "periods that one search integrates at most; another number of steps a period is another search",
       Rule::not_negative},
      {"-cycle_free_periods", &shooting.free_periods, "-",
       "largest number of periods integrated freely while shooting finds no cycle that attracts", Rule::not_negative},
      {"-cycle_multipliers", &shooting.multipliers, "-",
       "columns of the exact tangent that the search for Floquet multipliers may take; 0: none; -1: as many as it "
       "needs, within limits. A number bounds the columns of the whole matrix or of a search"},
      {"-cycle_watched_periods", &shooting.watched_periods, "-",
       "periods integrated from beside the cycle found, 3 % of its fluctuation along the fastest motion, to see it "
       "grow or decay; again from a tenth and a hundredth of that where growth and multiplier differ; below 0: where "
       "that decides what a bar leaves open, at most 200, as the search took or as is affordable"},
      {"-settled_periods", &options.settled.periods, "-",
       "largest number of periods integrated to see what a motion settles on where no cycle attracts; 0: 2048, or 512 "
       "where periods are dear or have more than 256 steps",
       Rule::not_negative},
      {"-settled_exponents", &options.settled.exponents, "-", "number of Lyapunov exponents of a settled motion",
       Rule::positive},
      {"-response_tolerance", &options.response.tolerance, "-",
       "geometric mean of the residual forces of the responses and of the transposed problem, over a unit force",
       Rule::positive},
  };
}

const SolverPrefix* solver_prefix_of(const std::string& name)
{
  const auto found =
      std::ranges::find_if(solver_prefixes, [&](const SolverPrefix& prefix) { return name.starts_with(prefix.text); });
  return found == solver_prefixes.end() ? nullptr : &*found;
}

std::string problem_of_option_name(const std::string& name)
{
  const std::string option = "-" + name;
  ProgramOptions unused;
  const SceneKeys own = options_of(unused);
  const bool known = std::ranges::find(own, option, &SceneKey::name) != own.end() || solver_prefix_of(name);
  return known ? "" : "unknown option " + shortened(option) + "; " + nearest_option(option.substr(0, 60));
}

std::string option_reference()
{
  ProgramOptions standard;
  std::string text;
  for (const SceneKey& option : options_of(standard))
    text += format("  %-36s%s [%s]\n", option.name.c_str(), option.meaning.c_str(), word_of_value(option).c_str());
  return text;
}

std::string option_page()
{
  ProgramOptions standard;
  std::string text = markdown_head({"option", "default", "values", "meaning"});
  for (const SceneKey& option : options_of(standard))
  {
    std::string values;
    if (const auto* choice = std::get_if<Choice>(&option.target))
      for (const char* one : choice->words) values += (values.empty() ? "" : ", ") + markdown_code(one);
    text += markdown_row({markdown_code(option.name), markdown_code(word_of_value(option)), values, option.meaning});
  }
  return text;
}

ProgramOptions read_program_options(MPI_Comm comm)
{
  ProgramOptions options;
  check(PetscOptionsClearValue(nullptr, "-skip_petscrc")); // the program's own, not to be asked for again
  on_every_rank(comm,
                [&]
                {
                  for (const SceneKey& option : options_of(options))
                  {
                    char word[256] = "";
                    PetscBool given = PETSC_FALSE;
                    check(PetscOptionsGetString(nullptr, nullptr, option.name.c_str(), word, sizeof word, &given));
                    if (given) set_by_word("option", option, word);
                  }
                });
  constexpr double part = 0.5; // of the free memory: the rest is for matrices, W and reduced models
  options.factor.by_memory = 1e-9 * part * free_memory(comm) / ranks_of(comm);
  options.factor.known = no_analyses();
  options.equilibrium.factor = options.step.factor = options.factor;
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
    if (is_printing_option(names[i])) continue; // the stage found its answer without this solver
    problem += (problem.empty() ? "" : "; ") + ("option -" + std::string(names[i]) + " was never used");
  }
  check(PetscOptionsLeftRestore(nullptr, &count, &names, &values));
  agree(comm, problem.empty() ? "" : problem + ": leave it out; earlier results stay as they were");
}

} // namespace squeal
