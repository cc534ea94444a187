#include "squeal/find_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace squeal
{

Response run_response(const SlidingPoint& point, const Scene& scene, const ProgramOptions& options)
{
  if (point.equilibrium.outcome.kind != OutcomeKind::converged)
    return not_run<Response>(OutcomeKind::skipped, "there is no equilibrium to linearise about");
  std::vector<int> excitations;
  for (std::size_t i = 0; i < scene.probes.size(); ++i)
    if (scene.response->excitation.empty() || std::ranges::count(scene.response->excitation, scene.probes[i].name) > 0)
      excitations.push_back(static_cast<int>(i));
  return find_response({point.sliding(), point.model->probes, excitations, frequencies_of(*scene.response),
                        options.response, options.modes});
}

Attractors run_attractors(const SlidingPoint& point, const Motion& motion, const Scene& scene,
                          const ProgramOptions& options)
{
  constexpr int enough = 256; // steps a period to recognise a cycle of more steps by
  CycleSettings settings = scene.cycle;
  const bool open = settings.steps_per_period == 0;
  if (open) settings.steps_per_period = std::clamp(motion.cycle.steps_per_period, first_steps, enough);
  const std::vector<ComplexMode>& modes = point.modes.modes;
  const bool chosen = settings.starts == 0;
  settings.starts = starts_sought(point, scene).value_or(0);
  const auto attractors = [&](const UnstableModes& started)
  {
    const ComplexMode& mode = started.modes.front();
    const auto refused = [&](int steps)
    {
      const double h = 1 / (mode.frequency_hz() * steps);
      return !friction_refusal(point.sliding(), &mode, settings.theta, h, options.step, 1).empty();
    };
    if (open) settings.steps_per_period = permitted_steps(settings.steps_per_period, refused);
    Attractors found = find_attractors(
        {point.sliding(), modes, started, settings, options.step, chosen && point.modes.unstable_count > 0});
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

namespace
{

/// The stability of sliding at the scene's own value and at others spread evenly over the range of its branch.
SlidingStability stability_beside_branch(NearbyModels& models, const Scene& scene, const ProgramOptions& options)
{
  constexpr int intervals = 10;
  const BranchSettings& branch = *scene.branch;
  std::set<double> values = {branch.own};
  for (int i = 0; i <= intervals; ++i) values.insert(branch.from + i * (branch.to - branch.from) / intervals);
  SweepSettings settings;
  settings.key = {branch.key};
  settings.values.assign(values.begin(), values.end());
  settings.directions = SweepDirections::one;
  const auto model_at = [&](std::span<const double> value) { return models.at(numbers_of(settings.key, value)); };
  const Sweep sweep = run_sweep({settings, model_at, scene.modes, options.modes, options.equilibrium}, models.comm());
  if (sweep.outcome.kind == OutcomeKind::interrupted) throw Interrupted{};
  SlidingStability stability;
  for (const SweepPoint& point : sweep.points)
  {
    if (point.inserted) continue;
    EquilibriumStability& at = stability.equilibria.emplace_back(point.values[0]);
    at.known = point.outcome.kind == OutcomeKind::converged;
    at.unstable_modes = point.unstable;
    const auto least_stable = std::ranges::find_if(point.modes, [](const SweptMode& m) { return m.lambda.imag() > 0; });
    if (least_stable == point.modes.end()) continue;
    at.growth_rate = least_stable->lambda.real();
    at.frequency_hz = frequency_hz_of(least_stable->lambda);
  }
  for (const Threshold& at : sweep.thresholds)
    if (at.frequency_hz > 0)
      stability.hopf.push_back({BranchEventKind::hopf, at.values[0], at.error, 1 / at.frequency_hz, 0, at.change});
  return stability;
}

} // namespace

BrakeBranch run_branch(const SlidingPoint& point, const Motion& motion, const Scene& scene,
                       const ProgramOptions& options)
{
  const double tolerance = scene.cycle.tolerance > 0 ? scene.cycle.tolerance : plain_tolerance;
  const std::string reason = no_cycle_to_follow(motion.cycle, tolerance);
  if (!reason.empty()) return not_run<BrakeBranch>(OutcomeKind::skipped, reason);
  NearbyModels models(*point.model, scene);
  const auto model_at = [&](double parameter) {
    return models.at(std::array{SceneNumber{scene.branch->key, parameter}});
  };
  const std::size_t followed = motion.followed.index;
  const CycleProblem own{
      point.sliding(), *point.linearised, point.modes.modes, {std::span(point.modes.modes).subspan(followed, 1), {}},
      scene.cycle,     options.step,      options.modes,     point.model->probes};
  return find_branch({*scene.branch, model_at, own, stability_beside_branch(models, scene, options), motion.cycle,
                      steps_along_branch(scene.cycle, motion.cycle), tolerance, options.equilibrium,
                      options.cycle.shooting});
}

Sensitivity run_sensitivity(const SlidingPoint& point, const Scene& scene, const ProgramOptions& options)
{
  const std::string reason = no_unstable_mode(point);
  if (!reason.empty()) return not_run<Sensitivity>(OutcomeKind::skipped, reason);
  if (point.model->structure.H.get())
    return not_run<Sensitivity>(OutcomeKind::refused, "the structure has a circulatory part");
  NearbyModels models(*point.model, scene);
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
  if (model.structure.H.get() && scene.sweep->directions == SweepDirections::both)
    return not_run<Sweep>(OutcomeKind::refused, "what the circulatory part of given matrices becomes in the other "
                                                "direction of rotation is not known, as another code's friction is "
                                                "in the symmetric part of K as well: sweep one direction, and the "
                                                "other one with matrices of its own");
  NearbyModels models(model, scene);
  const auto model_at = [&](std::span<const double> values) { return models.at(numbers_of(scene.sweep->key, values)); };
  return run_sweep({*scene.sweep, model_at, scene.modes, options.modes, options.equilibrium}, models.comm());
}

Robustness run_robustness(const Model& model, const Scene& scene, const ProgramOptions& options)
{
  SweepSettings points;
  for (const UncertainNumber& number : scene.uncertain) points.key.push_back(number.key);
  NearbyModels models(model, scene);
  const auto model_at = [&](std::span<const double> values) { return models.at(numbers_of(points.key, values)); };
  return find_robustness(*scene.robustness, scene.uncertain,
                         {points, model_at, scene.modes, options.modes, options.equilibrium, "robustness"},
                         models.comm());
}

} // namespace squeal
