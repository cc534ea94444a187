#include "derived.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

StepBias bias_of(std::complex<double> lambda, std::complex<double> discrete)
{
  if (lambda.imag() == 0) return {};
  return {discrete.real() / lambda.real() - 1, discrete.imag() / lambda.imag() - 1};
}

} // namespace

NormalForces normal_forces(const Equilibrium& equilibrium)
{
  NormalForces forces;
  const PairView reactions(equilibrium.reactions, equilibrium.directions);
  for (std::size_t i = 0; i < reactions.pairs(); ++i)
  {
    if (!equilibrium.closed[i]) continue;
    const double force = reactions.normal(i);
    forces.least = forces.closed > 0 ? std::min(forces.least, force) : force;
    forces.greatest = forces.closed > 0 ? std::max(forces.greatest, force) : force;
    forces.sum += force;
    ++forces.closed;
  }
  return forces;
}

StepBias transient_bias(const Report& report)
{
  if (report.point.modes.modes.empty()) return {};
  return bias_of(report.point.modes.modes.front().lambda, report.transient.predicted);
}

StepBias cycle_bias(const Report& report)
{
  if (report.point.modes.modes.empty() || !(report.motion.cycle.orbit.period > 0)) return {};
  const double h = report.motion.cycle.orbit.period / report.motion.cycle.steps_per_period;
  const std::complex<double> lambda = report.point.modes.modes[report.motion.followed.index].lambda;
  return bias_of(lambda, discrete_eigenvalue(lambda, report.motion.cycle.theta, h));
}

std::string number_text(const Scene& scene, const std::string& key)
{
  const std::string unit = unit_of_number(scene, key);
  return label_of_number(scene, key) + (unit == "-" ? "" : " [" + unit + "]");
}

double chatter(const History& history)
{
  const std::vector<double>& force = history.normal_force;
  double squares = 0, sum = 0;
  for (std::size_t i = 1; i + 1 < force.size(); ++i)
  {
    const double bend = force[i - 1] - 2 * force[i] + force[i + 1];
    squares += bend * bend;
    sum += force[i];
  }
  return sum > 0 ? std::sqrt(squares * static_cast<double>(force.size() - 2)) / 4 / sum : 0;
}

} // namespace squeal
