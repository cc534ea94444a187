#include "squeal/studies.hpp"

#include "squeal/base/cost.hpp"
#include "squeal/swept_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace squeal
{

Response run_response(const SlidingPoint& point, const Scene& scene, const ProgramOptions& options)
{
  if (!scene.response) return not_run<Response>(OutcomeKind::off, "the scene has no [response]");
  if (point.equilibrium.outcome.kind != OutcomeKind::converged)
    return not_run<Response>(OutcomeKind::skipped, "there is no equilibrium to linearise about");
  std::vector<int> excitations;
  for (std::size_t i = 0; i < scene.probes.size(); ++i)
    if (scene.response->excitation.empty() || std::ranges::count(scene.response->excitation, scene.probes[i].name) > 0)
      excitations.push_back(static_cast<int>(i));
  return find_response({point.model->structure, *point.linearised, point.modes.modes, point.model->probes, excitations,
                        frequencies_of(*scene.response), options.response, options.modes.pencil});
}

namespace
{

/// Where several modes oscillate and grow, each of which may lead to a motion of its own: the modes, their pairs and
/// five random sums; as many as are integrated together at most. Else none.
int starts_beside(const SlidingPoint& point)
{
  constexpr int random = 5, together = 16;
  const auto oscillates = [](const ComplexMode& mode) { return mode.frequency_hz() > 0; };
  const int unstable = point.modes.unstable_count;
  if (std::ranges::count_if(point.modes.unstable(), oscillates) < 2) return 0;
  return std::min(unstable * (unstable + 1) / 2 + random, together);
}

/// Whether so many trajectories of the model and a small one cost little.
bool are_affordable(const SlidingPoint& point, int starts)
{
  constexpr double steps = 400 * 256; // of periods each, steps a period
  return (starts + 1) * steps * work_of_step(point.model->structure) <= affordable_work;
}

} // namespace

Attractors run_attractors(const SlidingPoint& point, const Motion& motion, const Scene& scene,
                          const ProgramOptions& options)
{
  constexpr int enough = 256; // steps a period to recognise a cycle of more steps by
  CycleSettings settings = scene.cycle;
  if (settings.steps_per_period == 0)
    settings.steps_per_period = std::clamp(motion.cycle.steps_per_period, first_steps, enough);
  const std::vector<ComplexMode>& modes = point.modes.modes;
  const bool chosen = settings.starts == 0;
  if (chosen) settings.starts = starts_beside(point);
  if (!settings.enabled || (chosen && (point.modes.unstable_count == 0 || !are_affordable(point, settings.starts))))
    return not_run<Attractors>(OutcomeKind::off, "cycle.starts is 0, and no other starts are sought by themselves");
  const auto attractors = [&](const UnstableModes& started)
  {
    Attractors found = find_attractors({point.sliding(), modes, started, settings, options.step, chosen});
    if (chosen && found.outcome.kind == OutcomeKind::not_converged) found.outcome.kind = OutcomeKind::completed;
    if (chosen && found.outcome.kind == OutcomeKind::refused) found.outcome.kind = OutcomeKind::skipped;
    return found;
  };
  if (modes.empty() || point.modes.unstable_count > 0 || point.model->interface.pairs == 0)
  {
    const std::string reason = no_unstable_mode(point);
    return reason.empty() ? attractors({point.modes.unstable(), point.estimates})
                          : not_run<Attractors>(OutcomeKind::skipped, reason);
  }
  // a motion may go on beside a stable equilibrium: from the mode that decays slowest, or that a given start has most
  // of, and from random sums of modes
  const std::size_t followed = motion.followed.index;
  const Estimate estimate = estimate_amplitude(point.sliding(), *point.linearised, modes[followed]);
  if (!std::isfinite(estimate.start_amplitude))
    return not_run<Attractors>(OutcomeKind::skipped, "no amplitude is known at which contact opens or slip reverses");
  return attractors({std::span(modes).subspan(followed, 1), std::span(&estimate, 1)});
}

BrakeBranch run_branch(const SlidingPoint& point, const Motion& motion, const Scene& scene,
                       const ProgramOptions& options)
{
  if (!scene.branch) return not_run<BrakeBranch>(OutcomeKind::off, "the scene has no [branch]");
  const double tolerance = scene.cycle.tolerance > 0 ? scene.cycle.tolerance : plain_tolerance;
  const std::string reason = no_cycle_to_follow(motion.cycle, tolerance);
  if (!reason.empty()) return not_run<BrakeBranch>(OutcomeKind::skipped, reason);
  NearbyModels models(*point.model, scene, comm_of(point.model->structure.load));
  const auto model_at = [&](double parameter) {
    return models.at(std::array{SceneNumber{scene.branch->key, parameter}});
  };
  return find_branch({*scene.branch, model_at, point.sliding(), motion.cycle, point.modes.modes,
                      point.modes.modes[motion.followed.index], scene.fidelity,
                      steps_along_branch(scene.cycle, motion.cycle), tolerance, point.model->probes, scene.modes,
                      options.modes, options.equilibrium, options.step, options.cycle.shooting});
}

Sensitivity run_sensitivity(const SlidingPoint& point, const Scene& scene, const ProgramOptions& options)
{
  if (!scene.sensitivity) return not_run<Sensitivity>(OutcomeKind::off, "the scene has no [sensitivity]");
  const std::string reason = no_unstable_mode(point);
  if (!reason.empty()) return not_run<Sensitivity>(OutcomeKind::skipped, reason);
  if (point.model->structure.H.get())
    return not_run<Sensitivity>(OutcomeKind::refused, "the structure has a circulatory part");
  NearbyModels models(*point.model, scene, comm_of(point.model->structure.load));
  const auto model_at = [&](std::span<const SceneNumber> numbers)
  {
    std::vector<SceneNumber> all;
    for (const SceneNumber& number : numbers) std::ranges::copy(from_zero(scene, number), std::back_inserter(all));
    return models.at(all);
  };
  std::vector<int> probes;
  for (const Change& change : scene.changes)
    probes.push_back(
        static_cast<int>(std::ranges::find(scene.probes, change.probe, &Probe::name) - scene.probes.begin()));
  return find_sensitivity({point.sliding(), *point.linearised, point.modes, sensitive_numbers(scene),
                           components_of(scene), contact_names(scene), model_at, point.model->probes, scene.changes,
                           probes, scene.modes, options.modes, options.equilibrium});
}

Sweep run_scene_sweep(const Model& model, const Scene& scene, const ProgramOptions& options)
{
  if (!scene.sweep) return not_run<Sweep>(OutcomeKind::off, "the scene has no [sweep]");
  if (model.structure.H.get() && scene.sweep->directions == SweepDirections::both)
    return not_run<Sweep>(OutcomeKind::refused, "what the circulatory part of given matrices becomes in the other "
                                                "direction of rotation is not known, as another code's friction is "
                                                "in the symmetric part of K as well: sweep one direction, and the "
                                                "other one with matrices of its own");
  std::optional<NearbyModels> models; // of the group of ranks that this one is in
  const auto models_on = [&](MPI_Comm comm) -> NearbyModels&
  { return models && models->comm() == comm ? *models : models.emplace(model, scene, comm); };
  const auto model_at = [&](std::span<const double> values, MPI_Comm comm)
  { return models_on(comm).at(numbers_of(scene.sweep->key, values)); };
  const auto motion_at = [&](const SweptPlace& place, MPI_Comm comm)
  { return find_swept_motion(models_on(comm), scene, options, place); };
  return run_sweep({*scene.sweep, model_at, motion_at, scene.modes, options.modes, options.equilibrium, options.sweep},
                   comm_of(model.structure.load));
}

Robustness run_robustness(const Model& model, const Scene& scene, const ProgramOptions& options)
{
  if (!scene.robustness) return not_run<Robustness>(OutcomeKind::off, "the scene has no [robustness]");
  NearbyModels models(model, scene, PETSC_COMM_SELF);
  std::vector<std::string> keys;
  for (const UncertainNumber& number : scene.uncertain) keys.push_back(number.key);
  const auto model_at = [&](std::span<const double> values, MPI_Comm) { return models.at(numbers_of(keys, values)); };
  return find_robustness(
      {*scene.robustness, scene.uncertain, model_at, scene.modes, options.modes, options.equilibrium},
      comm_of(model.structure.load));
}

} // namespace squeal
