#pragma once
/// The limit cycle by shooting (src/README.md, section 6): Phi_T(x0) = x0 for the period T and the initial state x0 =
/// (u, v).
///
/// The solver sees a flow only, so that any model with a period map can be shot at: the brake's exact-contact theta
/// step, or a smooth oscillator in a test. States are compared in the energy norm sqrt(u'K u + v'M v) only.
#include "squeal/transient/transient.hpp"

#include <limits>
#include <span>

namespace squeal
{

/// Flow of an autonomous system over one period. States are VecNest (u, v).
struct Flow
{
  /// end = Phi_period(start); unless `rate` is null, rate = dPhi/dperiod at the end.
  std::function<void(double period, Vec start, Vec end, Vec rate)> integrate;
  Mat M = nullptr, K = nullptr; // of the energy norm
  /// end_k = Phi_period(start_k), all at once; empty: one after the other.
  std::function<void(double period, std::span<const Vec> starts, std::span<const Vec> ends)> integrate_many{};
};

struct NewtonRecord
{
  std::string stage; // "free", "reduced", "grown base", "multisecant", "newton-krylov"
  int unknowns = 0;
  long periods = 0;  // integrated so far
  double period = 0; // [s]
  double residual_projected = 0, residual_full = 0;
};

/// outcome: "converged", "collapsed to equilibrium", "not converged", "not periodic" (T left [T0/2, 2 T0], or several
/// modes are unstable and every cycle found repels), "unstable cycle" (it repels: no vibration settles there),
/// "skipped". residual: the full-space one, |Phi_T(x0) - x0| / |x0 - equilibrium| in the energy norm.
struct LimitCycle
{
  Outcome outcome;
  double period = 0; // [s]
  int steps_per_period = 0;
  double theta = 0.5;
  double residual_projected = 0; // of the reduced (grown) system when it was left; NaN if it was not tried
  double residual_full = 0;
  int newton_iterations = 0;
  long periods_integrated = 0; // every evaluation of the flow, differences and the last period included
  State start;
  std::vector<NewtonRecord> records;
  // over the last period
  double mean_energy = 0, mean_fluctuating_energy = 0; // [J]
  double open_pairs_mean = 0;
  int open_pairs_max = 0, stick_pairs_max = 0;
  std::vector<double> peak_to_peak;                 // per probe [m]
  History history;                                  // of one period
  std::vector<Owned<Vec>> displacements;            // samples of u over the period, for fields.h5
  std::vector<std::vector<ContactStatus>> statuses; // [step][pair]
  // Floquet multipliers but the one of a shift in time, largest first; empty when they were not asked for
  std::vector<std::complex<double>> multipliers;
  std::string stability;       // "stable", "unstable", "undecided", or "" without multipliers
  double trivial_error = 0;    // distance of the shift's own multiplier from 1: the error bar of the verdict
  long multiplier_periods = 0; // integrated for them, not in periods_integrated
  double factor_seconds = 0, condensed_seconds = 0; // of the last ThetaStep
};

/// Where shooting starts, and what its reduced space is made of.
struct ShootingStart
{
  Vec equilibrium = nullptr; // u0 [m]
  Vec u = nullptr, v = nullptr;
  double period = 0;       // [s]
  std::vector<Vec> shapes; // the paper's phi_r, phi_i, phi_e: of the displacements and of the velocities alike; or none
  std::vector<Owned<Vec>> asleep{}; // motions (u, v) of the other unstable modes, which a cycle may leave out
  double first_event = std::numeric_limits<double>::infinity(); // energy norm at which lift-off or reversal begins
};

/// y = P^-1 x, an approximate inverse of dPhi_T/dx - I at this period; states are nests. Empty: P = -I.
using Preconditioner = std::function<void(double period, Vec x, Vec y)>;

/// From sliding motion about equilibrium on the frictionless bilateral real modes (src/README.md, section 6).
Preconditioner sliding_preconditioner(const Structure& structure, const Interface& interface,
                                      const Equilibrium& equilibrium, const RealModes& modes, int steps, double theta);

/// Free periods, the reduced system, the growing base and the full-space finish, on any flow; fills everything of the
/// cycle but what is measured on the brake's last period.
///
/// Options, prefix -cycle_: those of the reduced SNES (-cycle_snes_..., dense, at most seven unknowns and what the base
/// grows by); those of the fallback, -cycle_full_snes_..., -cycle_full_ksp_...; and base_growths, finish (multisecant |
/// newton_krylov | none), difference, rank_tolerance, history, drop, clamp, stall, max_periods, multipliers.
LimitCycle shoot(const Flow& flow, const ShootingStart& start, const Preconditioner& preconditioner, double tolerance,
                 int free_periods);

/// The brake's period map in `steps` theta steps. Keeps A and W of the last period: one factoring per period length,
/// none for difference columns. The derivative in the period is (x_(N+1) - x_(N-1))/2h, exact for theta = 1/2 and a
/// linear structure, stiff modes included.
struct PeriodMap
{
  const Structure& structure;
  const Interface& interface;
  int steps = 0;
  double theta = 0.5;
  ThetaStep step{};
  std::vector<double> reactions{}; // warm start: at the end of the last period integrated with its rate
  long unconverged = 0;            // steps whose contact did not converge
  double contact_tolerance = 0;    // 0: the option's
};

/// A and W for this period, unless they are those already.
void set_period(PeriodMap& map, double period);

/// Borrows the map.
Flow flow_of(PeriodMap& map);

/// Fills what is measured over a period from the cycle's start, recorded; `samples` displacements are kept. Returns the
/// period's end; `rate`: as the flow's, or null.
State measure(PeriodMap& map, const Equilibrium& equilibrium, Mat probes, int samples, Vec rate, LimitCycle& cycle);

/// -cycle_start_amplitude
double start_amplitude_factor();

/// The shooting's cycle of the model from any start, with what is measured over one more period of it.
LimitCycle shoot_at_model(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                          const ShootingStart& start, const Preconditioner& preconditioner,
                          const CycleSettings& settings, int free_periods, Mat probes);

/// From the energy estimate of the first of the unstable modes, which the cycle follows, and those of the others on
/// top: none may be left asleep. Options: -cycle_start_amplitude, -cycle_start_period (multiples of the estimate's, 1),
/// -cycle_start_phase (degrees from the estimate's, 0); -cycle_band_factor (3), the preconditioner's real modes reach
/// this many times the mode's frequency; -cycle_samples (32), displacements kept over the last period.
LimitCycle find_cycle(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                      std::span<const ComplexMode> unstable, const Estimate& estimate, const CycleSettings& settings,
                      Mat probes);

} // namespace squeal
