#include "squeal/transient/step_guards.hpp"

#include "squeal/base/constants.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

std::string mode_refusal(const ComplexMode& mode, double theta, double h)
{
  const double sigma = mode.lambda.real(), omega = std::abs(mode.lambda.imag());
  if (theta == 0.5 || sigma <= 0) return {};
  const double steps = two_pi / (omega * h);
  const double needed = two_pi * std::abs(theta - 0.5) * std::norm(mode.lambda) / (omega * sigma);
  if (steps > needed) return {};
  return format("with theta = %.4g and %.4g steps a period the mode that grows at sigma = %.4g /s would ", theta, steps,
                sigma) +
         (theta > 0.5 ? "look stable: more than 2 pi (theta - 1/2) omega/sigma = "
                      : "owe most of its growth to the step: more than 2 pi (1/2 - theta) omega/sigma = ") +
         format("%.4g steps a period are needed, or theta = 1/2", needed);
}

/// A step size, below h, with one solution a step; 0 if there is none, as where a pair's nodes have no mass.
double step_with_one_solution(const SlidingEquilibrium& sliding, double theta, double h, double fall,
                              const StepOptions& options, double increase)
{
  constexpr int attempts = 8;
  for (int attempt = 0; attempt < attempts; ++attempt)
  {
    h *= 0.9 / fall; // W grows as h at most while h is large
    const ThetaStep step = make_theta_step(sliding.structure, sliding.interface, h, theta, options);
    const double now = increase * fall_of_friction(step, sliding.interface, sliding.equilibrium.reactions);
    if (now < 1) return h;
    if (now >= fall) return 0; // W grows as h falls
    fall = std::max(now, 1.5);
  }
  return 0;
}

} // namespace

std::complex<double> discrete_eigenvalue(std::complex<double> lambda, double theta, double h)
{
  return std::log((1. + (1 - theta) * h * lambda) / (1. - theta * h * lambda)) / h;
}

std::string step_refusal(const ComplexMode* mode, double theta, double h, const StepOptions& options)
{
  return options.refuse && mode ? mode_refusal(*mode, theta, h) : std::string();
}

double fall_of_friction(const ThetaStep& step, const Interface& interface, const std::vector<double>& reactions)
{
  constexpr int passes = 30; // of power iteration
  const PairFriction friction = law_of_step(interface.friction, step.theta);
  if (steepest_fall(friction) == 0 || interface.pairs == 0) return 0;
  std::vector<double> roots(interface.size(), 0.);
  const PairView<double> weights(roots, interface.directions);
  for (std::size_t i = 0; i < weights.pairs(); ++i)
    std::ranges::fill(
        weights.tangential(i),
        std::sqrt(steepest_fall(friction.of(i)) * std::max(0., PairView(reactions, interface.directions).normal(i))));
  double largest = 0; // 0 where W is not
  on_every_rank(comm_of(interface.B), [&] { largest = step.W.largest_eigenvalue(roots, passes); });
  MPI_Bcast(&largest, 1, MPI_DOUBLE, 0, comm_of(interface.B));
  return largest;
}

std::string friction_refusal(const SlidingEquilibrium& sliding, const ComplexMode* mode, double theta, double h,
                             const StepOptions& options, double increase)
{
  if (!options.refuse || steepest_fall(sliding.interface.friction) == 0) return {};
  const ThetaStep step = make_theta_step(sliding.structure, sliding.interface, h, theta, options);
  const double fall = increase * fall_of_friction(step, sliding.interface, sliding.equilibrium.reactions);
  if (fall < 1) return {};
  const std::string reason = format("friction falls so steeply with the speed that a step of %.4g s may have several "
                                    "solutions, |mu'| r_n W_t = %.4g: ",
                                    h, fall);
  const double enough = step_with_one_solution(sliding, theta, h, fall, options, increase);
  if (enough == 0)
    return reason + "no shorter step would do, since contact nodes have too little mass; raise friction.decay_speed";
  if (!mode) return reason + format("a step of %.4g s would do", enough);
  return reason + format("%.0f steps a period would do", std::ceil(two_pi / (std::abs(mode->lambda.imag()) * enough)));
}

} // namespace squeal
