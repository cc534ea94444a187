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

/// `error`: the length of the last bracket, which holds the zero.
struct Root
{
  double x = 0, error = 0;
};

/// TOMS 748 (Alefeld, Potra and Shi 1995) until the bracket is no longer than `tolerance`. Where the function has no
/// value the search ends with the bracket that it has.
Root find_root(const std::function<std::optional<double>(double)>& function, Bracket bracket, double tolerance);

} // namespace squeal
