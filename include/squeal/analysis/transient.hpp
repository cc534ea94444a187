#pragma once
/// Exact-contact transient by the modified theta-method (method, section 4):
///     A v+ = [M - h(1-theta) C - h^2 theta(1-theta) K] v - h K u + h F + h B'r+,   A = M + h theta C + h^2 theta^2 K,
///     0 <= gap + B_n ut + h B_n v+  _|_  r_n+ >= 0,   ut = u + h(1-theta) v,   r_t+ in the Coulomb disc, opposing s+.
#include "squeal/analysis/estimate.hpp"
#include "squeal/contact/condensed.hpp"

#include <functional>

namespace squeal
{

/// Everything that depends on h: factored A and W = h B A^-1 B'. Built once per h.
struct ThetaStep
{
  double h = 0, theta = 0.5;   // [s], [-]
  Owned<Mat> A, P;             // P: the explicit matrix in brackets above
  CondensedOperator condensed; // factor of A, W
  double factor_seconds = 0, condensed_seconds = 0;
};

/// What one step tells: the terms of the energy identity and the contact.
struct StepReport
{
  double energy = 0;                 // [J] v'Mv/2 + u'Ku/2 at the end
  double damping_work = 0;           // [J] h v_theta' C v_theta, >= 0
  double contact_work = 0;           // [J] v_theta' B'(impulses)
  double load_work = 0;              // [J] h v_theta' F
  double energy_defect = 0;          // [J] of the energy identity
  int open = 0, stick = 0, slip = 0; // pairs
  int contact_iterations = 0;
  double contact_residual = 0; // natural map, relative
};

/// Options, prefix -transient_: contact_law (displacement | velocity), contact_solver (gauss_seidel | fixed_point),
/// contact_tolerance, contact_max_it, contact_rho.
ThetaStep make_theta_step(const Structure& structure, const Interface& interface, double h, double theta);

/// One step in place.
StepReport advance(const ThetaStep& step, const Structure& structure, const Interface& interface, State& state);

/// Called after every step (and once before the first, with an empty report).
using Monitor = std::function<void(const State&, const StepReport&)>;

/// History of a run, one entry a step; energies as above.
struct History
{
  std::vector<double> time, energy, fluctuating_energy, damping_power, contact_power, load_power;
  std::vector<int> open, stick, slip;
  std::vector<std::vector<double>> probes; // [probe][step]
};

/// outcome: "completed", "refused" (theta and N make the followed mode look stable), "not converged" (contact).
/// residual: the largest contact residual.
struct Trajectory
{
  Outcome outcome;
  double theta = 0, step_size = 0, periods = 0;
  long steps = 0;
  double growth_rate_fit = 0;       // [1/s] of the fluctuating energy's amplitude before first lift-off; NaN: too short
  double growth_rate_predicted = 0; // [1/s] discrete, of the followed mode
  double energy_defect_max = 0;     // of the energy, largest over the steps
  double seconds_per_step = 0, contact_iterations_mean = 0;
  State end;
  History history;
};

/// ln[(1 + (1-theta) lambda h)/(1 - theta lambda h)]/h
std::complex<double> discrete_eigenvalue(std::complex<double> lambda, double theta, double h);

/// Integrates from `start`; `mode` is the followed mode (null: no growth is fitted).
Trajectory integrate(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                     const ComplexMode* mode, const TransientSettings& settings, State start, Mat probes);

} // namespace squeal
