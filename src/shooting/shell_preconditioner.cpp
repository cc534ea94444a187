#include "shell_preconditioner.hpp"

namespace squeal
{

void set_shell_preconditioner(SNES snes, const ShellPreconditioner& preconditioner)
{
  KSP ksp = nullptr;
  PC pc = nullptr;
  PetscBool shell = PETSC_FALSE;
  check(SNESGetKSP(snes, &ksp));
  check(KSPGetPC(ksp, &pc));
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCSHELL, &shell));
  if (!shell) return; // the user's choice
  check(PCShellSetContext(pc, preconditioner.context));
  check(PCShellSetName(pc, preconditioner.name));
  check(PCShellSetApply(pc, preconditioner.apply));
}

} // namespace squeal
