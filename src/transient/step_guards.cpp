#include "squeal/transient/step_guards.hpp"

#include "squeal/transient/theta_step.hpp"

#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

constexpr double two_pi = 2 * std::numbers::pi;

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

/// One step of the free structure in place: A v+ = [M v - (1-theta) A v]/theta - h K u, u+ = u + h v_theta.
struct FreeStep
{
  const Structure& structure;
  double theta, h;
  Owned<Mat> A;
  Factor factor;
  Owned<Vec> u, v, next, rhs, image;

  void advance()
  {
    check(MatMult(structure.M, v, rhs));
    check(MatMult(A, v, image));
    check(VecAXPBY(rhs, (theta - 1) / theta, 1 / theta, image));
    check(MatMult(structure.K, u, image));
    check(VecAXPY(rhs, -h, image));
    solve(factor, rhs, next);
    check(VecAXPY(u, h * (1 - theta), v));
    check(VecAXPY(u, h * theta, next));
    std::swap(v, next);
  }

  /// Scales the state to energy 1 and returns the logarithm of its energy before.
  double normalise()
  {
    const double energy = kinetic_energy(structure, v) + potential_energy(structure, u);
    if (!(energy > 0)) return 0;
    check(VecScale(u, 1 / std::sqrt(energy)));
    check(VecScale(v, 1 / std::sqrt(energy)));
    return std::log(energy);
  }
};

} // namespace

std::complex<double> discrete_eigenvalue(std::complex<double> lambda, double theta, double h)
{
  return std::log((1. + (1 - theta) * h * lambda) / (1. - theta * h * lambda)) / h;
}

double free_growth(const Structure& structure, double theta, double h, const FactorOptions& options)
{
  FreeStep step{structure, theta, h, {}, {}, {}, {}, {}, {}, {}};
  step.A = step_matrix(structure, h, theta);
  step.factor = Factor(step.A, nullptr, options);
  for (Owned<Vec>* x : {&step.u, &step.v, &step.next, &step.rhs, &step.image}) *x = zeros_like(structure.load);
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(step.u, &first, &last));
  for (PetscInt i = first; i < last; ++i) // no mode is orthogonal to it
    check(VecSetValue(step.u, i, std::sin(1 + 12.9898 * static_cast<double>(i)), INSERT_VALUES));
  check(VecAssemblyBegin(step.u));
  check(VecAssemblyEnd(step.u));

  // The slope of the energy's logarithm: its ripple within a period would spoil a quotient of two energies.
  constexpr int settling = 100, observed = 200;
  double grown = 0, slope = 0;
  for (int i = 0; i < settling + observed; ++i)
  {
    step.advance();
    grown += step.normalise();
    if (i >= settling) slope += grown * (i - settling - (observed - 1) / 2.);
  }
  return slope / (observed * (observed * observed - 1.) / 12) / 2;
}

std::string step_refusal(const Structure& structure, const ComplexMode* mode, double theta, double h,
                         const StepOptions& options)
{
  if (!options.refuse) return {};
  if (mode)
    if (const std::string reason = mode_refusal(*mode, theta, h); !reason.empty()) return reason;
  if (theta >= 0.5) return {};
  const double growth = free_growth(structure, theta, h, options.factor);
  constexpr double negligible = 2e-6; // less than what the fit sees, and no harm in 100 000 steps
  if (growth <= negligible) return {};
  return format("with theta = %.4g a step of %.4g s multiplies free vibrations by exp(%.4g), more than damping takes: "
                "theta = 1/2 needs no damping, theta below it a shorter step",
                theta, h, growth);
}

} // namespace squeal
