#include "squeal/contact/row_forces.hpp"

#include <numeric>

namespace squeal
{

namespace
{

double product(const std::vector<double>& a, const std::vector<double>& b)
{
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.);
}

/// B x, without the rows that are not taken.
std::vector<double> rows_taken(const Interface& interface, const std::vector<char>& taken, Vec x)
{
  std::vector<double> rows = relative(interface, x);
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] *= taken[i];
  return rows;
}

} // namespace

std::vector<double> forces_on_rows(const Interface& interface, const std::vector<char>& taken, Vec x)
{
  constexpr double rounding = 1e-14;
  constexpr int most_passes = 200;
  const Owned<Vec> work = zeros_like(x);
  std::vector<double> residual = rows_taken(interface, taken, x), z(residual.size(), 0.), along = residual;
  double square = product(residual, residual);
  const double enough = rounding * rounding * square;
  for (int pass = 0; square > enough && pass < most_passes; ++pass)
  {
    check(VecSet(work, 0));
    add_reactions(interface, along, work);
    const std::vector<double> image = rows_taken(interface, taken, work);
    const double part = square / product(along, image);
    for (std::size_t i = 0; i < z.size(); ++i)
    {
      z[i] += part * along[i];
      residual[i] -= part * image[i];
    }
    const double next = product(residual, residual);
    for (std::size_t i = 0; i < z.size(); ++i) along[i] = residual[i] + next / square * along[i];
    square = next;
  }
  return z;
}

} // namespace squeal
