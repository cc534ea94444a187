/// Rayleigh damping fitted to measured damping ratios (src/README.md, section 13.3): least squares of the relative
/// errors, zeta(omega_i)/zeta_i - 1, with alpha >= 0 and beta >= 0.
#include "scene_keys.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// Sum of the squared relative errors.
double misfit(const RayleighDamping& damping)
{
  double sum = 0;
  for (const auto& [frequency_hz, ratio] : damping.measured)
    sum += std::pow(damping_ratio_at(damping, frequency_hz) / ratio - 1, 2);
  return sum;
}

/// The fit of two unknowns is that of both, or of one of them where the other would be negative.
void fit(RayleighDamping& damping)
{
  double aa = 0, ab = 0, bb = 0, a = 0, b = 0; // normal equations of both unknowns
  for (const auto& [frequency_hz, ratio] : damping.measured)
  {
    const double omega = two_pi * frequency_hz, by_alpha = 1 / (2 * omega * ratio), by_beta = omega / (2 * ratio);
    aa += by_alpha * by_alpha;
    ab += by_alpha * by_beta;
    bb += by_beta * by_beta;
    a += by_alpha;
    b += by_beta;
  }
  const double determinant = aa * bb - ab * ab;
  damping.alpha = (bb * a - ab * b) / determinant;
  damping.beta = (aa * b - ab * a) / determinant;
  if (damping.alpha >= 0 && damping.beta >= 0) return;
  RayleighDamping other = damping;
  damping.alpha = a / aa;
  damping.beta = 0;
  other.alpha = 0;
  other.beta = b / bb;
  if (misfit(other) < misfit(damping)) damping = other;
}

} // namespace

double damping_ratio_at(const RayleighDamping& damping, double frequency_hz)
{
  const double omega = two_pi * frequency_hz;
  return damping.alpha / (2 * omega) + damping.beta * omega / 2;
}

void fit_damping(Scene& scene, const Places& places)
{
  RayleighDamping& damping = scene.damping;
  if (damping.measured.empty()) return;
  const RayleighDamping given = damping;
  fit(damping);
  for (const auto& [key, member] : {std::pair{"alpha", &RayleighDamping::alpha}, {"beta", &RayleighDamping::beta}})
    if (given.*member != 0 && given.*member != damping.*member) // a resolved scene holds what was fitted
      throw Error(places.at(&damping.measured) + ": [damping] " + key +
                  format(" = %g excludes 'measured', from which it follows as %.17g: keep one of them", given.*member,
                         damping.*member));
}

} // namespace squeal
