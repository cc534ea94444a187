#pragma once
/// Vector registers and the right-hand sides that they hold.
#include "squeal/algebra/simd.hpp"

#include <cstddef>
#include <cstring>
#include <type_traits>

namespace squeal
{

using Four = double __attribute__((vector_size(32)));
using Eight = double __attribute__((vector_size(64))); // for AVX-512: without it GCC keeps arrays of these in memory

template <class Vector> SQUEAL_INLINE void get(const double* from, Vector& to)
{
  std::memcpy(&to, from, sizeof to);
}

template <class Vector> SQUEAL_INLINE void put(const Vector& value, double* to)
{
  std::memcpy(to, &value, sizeof value);
}

/// The right-hand sides in a Vector; of a single right-hand side, the vector registers hold rows.
template <class Vector> constexpr std::size_t taken = sizeof(Vector) / sizeof(double);

/// Calls work(std::type_identity<Vector>) with what holds right-hand sides: 1, 4 or a multiple of 8 of them.
template <class Work> SQUEAL_INLINE void with_vector(std::size_t lanes, const Work& work)
{
  if (lanes == 1)
    work(std::type_identity<double>{});
  else if (lanes % taken<Eight> == 0 && SQUEAL_HAS_AVX512)
    work(std::type_identity<Eight>{});
  else
    work(std::type_identity<Four>{});
}

} // namespace squeal
