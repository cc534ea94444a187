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

const std::vector<std::pair<std::string, Shape>> shapes = {{"shell4", Shape::quad4},
                                                           {"shell3", Shape::triangle3},
                                                           {"shell6", Shape::triangle6},
                                                           {"shell8", Shape::quad8},
                                                           {"shell9", Shape::quad9}};

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
  for (const auto& [name, shape] : shapes)
  {
    CAPTURE(name);
    check_frequencies({in_shape(disc(12), shape), steel, h}, {}, 6, exact, 0.005);
  }
}

TEST_CASE("a free square plate rings as NAFEMS FV12 should")
{
  const std::vector<double> exact = {1.62165, 2.3595, 2.92228, 4.19024, 4.19024, 7.356}; // membrane motion left free
  for (const auto& [name, shape] : shapes)
  {
    CAPTURE(name);
    const auto plate = shells(shape, 16, 16, [](double x, double y) { return Vec3{10 * x, 10 * y, 0}; });
    check_frequencies({plate, {200e9, 0.3, 8000}, 0.05}, {}, 6, exact, shape == Shape::quad4 ? 0.005 : 0.01);
  }
}

TEST_CASE("a cantilevered square plate rings as NAFEMS FV16 says")
{
  const std::vector<double> exact = {0.41793, 1.02422, 2.56275, 3.27490, 3.72716, 6.52420};
  for (const auto& [name, shape] : shapes)
  {
    CAPTURE(name);
    const auto plate = shells(shape, 16, 16, [](double x, double y) { return Vec3{10 * x, 10 * y, 0}; });
    Prescribed held;
    for (std::size_t i = 0; i < plate.x.size(); ++i)
      for (int k = 0; k < 6; ++k)
        if (plate.x[i][0] == 0) held[6 * int(i) + k] = 0;
    check_frequencies({plate, {200e9, 0.3, 8000}, 0.05}, held, 0, exact, 0.01);
  }
}

TEST_CASE("a cantilevered membrane rings as NAFEMS FV32 says: in-plane bending of a tapered shell")
{
  const std::vector<double> exact = {44.617, 130.01, 162.69, 245.99, 379.72, 391.40};
  for (const auto& [name, shape] : shapes)
  {
    CAPTURE(name);
    const auto taper = shells(shape, 16, 8,
                              [](double x, double y) {
                                return Vec3{10 * x, (y - 0.5) * (5 - 4 * x), 0};
                              });
    Prescribed held;
    for (std::size_t i = 0; i < taper.x.size(); ++i)
      for (int k = 0; k < 6; ++k)
        if (taper.x[i][0] == 0 || (k > 1 && k < 5)) held[6 * int(i) + k] = 0;
    // waves of a fifth of the length on 16 elements that taper: second order
    check_frequencies({taper, {200e9, 0.3, 8000}, 0.05}, held, 0, exact, shape == Shape::quad4 ? 0.02 : 0.04);
  }
}

TEST_CASE("a free cylinder rings as shell theory says")
{
  const std::vector<double> exact = {147.029, 147.029, 232.922, 232.922, 415.467, 415.467,
                                     572.924, 572.924, 795.444, 795.444, 989.334, 989.334};
  for (const auto& [name, shape] : shapes)
  {
    CAPTURE(name);
    const auto tube =
        joined({shells(shape, 64, 16,
                       [](double a, double z) {
                         return Vec3{0.15 * std::cos(2 * M_PI * a), 0.15 * std::sin(2 * M_PI * a), 0.2 * z};
                       })});
    check_frequencies({tube, {210e9, 0.3, 7850}, 0.005}, {}, 6, exact, 0.01);
  }
}

namespace
{

/// The lowest frequency [Hz] of a square plate of unit sides on hard simple supports, whose sides do not turn along
/// themselves, by Mindlin's theory: w = sin(pi x) sin(pi y).
double mindlin(const Material& material, double h)
{
  const double nu = material.poisson, k = 2 * M_PI * M_PI, shear = 5. / 6 * h * material.young / (2 * (1 + nu)),
               bending = material.young * h * h * h / (12 * (1 - nu * nu)), mass = material.density * h,
               inertia = mass * h * h / 12;
  // (shear k - mass w2) (bending k + shear - inertia w2) = shear^2 k
  const double b = mass * (bending * k + shear) + inertia * shear * k, c = shear * k * bending * k;
  return std::sqrt(2 * c / (b + std::sqrt(b * b - 4 * mass * inertia * c))) / (2 * M_PI);
}

/// The relative error of that frequency with n cells along a side, skewed within by a tenth of the sides.
double supported_plate_error(Shape shape, int n, double h)
{
  const Material material{210e9, 0.3, 7850};
  const auto place = [](double x, double y)
  {
    const double bump = 0.1 * std::sin(M_PI * x) * std::sin(M_PI * y);
    return Vec3{x + bump, y - bump, 0};
  };
  const auto plate = shells(shape, n, n, place);
  Prescribed held;
  for (std::size_t i = 0; i < plate.x.size(); ++i)
  {
    const auto on_side = [&](int k) { return plate.x[i][k] < 1e-9 || plate.x[i][k] > 1 - 1e-9; };
    for (const int k : {0, 1, 5}) held[6 * int(i) + k] = 0; // bending alone
    if (on_side(0)) held[6 * int(i) + 3] = 0;
    if (on_side(1)) held[6 * int(i) + 4] = 0;
    if (on_side(0) || on_side(1)) held[6 * int(i) + 2] = 0;
  }
  const double exact = mindlin(material, h), omega = 2 * M_PI * exact;
  return frequencies(assemble({plate, material, h}), held, 1, 0.1 * omega * omega).front() / exact - 1;
}

} // namespace

TEST_CASE("the frequency of a supported plate converges with the square of the length, at any thickness")
{
  for (const auto& [name, shape] : shapes)
    for (const double h : {0.1, 1e-3, 1e-5})
    {
      CAPTURE(name);
      CAPTURE(h);
      const double coarse = std::abs(supported_plate_error(shape, 12, h)),
                   fine = std::abs(supported_plate_error(shape, 24, h));
      CHECK(coarse < 0.01);
      CHECK(fine < 0.35 * coarse);
    }
}
