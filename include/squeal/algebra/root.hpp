#pragma once
/// A zero of a function of one number between two values of different sign. Arithmetic of one rank.
#include <functional>
#include <optional>

namespace squeal
{

/// Values of different sign at both ends.
struct Bracket
{
  double a = 0, b = 0; // arguments
  double value_a = 0, value_b = 0;
};

/// `bracket`: the last one, which holds the zero, a and b on the sides that they were given on. `error`: its length, or
/// 0 where an end is the zero itself.
struct Root
{
  double x = 0, error = 0;
  Bracket bracket{};
};

/// TOMS 748 (Alefeld, Potra and Shi 1995) until the bracket is no longer than `tolerance`. Where the function has no
/// value the search ends with the bracket that it has.
Root find_root(const std::function<std::optional<double>(double)>& function, Bracket bracket, double tolerance);

} // namespace squeal
