#include "squeal/reduction/reduced_model.hpp"

#include "squeal/algebra/quadratic_residual.hpp"
#include "squeal/contact/row_forces.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"

#include <cmath>

namespace squeal
{

std::vector<int> pairs_that_may_change(const Interface& interface, const Equilibrium& equilibrium,
                                       const ComplexMode& mode, double amplitude)
{
  const std::vector<double> real = relative(interface, mode.real), imaginary = relative(interface, mode.imaginary);
  const std::vector<double> still = relative(interface, equilibrium.u);
  const auto normal = [&](const std::vector<double>& x, std::size_t pair)
  { return PairView(x, interface.directions).normal(pair); };
  std::vector<int> pairs;
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
  {
    const double gap = interface.gap[i] + normal(still, i);
    const bool changes = equilibrium.closed[i]
                             ? normal(equilibrium.reactions, i) < amplitude * std::abs(mode.reactions[i])
                             : gap < amplitude * std::hypot(normal(real, i), normal(imaginary, i));
    if (changes) pairs.push_back(static_cast<int>(i));
  }
  return pairs;
}

std::vector<int> pairs_that_may_turn(const Interface& interface, const ComplexMode& mode, double amplitude)
{
  const std::vector<double> real = relative(interface, mode.real), imaginary = relative(interface, mode.imaginary);
  std::vector<int> pairs;
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
  {
    const double moves = std::hypot(length(PairView(real, interface.directions).tangential(i)),
                                    length(PairView(imaginary, interface.directions).tangential(i)));
    const double drive = drive_speed(interface, i);
    if (drive > 0 && amplitude * std::abs(mode.lambda) * moves >= drive) pairs.push_back(static_cast<int>(i));
  }
  return pairs;
}

std::vector<int> pairs_that_may_slip(const SlidingEquilibrium& sliding, const LinearisedSliding& linearised,
                                     const ComplexMode& mode, double amplitude)
{
  const auto& [structure, interface, equilibrium] = sliding;
  std::vector<int> pairs;
  if (!has_undriven_pairs(interface)) return pairs;
  const Mat K = linearised.K.get() ? linearised.K.get() : structure.K.get();
  const Owned<Vec> real = zeros_like(mode.real), imaginary = zeros_like(mode.real);
  quadratic_residual({structure.M, linearised.C, K}, mode.lambda, {mode.real, mode.imaginary}, {real, imaginary});
  std::vector<char> taken(interface.size(), 0); // rows that the mode holds
  const PairView<char> rows(taken, interface.directions);
  for (std::size_t i = 0; i < rows.pairs(); ++i)
  {
    if (!equilibrium.closed[i]) continue;
    rows.normal(i) = compliance_of(interface, i) == 0;
    std::ranges::fill(rows.tangential(i), is_undriven(interface, i) || rows.normal(i));
  }
  const std::vector<double> a = forces_on_rows(interface, taken, real), b = forces_on_rows(interface, taken, imaginary);
  const PairView first(a, interface.directions), second(b, interface.directions),
      still(equilibrium.reactions, interface.directions);
  for (std::size_t i = 0; i < rows.pairs(); ++i)
  {
    if (!is_undriven(interface, i) || !equilibrium.closed[i]) continue;
    const double mu = friction_coefficient(interface.friction.of(i), 0).value,
                 normal = amplitude * std::abs(mode.reactions[i]),
                 tangential = amplitude * std::hypot(length(first.tangential(i)), length(second.tangential(i)));
    if (length(still.tangential(i)) + tangential > mu * (still.normal(i) - normal))
      pairs.push_back(static_cast<int>(i));
  }
  return pairs;
}

} // namespace squeal
