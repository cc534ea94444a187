#pragma once
/// The generator splitmix64 (Steele, Lea, Flood 2014), as a hash of a number.
#include <cstdint>

namespace squeal
{

constexpr std::uint64_t splitmix64(std::uint64_t number)
{
  std::uint64_t x = number + 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

} // namespace squeal
