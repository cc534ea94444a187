#include "squeal/swept_motion.hpp"

#include "squeal/base/run_control.hpp"
#include "squeal/report/heard.hpp"
#include "squeal/study/reversed.hpp"

#include <cmath>

namespace squeal
{

namespace
{

/// The scene at a point, up to what is heard.
Scene scene_at(const Scene& scene, const std::vector<double>& values)
{
  Scene at = scene_with(scene, numbers_of(scene.sweep->key, values));
  at.cycle.enabled = true;
  at.cycle.starts = 0;
  at.cycle.save_state.clear();
  at.transient.enabled = at.transient.enabled && at.cycle.start.kind == CycleStartKind::transient;
  at.transient.save_state.clear();
  at.branch.reset();
  return at;
}

/// Runs the stages to the settled motion, each of which says why it does not run.
void run_stages(Chain& chain)
{
  const auto& [structure, interface] = std::tie(chain.model.structure, chain.model.interface);
  Report& report = chain.report;
  const MPI_Comm comm = comm_of(structure.load);
  report.equilibrium = find_equilibrium(structure, interface, chain.options.equilibrium);
  report.modes = run_modes(chain);
  report.estimates = run_estimates(chain);
  report.transient = run_transient(chain);
  if (report.transient.outcome.kind == OutcomeKind::interrupted) throw Interrupted{};
  std::optional<CoarseModel> coarse;
  if (chain.scene.cycle.start.kind == CycleStartKind::coarse)
  {
    coarse.emplace(chain.scene, chain.model, comm);
    chain.coarse = &*coarse;
    report.coarse = run_coarse(chain);
  }
  if (chain.scene.cycle.start.kind == CycleStartKind::file)
    chain.cycle_file = read_state(chain.scene.cycle.start.file, structure);
  seek_motion(chain, [](Stage, const auto& work) { return work(); });
  if (report.cycle.cut_short) throw Interrupted{};
}

/// What is kept of a cycle that was found.
void take_cycle(const LimitCycle& cycle, SweptMotion& motion)
{
  motion.frequency_hz = 1 / cycle.orbit.period;
  motion.energy = {cycle.measured.mean_fluctuating_energy, SweptMotion::none};
  motion.peak_to_peak = cycle.measured.peak_to_peak;
  motion.stability = cycle.multipliers.stability;
  motion.residual = cycle.orbit.residual;
  if (motion.stability == Stability::stable) motion.kind = MotionKind::periodic;
  if (cycle.multipliers.values.empty()) return;
  motion.multiplier = std::abs(cycle.multipliers.values.front());
  motion.multiplier_error = cycle.multipliers.errors.front();
}

void take_settled(const SettledMotion& settled, SweptMotion& motion)
{
  motion.kind = settled.examined.verdict.kind;
  motion.frequency_hz = settled.examined.base.first;
  motion.energy = settled.fluctuating_energy;
  motion.energy.error += settled.step_error;
  motion.peak_to_peak.clear();
  for (const MeanValue& swing : settled.peak_to_peak) motion.peak_to_peak.push_back(swing.value);
}

SweptMotion motion_of(const Report& report, const Scene& scene)
{
  const LimitCycle& cycle = report.cycle;
  SweptMotion motion;
  motion.heard = heard(report, scene);
  motion.outcome =
      report.equilibrium.outcome.kind == OutcomeKind::converged ? cycle.outcome : report.equilibrium.outcome;
  motion.steps_per_period = cycle.steps_per_period;
  motion.periods = cycle.convergence.periods + static_cast<long>(report.settled.examined.periods());
  if (const Estimate& estimate = followed_estimate(report); estimate.outcome.kind == OutcomeKind::balance)
    motion.estimate = estimate.amplitude;
  const bool settled = has_run(report.settled.outcome);
  const bool found = cycle.outcome.kind == OutcomeKind::converged || !cycle.multipliers.values.empty();
  if (has_run(cycle.outcome) && found) take_cycle(cycle, motion);
  if (settled) take_settled(report.settled, motion);
  return motion;
}

} // namespace

SweptMotion find_swept_motion(const Chain& chain, const SweptPlace& place, NearbyModels& models)
{
  const Scene scene = scene_at(chain.scene, place.values);
  Model model = models.whole_at(numbers_of(chain.scene.sweep->key, place.values));
  if (place.reversed) reverse_rotation(model.structure, model.interface);
  Report report;
  Chain at{scene, chain.options, model, report, {}};
  run_stages(at);
  return motion_of(report, scene);
}

} // namespace squeal
