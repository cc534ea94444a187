#pragma once
/// Exceptions in functions that PETSc calls back. Its C code must not be unwound, so an exception is kept until the
/// library call that led there has returned.
#include "squeal/base/petsc.hpp"

#include <exception>

namespace squeal
{

/// Runs `work`. An exception is kept in `failure`, and the library gets an error code.
template <class Work> PetscErrorCode guarded(std::exception_ptr& failure, Work work)
{
  try
  {
    work();
  }
  catch (...)
  {
    failure = std::current_exception();
    return PETSC_ERR_LIB;
  }
  return PETSC_SUCCESS;
}

/// After the library call: throws the exception that a callback kept, else what the call itself reports.
inline void check_after_callbacks(PetscErrorCode code, const std::exception_ptr& failure)
{
  if (failure) std::rethrow_exception(failure);
  check(code);
}

} // namespace squeal
