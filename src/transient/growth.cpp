#include "squeal/transient/growth.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace squeal
{

ModeAmplitude follow(const Structure& structure, const Equilibrium& equilibrium, const ComplexMode& mode)
{
  ModeAmplitude amplitude;
  amplitude.mode = &mode;
  amplitude.v_real = zeros_like(structure.load);
  amplitude.v_imaginary = zeros_like(structure.load);
  const double sigma = mode.lambda.real(), omega = mode.lambda.imag();
  check(VecAXPBYPCZ(amplitude.v_real, sigma, -omega, 0, mode.real, mode.imaginary));
  check(VecAXPBYPCZ(amplitude.v_imaginary, omega, sigma, 0, mode.real, mode.imaginary));

  const Owned<Vec> image = zeros_like(structure.load);
  const auto product = [&](Vec left, Mat matrix, Vec right)
  {
    double value = 0;
    check(MatMult(matrix, right, image));
    check(VecDot(left, image, &value));
    return value;
  };
  amplitude.K_real = product(mode.real, structure.K, equilibrium.u);
  amplitude.K_imaginary = product(mode.imaginary, structure.K, equilibrium.u);
  amplitude.rr = product(mode.real, structure.K, mode.real) + product(amplitude.v_real, structure.M, amplitude.v_real);
  amplitude.ri =
      product(mode.real, structure.K, mode.imaginary) + product(amplitude.v_real, structure.M, amplitude.v_imaginary);
  amplitude.ii = product(mode.imaginary, structure.K, mode.imaginary) +
                 product(amplitude.v_imaginary, structure.M, amplitude.v_imaginary);
  return amplitude;
}

void observe(ModeAmplitude& amplitude, double time, Vec Ku, Vec Mv)
{
  const std::array<Vec, 4> left = {amplitude.mode->real, amplitude.v_real, amplitude.mode->imaginary,
                                   amplitude.v_imaginary};
  const std::array<Vec, 4> right = {Ku, Mv, Ku, Mv};
  std::array<double, 4> product{};
  for (std::size_t i = 0; i < 4; ++i) check(VecDotBegin(left[i], right[i], &product[i]));
  for (std::size_t i = 0; i < 4; ++i) check(VecDotEnd(left[i], right[i], &product[i]));
  const double a = product[0] - amplitude.K_real + product[1], b = product[2] - amplitude.K_imaginary + product[3];
  const double determinant = amplitude.rr * amplitude.ii - amplitude.ri * amplitude.ri;
  const double x = (amplitude.ii * a - amplitude.ri * b) / determinant;
  const double y = (amplitude.rr * b - amplitude.ri * a) / determinant;
  amplitude.time.push_back(time);
  amplitude.log_modulus.push_back(std::log(std::hypot(x, y)));
}

double growth_rate(const ModeAmplitude& amplitude, double period)
{
  const std::vector<double>&t = amplitude.time, &y = amplitude.log_modulus;
  const double slack = 1 + 1e-9; // a whole period must not be lost to rounding
  const double length = t.empty() ? 0 : period * std::floor((t.back() - t.front()) / period * slack);
  if (!(length > 0)) return std::numeric_limits<double>::quiet_NaN();
  const auto count = std::upper_bound(t.begin(), t.end(), t.front() + length * slack) - t.begin();
  double mean_t = 0, mean_y = 0, ty = 0, tt = 0;
  for (auto i = 0u; i < count; ++i)
  {
    mean_t += t[i] / static_cast<double>(count);
    mean_y += y[i] / static_cast<double>(count);
  }
  for (auto i = 0u; i < count; ++i)
  {
    ty += (t[i] - mean_t) * (y[i] - mean_y);
    tt += (t[i] - mean_t) * (t[i] - mean_t);
  }
  return ty / tt;
}

} // namespace squeal
