/// Options of the stages' PETSc and SLEPc objects, tried on objects that are thrown away: the stages themselves would
/// find a wrong type or word only when they begin.
#include "squeal/base/petsc.hpp"
#include "squeal/options.hpp"

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

/// A copy of the options database in the place of the database itself, which so counts no option as used.
class CopiedOptions
{
public:
  CopiedOptions()
  {
    char* all = nullptr;
    check(PetscOptionsGetAll(nullptr, &all));
    text = all;
    check(PetscFree(all));
    check(PetscOptionsCreate(&copy_));
    check(PetscOptionsInsertString(copy_, text.c_str()));
    check(PetscOptionsPush(copy_));
  }
  ~CopiedOptions()
  {
    (void)PetscOptionsPop();
    (void)PetscOptionsDestroy(&copy_);
  }
  CopiedOptions(const CopiedOptions&) = delete;
  CopiedOptions& operator=(const CopiedOptions&) = delete;

  std::string text;

private:
  PetscOptions copy_ = nullptr;
};

PetscErrorCode try_snes(const char* prefix)
{
  SNES snes = nullptr;
  PetscErrorCode code = SNESCreate(PETSC_COMM_SELF, &snes);
  if (!code) code = SNESSetOptionsPrefix(snes, prefix);
  if (!code) code = SNESSetFromOptions(snes);
  (void)SNESDestroy(&snes);
  return code;
}

PetscErrorCode try_pep(const char* prefix)
{
  PEP pep = nullptr;
  PetscErrorCode code = PEPCreate(PETSC_COMM_SELF, &pep);
  if (!code) code = PEPSetOptionsPrefix(pep, prefix);
  if (!code) code = PEPSetFromOptions(pep);
  (void)PEPDestroy(&pep);
  return code;
}

struct Trial
{
  const char* prefix;
  PetscErrorCode (*run)(const char* prefix);
};

constexpr std::array trials = {Trial{"cycle_full_", try_snes}, Trial{"cycle_", try_snes}, Trial{"modes_", try_pep}};

} // namespace

void check_solver_options(MPI_Comm comm)
{
  on_rank_zero(comm,
               []
               {
                 const CopiedOptions options;
                 for (const Trial& trial : trials)
                 {
                   if (options.text.find(std::string("-") + trial.prefix) == std::string::npos) continue;
                   std::string message;
                   check(PetscPushErrorHandler(keep_message, &message));
                   const PetscErrorCode code = trial.run(trial.prefix);
                   check(PetscPopErrorHandler());
                   if (code != PETSC_SUCCESS)
                     throw Error(std::string("options -") + trial.prefix + "…, of PETSc's solvers: " +
                                 (message.empty() ? "a value that they do not take" : message));
                 }
               });
}

} // namespace squeal
