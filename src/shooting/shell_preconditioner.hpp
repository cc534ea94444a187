#pragma once
/// A nonlinear solver's own preconditioner, a PETSc shell, unless the user chose another by options.
#include "squeal/base/petsc.hpp"

namespace squeal
{

struct ShellPreconditioner
{
  const char* name; // in -snes_view
  void* context;
  PetscErrorCode (*apply)(PC pc, Vec b, Vec x);
};

/// Attaches it where the solver's preconditioner is still a shell.
void set_shell_preconditioner(SNES snes, const ShellPreconditioner& preconditioner);

} // namespace squeal
