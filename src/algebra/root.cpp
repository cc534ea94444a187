#include "squeal/algebra/root.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

Root find_root(const std::function<std::optional<double>(double)>& function, Bracket bracket, double tolerance)
{
  auto [a, b, value_a, value_b] = bracket;
  constexpr double beside = 0.4; // of the tolerance: a zero this near an end is enclosed by the next value
  double longest = std::abs(b - a);
  for (int i = 0; std::abs(b - a) > tolerance; ++i)
  {
    double x = (a * value_b - b * value_a) / (value_b - value_a);
    if (i % 4 == 3) // four values halve the bracket at least
    {
      const bool slow = 2 * std::abs(b - a) > longest;
      longest = std::abs(b - a);
      if (slow)
      {
        x = (a + b) / 2;
        longest /= 2;
      }
    }
    x = std::clamp(x, std::min(a, b) + beside * tolerance, std::max(a, b) - beside * tolerance);
    const std::optional<double> value = function(x);
    if (!value) break;
    if ((*value > 0) == (value_b > 0))
      value_a /= 2;
    else
    {
      a = b;
      value_a = value_b;
    }
    b = x;
    value_b = *value;
  }
  const double x = value_a == value_b ? (a + b) / 2 : (a * value_b - b * value_a) / (value_b - value_a);
  return {x, std::abs(b - a)};
}

} // namespace squeal
