#pragma once
/// Conversion of sizes to the int that MPI, METIS and MUMPS take.
#include "squeal/base/error.hpp"

#include <utility>

namespace squeal
{

/// `value` as an int. Throws Error if it does not fit.
template <class Integer> int to_int(Integer value)
{
  if (!std::in_range<int>(value))
    throw Error("a size of " + std::to_string(value) + " exceeds what MPI, METIS and MUMPS take (2^31 - 1)");
  return static_cast<int>(value);
}

} // namespace squeal
