#include "squeal/solid/rayleigh.hpp"

#include "squeal/algebra/multivector.hpp"

#include <cmath>

namespace squeal
{

std::optional<Rayleigh> rayleigh_part(Mat M, Mat C, Mat K)
{
  constexpr double rounding = 1e-13, least_angle = 1e-3; // the latter's sine, squared
  const MultiVector tests = random_multivector(K, 2);
  const MultiVector of_M = product(M, tests), of_K = product(K, tests);
  MultiVector of_C = product(C, tests);
  const auto inner = [](const MultiVector& a, const MultiVector& b) { return inner_products(a, b).trace(); };
  const double mass = std::sqrt(inner(of_M, of_M)), stiffness = std::sqrt(inner(of_K, of_K));
  if (mass == 0 || stiffness == 0) return std::nullopt;
  const double common = inner(of_M, of_K) / (mass * stiffness), apart = 1 - common * common;
  if (apart < least_angle) return std::nullopt;
  const double along_M = inner(of_M, of_C) / mass, along_K = inner(of_K, of_C) / stiffness,
               size = std::sqrt(inner(of_C, of_C));
  const Rayleigh result{(along_M - common * along_K) / (apart * mass),
                        (along_K - common * along_M) / (apart * stiffness)};
  of_C.entries -= result.of_mass * of_M.entries + result.of_stiffness * of_K.entries;
  if (!(std::sqrt(inner(of_C, of_C)) <= rounding * size)) return std::nullopt;
  return result;
}

} // namespace squeal
