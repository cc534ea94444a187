#include "squeal/solver_options.hpp"

#include "squeal/algebra/shift_invert.hpp"

#include <algorithm>
#include <slepcpep.h>

namespace squeal
{

namespace
{

/// PETSc's error handler: keeps the message of the innermost failure in the text that `context` points to.
PetscErrorCode keep_message(MPI_Comm, int, const char*, const char*, PetscErrorCode code, PetscErrorType type,
                            const char* message, void* context)
{
  if (type == PETSC_ERROR_INITIAL && message) *static_cast<std::string*>(context) = message;
  return code;
}

PetscErrorCode try_snes(const char* prefix, MPI_Comm comm)
{
  SNES snes = nullptr;
  PetscErrorCode code = SNESCreate(comm, &snes);
  if (!code) code = SNESSetOptionsPrefix(snes, prefix);
  if (!code) code = SNESSetFromOptions(snes);
  PetscInt iterations = 0; // looked at by PETSc in the solve only
  if (!code) code = SNESGetTolerances(snes, nullptr, nullptr, nullptr, &iterations, nullptr);
  if (!code && iterations < 0)
    code = PetscError(comm, __LINE__, __func__, __FILE__, PETSC_ERR_ARG_OUTOFRANGE, PETSC_ERROR_INITIAL,
                      "%ssnes_max_it is %" PetscInt_FMT ", it must be at least 0", prefix, iterations);
  (void)SNESDestroy(&snes);
  return code;
}

/// With the spectral transformation of the modes, which has a linear solver of its own.
PetscErrorCode try_pep(const char* prefix, MPI_Comm comm)
{
  PEP pep = nullptr;
  ST transformation = nullptr;
  PetscErrorCode code = PEPCreate(comm, &pep);
  if (!code) code = PEPGetST(pep, &transformation);
  if (!code) use_mumps(transformation);
  if (!code) code = PEPSetOptionsPrefix(pep, prefix);
  if (!code) code = PEPSetFromOptions(pep);
  (void)PEPDestroy(&pep);
  return code;
}

/// What an option that ends so chooses among: the types that the library knows.
struct TypeOption
{
  const char* ending;
  PetscFunctionList* types;
};

const std::array type_options = {
    TypeOption{"_snes_type", &SNESList}, TypeOption{"_linesearch_type", &SNESLineSearchList},
    TypeOption{"_ksp_type", &KSPList},   TypeOption{"_pc_type", &PCList},
    TypeOption{"_pep_type", &PEPList},   TypeOption{"_st_type", &STList}};

/// What is wrong with an option that names a type; empty if nothing is.
std::string problem_of_type(const std::string& name, const std::string& value)
{
  const auto option =
      std::ranges::find_if(type_options, [&](const TypeOption& one) { return name.ends_with(one.ending); });
  if (option == type_options.end()) return {};
  const char** known = nullptr;
  int count = 0;
  check(PetscFunctionListGet(*option->types, &known, &count));
  const std::vector<std::string> words(known, std::find(known, known + count, nullptr)); // the last one is null
  check(PetscFree(known));
  if (std::ranges::find(words, value) != words.end()) return {};
  std::string list;
  for (const std::string& word : words) list += " " + word;
  return "option -" + shortened(name) + " " + shortened(value) + ": it is one of" + list;
}

struct Trial
{
  const char* object;
  PetscErrorCode (*run)(const char* prefix, MPI_Comm comm);
};

constexpr std::array trials = {Trial{"cycle_full_", try_snes}, Trial{"cycle_", try_snes}, Trial{"modes_", try_pep}};

// Parts of names that objects ask for only while they are set up or solve; a trial does not get there.
constexpr std::array asked_later = {"_view", "_converged_reason", "_test_", "_compare_", "_mat_"};

bool is_asked_later(const std::string& name)
{
  return std::ranges::any_of(asked_later, [&](const char* part) { return name.find(part) != std::string::npos; });
}

struct GivenOption
{
  std::string name, value;
};

/// The options of solvers in the database that no one has asked for yet.
std::vector<GivenOption> unused_solver_options()
{
  PetscInt count = 0;
  char **names = nullptr, **values = nullptr;
  std::vector<GivenOption> unused;
  check(PetscOptionsLeftGet(nullptr, &count, &names, &values));
  for (PetscInt i = 0; i < count; ++i)
    if (solver_prefix_of(names[i])) unused.push_back({names[i], values[i] ? values[i] : ""});
  check(PetscOptionsLeftRestore(nullptr, &count, &names, &values));
  return unused;
}

void run_trial(const Trial& trial, const std::vector<GivenOption>& given, MPI_Comm comm)
{
  std::string message;
  check(PetscPushErrorHandler(keep_message, &message));
  const PetscErrorCode code = trial.run(trial.object, comm);
  check(PetscPopErrorHandler());
  if (code == PETSC_SUCCESS) return;
  for (const auto& [name, value] : given)
    if (const std::string problem = problem_of_type(name, value); !problem.empty()) throw Error(problem);
  throw Error(std::string("options -") + trial.object +
              "…, of PETSc's solvers: " + (message.empty() ? "a value that they do not take" : message));
}

/// Whether the run's options leave out the solver of a prefix, whatever the run finds.
bool leaves_out(const ProgramOptions& options, const SolverPrefix& prefix)
{
  return prefix.stage == Stage::modes && options.modes.solver != ModesSolver::toar;
}

} // namespace

const SolverPrefix* solver_prefix_of(const std::string& name)
{
  const auto found =
      std::ranges::find_if(solver_prefixes, [&](const SolverPrefix& prefix) { return name.starts_with(prefix.text); });
  return found == solver_prefixes.end() ? nullptr : &*found;
}

void check_solver_options(const ProgramOptions& options, MPI_Comm comm)
{
  const std::vector<GivenOption> given = unused_solver_options();
  std::string problem;
  for (const Trial& trial : trials) run_trial(trial, given, comm);
  for (const auto& [name, value] : given)
    if (leaves_out(options, *solver_prefix_of(name)))
      problem = "option -" + shortened(name) +
                ": no solver of this run takes it; leave it out, or give -modes_solver toar as well";
  for (const auto& [name, value] : unused_solver_options())
    if (!is_asked_later(name))
      problem = "unknown option -" + shortened(name) + ": the solver behind -" + solver_prefix_of(name)->text +
                "… has none of this name";
  agree(comm, problem);
}

} // namespace squeal
