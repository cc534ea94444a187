#include "squeal/algebra/root.hpp"

#include <array>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>

namespace squeal
{

Root find_root(const std::function<std::optional<double>(double)>& function, Bracket bracket, double tolerance)
{
  struct NoValue
  {
  };
  auto [a, b, value_a, value_b] = bracket;
  const auto narrowed = [&](double x)
  {
    const std::optional<double> value = function(x);
    if (!value) throw NoValue{};
    if ((*value > 0) == (value_b > 0))
      b = x, value_b = *value;
    else
      a = x, value_a = *value;
    return *value;
  };
  const auto [low, at_low, high, at_high] =
      a < b ? std::array{a, value_a, b, value_b} : std::array{b, value_b, a, value_a};
  std::uintmax_t evaluations = 400;
  try
  {
    boost::math::tools::toms748_solve(
        narrowed, low, high, at_low, at_high, [&](double from, double to) { return to - from <= tolerance; },
        evaluations);
  }
  catch (const NoValue&)
  {
  }
  const double x = value_a == value_b ? (a + b) / 2 : (a * value_b - b * value_a) / (value_b - value_a);
  return {x, value_a == 0 || value_b == 0 ? 0 : std::abs(b - a), {a, b, value_a, value_b}};
}

} // namespace squeal
