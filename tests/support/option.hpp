#pragma once
/// An option as given, for as long as it lives.
#include "squeal/base/petsc.hpp"

namespace squeal::test
{

struct Option
{
  const char* name;
  Option(const char* key, const char* value) : name(key) { check(PetscOptionsSetValue(nullptr, key, value)); }
  ~Option() { (void)PetscOptionsClearValue(nullptr, name); }
  Option(const Option&) = delete;
  Option& operator=(const Option&) = delete;
};

} // namespace squeal::test
