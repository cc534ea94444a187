#include "squeal/find_motion.hpp"

#include "squeal/base/cost.hpp"

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
  constexpr int enough = 256, most = 1024; // steps a period to recognise a cycle of more steps by; where they are few
  CycleSettings settings = scene.cycle;
  const bool open = settings.steps_per_period == 0;
  const double of_starts = 400. * (starts_sought(point, scene).value_or(0) + 1), // periods
      cheap_steps = std::min(1e6, affordable_work / work_of_step(point.model->structure)) / of_starts;
  const int cheap = std::clamp(static_cast<int>(cheap_steps), enough, most);
  if (open) settings.steps_per_period = std::clamp(motion.cycle.steps_per_period, first_steps, cheap);
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
  // A motion may go on beside a stable equilibrium. Starts are the mode that decays slowest, or that a given start has
  // most of, and random sums of modes.
  const std::size_t followed = motion.followed.index;
  const Estimate estimate = estimate_amplitude(point.sliding(), *point.linearised, modes[followed]);
  if (!std::isfinite(estimate.start_amplitude))
    return not_run<Attractors>(OutcomeKind::skipped, "no amplitude is known at which contact opens or slip reverses");
  return attractors({std::span(modes).subspan(followed, 1), std::span(&estimate, 1)});
}

namespace
{

/// The sweep of these points, on models near the scene's own.
SweepProblem sweep_problem(NearbyModels& models, SweepSettings settings, const Scene& scene,
                           const ProgramOptions& options, const char* name)
{
  const auto model_at = [&models, key = settings.key](std::span<const double> values)
  { return models.at(numbers_of(key, values)); };
  return {std::move(settings), model_at, scene.modes, options.modes, options.equilibrium, name};
}

/// The stability of sliding at the scene's own value and at others spread evenly over the range of its branch.
Sweep sliding_beside_branch(NearbyModels& models, const Scene& scene, const ProgramOptions& options)
{
  constexpr int intervals = 10;
  const BranchSettings& branch = *scene.branch;
  std::set<double> values = {branch.own};
  for (int i = 0; i <= intervals; ++i) values.insert(branch.from + i * (branch.to - branch.from) / intervals);
  SweepSettings settings;
  settings.key = {branch.key};
  settings.values.assign(values.begin(), values.end());
  settings.directions = SweepDirections::one;
  Sweep sweep = run_sweep(sweep_problem(models, settings, scene, options, "sweep"), models.comm());
  if (sweep.outcome.kind == OutcomeKind::interrupted) throw Interrupted{};
  std::erase_if(sweep.points, [](const SweepPoint& point) { return point.inserted; });
  return sweep;
}

/// Where modes of sliding become unstable or stable.
std::vector<BranchEvent> hopf_points(const Sweep& sliding)
{
  std::vector<BranchEvent> points;
  for (const Threshold& at : sliding.thresholds)
    if (at.frequency_hz > 0)
      points.push_back({BranchEventKind::hopf, at.values[0], at.error, 1 / at.frequency_hz, 0, at.change});
  return points;
}

} // namespace

BranchStudy run_branch(const SlidingPoint& point, const Motion& motion, const Scene& scene,
                       const ProgramOptions& options)
{
  const double tolerance = scene.cycle.tolerance > 0 ? scene.cycle.tolerance : plain_tolerance;
  const std::string reason = no_cycle_to_follow(motion.cycle, tolerance);
  if (!reason.empty()) return not_run<BranchStudy>(OutcomeKind::skipped, reason);
  NearbyModels models(*point.model, scene);
  const auto model_at = [&](double parameter) {
    return models.at(std::array{SceneNumber{scene.branch->key, parameter}});
  };
  const std::size_t followed = motion.followed.index;
  const CycleProblem own{
      point.sliding(), *point.linearised, point.modes.modes, {std::span(point.modes.modes).subspan(followed, 1), {}},
      scene.cycle,     options.step,      options.modes,     point.model->probes};
  Sweep beside = sliding_beside_branch(models, scene, options);
  BranchStudy study{
      find_branch({*scene.branch, model_at, own, motion.cycle, steps_along_branch(scene.cycle, motion.cycle), tolerance,
                   options.equilibrium, options.cycle.shooting}),
      std::move(beside)};
  const std::vector<BranchEvent> hopf = hopf_points(study.beside);
  study.branch.events.insert(study.branch.events.begin(), hopf.begin(), hopf.end());
  return study;
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
  return run_sweep(sweep_problem(models, *scene.sweep, scene, options, "sweep"), models.comm());
}

Robustness run_robustness(const Model& model, const Scene& scene, const ProgramOptions& options)
{
  SweepSettings points;
  for (const UncertainNumber& number : scene.uncertain) points.key.push_back(number.key);
  NearbyModels models(model, scene);
  return find_robustness(*scene.robustness, scene.uncertain,
                         sweep_problem(models, points, scene, options, "robustness"), models.comm());
}

} // namespace squeal
