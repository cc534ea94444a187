#include "fitting.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

/// Of the step size, from the orbit at twice as many steps; as if of order 1, which impacts can make it. False without
/// such an orbit.
bool judge_steps(Fitting& fitting, const ReducedOrbit& orbit, const ReducedState& shift)
{
  const ReducedOrbit fine = shoot_reduced(fitting, orbit.state, shift, orbit.period, 2 * fitting.steps, 0);
  Fidelity& fidelity = fitting.result.fidelity;
  const bool good = fine.cycle.outcome.word == "converged";
  fidelity.step_frequency_error = good ? 2 * std::abs(fine.period / orbit.period - 1) : std::nan("");
  fidelity.step_energy_error = good ? 2 * std::abs(fine.energy / orbit.energy - 1) : std::nan("");
  return good;
}

double step_error(const Fidelity& fidelity)
{
  return std::max(fidelity.step_frequency_error, fidelity.step_energy_error);
}

/// Steps a period for which the step's errors are half the wish, and its growth rate's (omega h)^2/4 is the wish; as if
/// of the order given.
int steps_for(const Fidelity& fidelity, int steps, int order)
{
  const double measured = 1.1 * steps * std::pow(2 * step_error(fidelity) / fidelity.accuracy, 1. / order);
  const double theory = std::numbers::pi / std::sqrt(fidelity.accuracy);
  return 8 * static_cast<int>(std::ceil(std::max(measured, theory) / 8));
}

/// The candidate at as many steps a period as the wish needs; says what is in the way.
std::string refine_steps(Fitting& fitting, Correction correction, int order)
{
  const int steps = std::max(fitting.steps, steps_for(fitting.result.fidelity, fitting.steps, order));
  const ReducedOrbit fine =
      shoot_reduced(fitting, correction.orbit.state, correction.shift, correction.orbit.period, steps, 0);
  if (fine.cycle.outcome.word != "converged")
    return "the reduced model has no cycle at " + std::to_string(steps) + " steps a period";
  fitting.energy_move = fitting.frequency_move = 1; // nothing is known yet at this many
  fitting.candidate = std::move(correction.to);
  fitting.candidate.period = fine.period;
  add_motion(fitting.reduced.model, 1, fine.state.q - correction.orbit.state.q, displacement(fitting.candidate.state));
  add_motion(fitting.reduced.model, 1, fine.state.v - correction.orbit.state.v, velocity(fitting.candidate.state));
  fitting.steps = steps;
  return {};
}

/// -cycle_start: the full shooting starts from the estimate, or from the reduced model's cycle.
bool starts_reduced()
{
  const std::array<const char*, 2> starts = {"estimate", "reduced"};
  PetscInt start = 0;
  check(PetscOptionsGetEList(nullptr, "cycle_", "-start", starts.data(), 2, &start, nullptr));
  return start == 1;
}

/// The reduced model and its cycle, the first candidate; says what is in the way.
std::string start(Fitting& fitting)
{
  const Full& full = fitting.full;
  const ComplexMode& mode = full.unstable.front();
  if (full.unstable.size() > 1) return "several modes are unstable: only the full model's shooting wakes them all";
  fitting.active = pairs_that_may_change(full.interface, full.equilibrium, mode,
                                         fitting.options.margin * start_amplitude(full.estimate));
  PetscInt dofs = 0;
  check(VecGetSize(full.structure.load, &dofs));
  const std::size_t shapes = std::min(full.modes.size(), static_cast<std::size_t>(fitting.options.modes)) +
                             fitting.active.size() * static_cast<std::size_t>(full.interface.block());
  if (2 * shapes > static_cast<std::size_t>(dofs))
    return "a reduced model of " + std::to_string(shapes) + " shapes is not small next to " + std::to_string(dofs) +
           " degrees of freedom";
  build(fitting);
  const State first = mode_state(full.equilibrium, mode, start_amplitude_factor() * start_amplitude(full.estimate),
                                 full.estimate.phase);
  check(VecAXPY(first.u, -1, full.equilibrium.u));
  const ReducedOrbit orbit =
      shoot_reduced(fitting, coordinates(fitting.reduced.model, full.structure, first.u, first.v), {},
                    1 / mode.frequency_hz(), fitting.steps, static_cast<int>(fitting.options.free_periods));
  if (orbit.cycle.outcome.word != "converged") return "the cycle of the reduced model: " + orbit.cycle.outcome.word;
  fitting.candidate = candidate_of(full, fitting.reduced, orbit);
  return {};
}

void note(Fitting& fitting, std::vector<NewtonRecord>& records)
{
  LimitCycle& cycle = fitting.result.cycle;
  const Fidelity& fidelity = fitting.result.fidelity;
  records.push_back({"full period", 2 * fidelity.size + 1, fidelity.full_periods, cycle.period,
                     std::max(fidelity.frequency_error, fidelity.energy_error), cycle.residual_full});
  cycle.records = records;
  cycle.newton_iterations = static_cast<int>(fidelity.full_periods);
  cycle.periods_integrated = fidelity.full_periods;
  cycle.residual_projected = std::nan("");
  cycle.outcome = {"converged", "", cycle.newton_iterations, cycle.residual_full};
}

