#include "squeal/solver_options.hpp"

#include "squeal/algebra/shift_invert.hpp"
#include "squeal/session_options.hpp"

#include <algorithm>
#include <slepcpep.h>
#include <string_view>

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

/// A solver of a stage, with the options of that database; null: the program's own. With a database of its own it
/// solves x = 1, or for 20 eigenvalues, which no stage wants fewer of.
struct Trial
{
  const char* object; // the prefix that it has
  PetscErrorCode (*run)(const Trial& trial, MPI_Comm comm, PetscOptions database);
};

PetscErrorCode residual_of_ones(SNES, Vec x, Vec residual, void*)
{
  PetscFunctionBeginUser;
  PetscCall(VecCopy(x, residual));
  PetscCall(VecShift(residual, -1));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode keep_jacobian(SNES, Vec, Mat, Mat, void*)
{
  return PETSC_SUCCESS;
}

PetscErrorCode make_identity(MPI_Comm comm, Mat* identity)
{
  constexpr PetscInt size = 8;
  PetscFunctionBeginUser;
  PetscCall(MatCreateSeqDense(comm, size, size, nullptr, identity));
  PetscCall(MatShift(*identity, 1));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode rehearse_snes(SNES snes, MPI_Comm comm)
{
  Owned<Mat> identity;
  Owned<Vec> x, residual;
  PetscFunctionBeginUser;
  PetscCall(make_identity(comm, identity.put()));
  PetscCall(MatCreateVecs(identity, x.put(), residual.put()));
  PetscCall(SNESSetFunction(snes, residual, residual_of_ones, nullptr));
  PetscCall(SNESSetJacobian(snes, identity, identity, keep_jacobian, nullptr));
  PetscCall(SNESSetFromOptions(snes));
  PetscCall(SNESSolve(snes, nullptr, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode try_snes(const Trial& trial, MPI_Comm comm, PetscOptions database)
{
  Owned<SNES> snes;
  PetscInt iterations = 0; // looked at by PETSc in the solve only
  PetscFunctionBeginUser;
  if (database) comm = PETSC_COMM_SELF;
  PetscCall(SNESCreate(comm, snes.put()));
  PetscCall(PetscObjectSetOptions(reinterpret_cast<PetscObject>(snes.get()), database));
  PetscCall(SNESSetOptionsPrefix(snes, trial.object));
  if (database)
    PetscCall(rehearse_snes(snes, comm));
  else
    PetscCall(SNESSetFromOptions(snes));
  PetscCall(SNESGetTolerances(snes, nullptr, nullptr, nullptr, &iterations, nullptr));
  PetscCheck(iterations >= 0, comm, PETSC_ERR_ARG_OUTOFRANGE,
             "%ssnes_max_it is %" PetscInt_FMT ", it must be at least 0", trial.object, iterations);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/// The diagonal matrix of first, first + step, …
PetscErrorCode make_diagonal(double first, double step, MPI_Comm comm, Mat* A)
{
  constexpr PetscInt size = 64;
  PetscInt begin = 0, end = 0;
  PetscFunctionBeginUser;
  PetscCall(MatCreateAIJ(comm, PETSC_DECIDE, PETSC_DECIDE, size, size, 1, nullptr, 0, nullptr, A));
  PetscCall(MatGetOwnershipRange(*A, &begin, &end));
  for (PetscInt row = begin; row < end; ++row)
    PetscCall(MatSetValue(*A, row, row, first + step * static_cast<double>(row), INSERT_VALUES));
  PetscCall(MatAssemblyBegin(*A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(*A, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/// With the spectral transformation of the modes, which has a linear solver of its own.
PetscErrorCode try_pep(const Trial& trial, MPI_Comm comm, PetscOptions database)
{
  Owned<PEP> pep;
  Owned<Mat> K, C, M;
  ST transformation = nullptr;
  PetscFunctionBeginUser;
  PetscCall(PEPCreate(comm, pep.put()));
  PetscCall(PetscObjectSetOptions(reinterpret_cast<PetscObject>(pep.get()), database));
  PetscCall(PEPGetST(pep, &transformation));
  PetscCall(PetscObjectSetOptions(reinterpret_cast<PetscObject>(transformation), database));
  use_mumps(transformation);
  PetscCall(PEPSetOptionsPrefix(pep, trial.object));
  if (database)
  {
    PetscCall(make_diagonal(1, 1, comm, K.put()));
    PetscCall(make_diagonal(0.01, 0, comm, C.put()));
    PetscCall(make_diagonal(1, 0, comm, M.put()));
    Mat coefficients[3] = {K, C, M};
    PetscCall(PEPSetOperators(pep, 3, coefficients));
    PetscCall(PEPSetProblemType(pep, PEP_GENERAL));
    PetscCall(PEPSetType(pep, PEPTOAR));
    PetscCall(PEPSetWhichEigenpairs(pep, PEP_TARGET_MAGNITUDE));
    PetscCall(PEPSetTarget(pep, 0.5));
    PetscCall(PEPSetDimensions(pep, 20, PETSC_DEFAULT, PETSC_DEFAULT));
  }
  PetscCall(PEPSetFromOptions(pep));
  if (database) PetscCall(PEPSolve(pep));
  PetscFunctionReturn(PETSC_SUCCESS);
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

/// What is wrong with an option that names a type; empty if nothing is. Two types end the process here, since they need
/// more than an operator: they are not among those that may be given.
std::string problem_of_type(const std::string& name, const std::string& value)
{
  const auto option =
      std::ranges::find_if(type_options, [&](const TypeOption& one) { return name.ends_with(one.ending); });
  if (option == type_options.end()) return {};
  const char** known = nullptr;
  int count = 0;
  check(PetscFunctionListGet(*option->types, &known, &count));
  std::vector<std::string> words(known, std::find(known, known + count, nullptr)); // the last one is null
  check(PetscFree(known));
  std::erase_if(words, [](const std::string& word) { return word == PEPJD || word == SNESASPIN; });
  if (std::ranges::find(words, value) != words.end()) return {};
  std::string list;
  for (const std::string& word : words) list += " " + word;
  return "option -" + shortened(name) + " " + shortened(value) + ": it is one of" + list;
}

constexpr std::array trials = {Trial{"cycle_", try_snes}, Trial{"modes_", try_pep}};

// Parts of names that objects ask for only while they are set up or solve; a trial does not get there.
constexpr std::array asked_later = {"_test_", "_compare_", "_mat_"};

bool is_asked_later(const std::string& name)
{
  return is_solver_view(name) ||
         std::ranges::any_of(asked_later, [&](const char* part) { return name.find(part) != std::string::npos; });
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

/// What is wrong with the options; empty if nothing is. Collective.
std::string problem_of_trial(const Trial& trial, PetscOptions database, MPI_Comm comm)
{
  std::string message;
  check(PetscPushErrorHandler(keep_message, &message));
  const PetscErrorCode code = trial.run(trial, comm, database);
  check(PetscPopErrorHandler());
  if (code == PETSC_SUCCESS) return {};
  return std::string("options -") + trial.object +
         "…, of PETSc's solvers: " + (message.empty() ? "a value that they do not take" : message);
}

/// Whether an option belongs into a rehearsal, which must not print.
bool is_rehearsed(const std::string& name)
{
  constexpr std::array printing = {"_monitor", "_test_", "_compare_"};
  return !is_solver_view(name) && !name.ends_with("mumps_icntl_4") && // the level of MUMPS's own output
         std::ranges::none_of(printing, [&](const char* part) { return name.find(part) != std::string::npos; });
}

/// Solves a small problem with the options of one solver: some values fail in a solve only. Collective.
std::string problem_of_rehearsal(const Trial& trial, const std::vector<GivenOption>& given, MPI_Comm comm)
{
  std::vector<GivenOption> own;
  for (const GivenOption& option : given)
    if (solver_prefix_of(option.name)->object == std::string_view(trial.object) && is_rehearsed(option.name))
      own.push_back(option);
  if (own.empty()) return {};
  PetscOptions database = nullptr;
  check(PetscOptionsCreate(&database));
  for (const auto& [name, value] : own)
    check(PetscOptionsSetValue(database, ("-" + name).c_str(), value.empty() ? nullptr : value.c_str()));
  std::string problem = problem_of_trial(trial, database, comm);
  check(PetscOptionsDestroy(&database));
  return problem;
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
  for (PetscErrorCode (*make_types_known)() :
       {SNESInitializePackage, KSPInitializePackage, PCInitializePackage, STInitializePackage, PEPInitializePackage})
    check(make_types_known());
  for (const auto& [name, value] : given)
    if (const std::string wrong = problem_of_type(name, value); !wrong.empty()) throw Error(wrong);
  for (const Trial& trial : trials) agree(comm, problem_of_trial(trial, nullptr, comm));
  for (const auto& [name, value] : given)
    if (leaves_out(options, *solver_prefix_of(name)))
      problem = "option -" + shortened(name) +
                ": no solver of this run takes it; leave it out, or give -modes_solver toar as well";
  for (const auto& [name, value] : unused_solver_options())
    if (!is_asked_later(name))
      problem = "unknown option -" + shortened(name) + ": the solver behind -" + solver_prefix_of(name)->text +
                "… has none of this name";
  agree(comm, problem);
  for (const Trial& trial : trials) agree(comm, problem_of_rehearsal(trial, given, comm));
}

} // namespace squeal
