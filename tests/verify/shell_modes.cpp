// ranks: 1
/// Frequencies of free shells. Sources: Kirchhoff plate (Bessel functions, Leissa 1969); free cylinder by a
/// semi-analytical series of thin shell theory; NAFEMS, Selected Benchmarks for Natural Frequency Analysis (plates).
#include "small_fem.hpp"

#include <doctest/doctest.h>
#include <string>

using namespace squeal;
using namespace small_fem;

namespace
{

/// Disc of radius 1: a square in the middle, four curved quarters around it, n elements along each of their sides.
small_fem::Mesh disc(int n)
{
  const double half = 0.4;
  std::vector<small_fem::Mesh> parts = {quads(n, n,
                                              [&](double x, double y) {
                                                return Vec3{half * (2 * x - 1), half * (2 * y - 1), 0};
                                              })};
  for (int quarter = 0; quarter < 4; ++quarter)
    parts.push_back(quads(n, n,
                          [&](double r, double t)
                          {
                            const double angle = M_PI / 2 * (t - 0.5), c = std::cos(quarter * M_PI / 2),
                                         s = std::sin(quarter * M_PI / 2);
                            const double x = (1 - r) * half + r * std::cos(angle),
                                         y = (1 - r) * half * (2 * t - 1) + r * std::sin(angle);
                            return Vec3{c * x - s * y, s * x + c * y, 0};
                          }));
  return joined(parts);
}

void check_frequencies(const Body& body, const Prescribed& held, int zeros, const std::vector<double>& exact,
                       double tolerance)
{
  const double omega = 2 * M_PI * exact.front();
  const auto f = frequencies(assemble(body), held, zeros + int(exact.size()), 0.5 * omega * omega);
  for (int i = 0; i < zeros; ++i) CHECK(f[i] < 1e-4 * exact.front()); // w^2 below 1e-8 of the first
  for (std::size_t i = 0; i < exact.size(); ++i) CHECK(f[zeros + i] == approx(exact[i], tolerance));
}

} // namespace

TEST_CASE("a free circular plate rings as Kirchhoff says")
{
  const Material steel{210e9, 0.3, 7850};
  const double h = 0.01, unit = std::sqrt(steel.young * h * h / (12 * (1 - 0.09) * steel.density)) / (2 * M_PI);
  std::vector<double> exact; // n = 2, 2, 0, 3, 3, 1, 1
  for (double lambda : {5.358329788, 5.358329788, 9.00313735, 12.43898817, 12.43898817, 20.47455011, 20.47455011})
    exact.push_back(lambda * unit);
  SUBCASE("shell4")
  {
    check_frequencies({disc(12), steel, h}, {}, 6, exact, 0.005);
  }
  SUBCASE("shell3")
  {
    check_frequencies({triangles(disc(12)), steel, h}, {}, 6, exact, 0.005);
  }
}

TEST_CASE("a free square plate rings as NAFEMS FV12 should")
{
  const std::vector<double> exact = {1.62165, 2.3595, 2.92228, 4.19024, 4.19024, 7.356}; // membrane motion left free
  const auto plate = quads(16, 16, [](double x, double y) { return Vec3{10 * x, 10 * y, 0}; });
  SUBCASE("shell4")
  {
    check_frequencies({plate, {200e9, 0.3, 8000}, 0.05}, {}, 6, exact, 0.005);
  }
  SUBCASE("shell3")
  {
    check_frequencies({triangles(plate), {200e9, 0.3, 8000}, 0.05}, {}, 6, exact, 0.01);
  }
}

TEST_CASE("a cantilevered square plate rings as NAFEMS FV16 says")
{
  const std::vector<double> exact = {0.41793, 1.02422, 2.56275, 3.27490, 3.72716, 6.52420};
  const auto plate = quads(16, 16, [](double x, double y) { return Vec3{10 * x, 10 * y, 0}; });
  Prescribed held;
  for (std::size_t i = 0; i < plate.x.size(); ++i)
    for (int k = 0; k < 6; ++k)
      if (plate.x[i][0] == 0) held[6 * int(i) + k] = 0;
  SUBCASE("shell4")
  {
    check_frequencies({plate, {200e9, 0.3, 8000}, 0.05}, held, 0, exact, 0.01);
  }
  SUBCASE("shell3")
  {
    check_frequencies({triangles(plate), {200e9, 0.3, 8000}, 0.05}, held, 0, exact, 0.01);
  }
}

TEST_CASE("a cantilevered membrane rings as NAFEMS FV32 says: in-plane bending of a tapered shell")
{
  const std::vector<double> exact = {44.617, 130.01, 162.69, 245.99, 379.72, 391.40};
  const auto taper = quads(16, 8, [](double x, double y) { return Vec3{10 * x, (y - 0.5) * (5 - 4 * x), 0}; });
  Prescribed held;
  for (std::size_t i = 0; i < taper.x.size(); ++i)
    for (int k = 0; k < 6; ++k)
      if (taper.x[i][0] == 0 || (k > 1 && k < 5)) held[6 * int(i) + k] = 0;
  // waves of a fifth of the length on 16 elements that taper: second order
  SUBCASE("shell4")
  {
    check_frequencies({taper, {200e9, 0.3, 8000}, 0.05}, held, 0, exact, 0.02);
  }
  SUBCASE("shell3")
  {
    check_frequencies({triangles(taper), {200e9, 0.3, 8000}, 0.05}, held, 0, exact, 0.04);
  }
}

TEST_CASE("a free cylinder rings as shell theory says")
{
  const std::vector<double> exact = {147.029, 147.029, 232.922, 232.922, 415.467, 415.467,
                                     572.924, 572.924, 795.444, 795.444, 989.334, 989.334};
  const auto tube = joined({quads(64, 16,
                                  [](double a, double z) {
                                    return Vec3{0.15 * std::cos(2 * M_PI * a), 0.15 * std::sin(2 * M_PI * a), 0.2 * z};
                                  })});
  SUBCASE("shell4")
  {
    check_frequencies({tube, {210e9, 0.3, 7850}, 0.005}, {}, 6, exact, 0.01);
  }
  SUBCASE("shell3")
  {
    check_frequencies({triangles(tube), {210e9, 0.3, 7850}, 0.005}, {}, 6, exact, 0.01);
  }
}