/// One full period, or as many as the wish needs; says what is in the way.
std::string fit(Fitting& fitting)
{
  const bool adaptive = fitting.result.fidelity.asked == "auto";
  Fidelity& fidelity = fitting.result.fidelity;
  std::vector<NewtonRecord> records;
  Acceleration acceleration{fitting.full};
  bool rough = adaptive; // the steps are not yet what the wish needs
  for (PetscInt pass = 0; pass < (adaptive ? fitting.options.corrections : 1); ++pass)
  {
    fidelity.steps_per_period = fitting.steps;
    Correction correction = correct(fitting);
    note(fitting, records);
    if (correction.orbit.cycle.outcome.word != "converged")
      return adaptive ? "the corrected cycle of the reduced model: " + correction.orbit.cycle.outcome.word : "";
    const double error = std::max(fidelity.frequency_error, fidelity.energy_error);
    const bool near = error <= (rough ? 4 : .5) * fidelity.accuracy;
    if (!adaptive || near)
    {
      if (!judge_steps(fitting, correction.orbit, correction.shift) && adaptive)
        return "the reduced model has no cycle at twice as many steps a period";
      if (!adaptive || (!rough && step_error(fidelity) <= fidelity.accuracy / 2)) return {};
      const std::string problem = refine_steps(fitting, std::move(correction), rough ? 2 : 1); // 2 was not enough
      if (!problem.empty()) return problem;
      rough = false;
      acceleration.tried.clear();
      continue;
    }
    const std::vector<int> odd = surprises(fitting.full, fitting.active, fitting.result.cycle);
    if (odd.empty() || pass > 1)
    {
      fitting.candidate = next_candidate(acceleration, std::move(fitting.candidate), std::move(correction.to));
      continue;
    }
    fitting.active.insert(fitting.active.end(), odd.begin(), odd.end());
    std::sort(fitting.active.begin(), fitting.active.end());
    fitting.candidate = std::move(correction.to);
    acceleration.tried.clear();
    build(fitting);
  }
  return "the wish was not met in " + std::to_string(fidelity.full_periods) + " periods of the full model";
}

/// The full model's cycle from the reduced one, whose derivative stands for the full one's.
void finish(Fitting& fitting)
{
  const Full& full = fitting.full;
  const Candidate& candidate = fitting.candidate;
  const ReducedState at =
      coordinates(fitting.reduced.model, full.structure, displacement(candidate.state), velocity(candidate.state));
  ReducedMap map = map_of(fitting, fitting.steps);
  const Preconditioner preconditioner = reduced_preconditioner(
      fitting.reduced.model, full.structure, inside_of(map, candidate.period, at, comm_of(full.structure.load)));
  const Owned<Vec> u = copy_of(displacement(candidate.state));
  check(VecAXPY(u, 1, full.equilibrium.u));
  const ShootingStart start{full.equilibrium.u, u, velocity(candidate.state), candidate.period, {}, {}};
  fitting.result.cycle = shoot_at_model(full.structure, full.interface, full.equilibrium, start, preconditioner,
                                        full.settings, 0, full.probes);
}

} // namespace

FittedCycle find_fitted_cycle(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                              const Modes& modes, const Estimate& estimate, const CycleSettings& settings,
                              const std::string& asked, double accuracy, Mat probes)
{
  const auto unstable = static_cast<std::size_t>(std::max(modes.unstable_count, 1));
  const Full full{structure, interface, equilibrium, modes.modes, std::span(modes.modes).first(unstable),
                  estimate,  settings,  probes};
  const bool adaptive = asked == "auto", from_reduced = starts_reduced() && asked == "full";
  Fitting fitting(full);
  fitting.steps = adaptive ? std::min(64, settings.steps_per_period) : settings.steps_per_period;
  fitting.tolerance = from_reduced ? 1e-3 : 1e-3 * accuracy; // a start need not be better
  FittedCycle& result = fitting.result;
  Fidelity& fidelity = result.fidelity;
  fidelity.asked = asked;
  fidelity.accuracy = accuracy;
  if (asked != "full" || from_reduced)
  {
    fidelity.used = from_reduced ? "full" : "reduced";
    fidelity.contact_tolerance = 1e-3 * accuracy;
    fidelity.reason = start(fitting);
    if (fidelity.reason.empty() && from_reduced)
      finish(fitting);
    else if (fidelity.reason.empty())
      fidelity.reason = fit(fitting);
    if (fidelity.reason.empty())
    {
      if (!settings.save_state.empty()) write_state(result.cycle.start, structure, settings.save_state);
      return std::move(result);
    }
  }
  if (asked == "reduced")
  {
    result.cycle.outcome.word = unstable > 1 ? "refused" : "not converged";
    result.cycle.outcome.reason = fidelity.reason;
    return std::move(result);
  }
  fidelity.used = "full";
  const double clock = MPI_Wtime();
  CycleSettings refined = settings;
  refined.steps_per_period = std::max(settings.steps_per_period, fitting.steps);
  result.cycle = find_cycle(structure, interface, equilibrium, full.unstable, estimate, refined, probes);
  fidelity.steps_per_period = refined.steps_per_period;
  fidelity.full_seconds += MPI_Wtime() - clock;
  fidelity.full_periods += result.cycle.periods_integrated;
  return std::move(result);
}

} // namespace squeal
