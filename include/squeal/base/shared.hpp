#pragma once
/// Objects of PETSc that several owners share. What is shared is not changed.
#include "squeal/base/petsc.hpp"

namespace squeal
{

/// Another owner of the object; null if it is null.
template <class Handle> Owned<Handle> shared(Handle handle)
{
  if (handle) check(PetscObjectReference(reinterpret_cast<PetscObject>(handle)));
  return Owned<Handle>(handle);
}

} // namespace squeal
