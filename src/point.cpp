#include "squeal/point.hpp"

#include "squeal/base/cost.hpp"
#include "squeal/mesh/mesh.hpp"
#include "squeal/modes/modes.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

bool starts_without_a_mode(const TransientSettings& settings)
{
  return settings.start.kind != StartKind::mode && settings.start.kind != StartKind::estimate;
}

/// From a state file or from rest for a given number of steps, the transient needs no mode.
bool follows_a_mode(const TransientSettings& settings)
{
  return settings.enabled && (!starts_without_a_mode(settings) || settings.steps == 0);
}

/// Sets the motions of one entry. On rank 0, which has the mesh.
void set_initial_motion(const Model& model, const InitialMotion& initial, const State& state)
{
  for (const int node : named_nodes(model.mesh, initial.on, "initial"))
    for (int c = 0; c < 3; ++c)
    {
      const double u = initial.displacement[c], v = initial.velocity[c];
      if (u == 0 && v == 0) continue;
      const std::span<const DofTerm> terms = model.dofs.terms_of(6 * PetscInt{node} + c);
      if (terms.size() != 1 || terms[0].factor != 1)
        throw Error("initial on " + initial.on + ": its motion " + motion_words[static_cast<std::size_t>(c)] +
                    (terms.empty() ? " is held: give it no displacement and velocity there"
                                   : " follows other nodes: name the group, point or body that these are of"));
      check(VecSetValue(state.u, terms[0].dof, u, INSERT_VALUES));
      check(VecSetValue(state.v, terms[0].dof, v, INSERT_VALUES));
    }
}

/// Adds the scene's initial motions to a state. Collective.
void add_initial_motions(const Model& model, const Scene& scene, State& state)
{
  if (scene.initial.empty()) return;
  State added{zeros_like(state.u), zeros_like(state.v), 0, {}};
  on_rank_zero(comm_of(state.u),
               [&]
               {
                 for (const InitialMotion& initial : scene.initial) set_initial_motion(model, initial, added);
               });
  for (Vec x : {added.u.get(), added.v.get()}) finish(x);
  check(VecAXPY(state.u, 1, added.u));
  check(VecAXPY(state.v, 1, added.v));
}

std::string no_oscillation_among(const SlidingPoint& point, std::span<const ComplexMode> modes)
{
  const std::string reason = no_mode_among(point, modes);
  return reason.empty() && only_diverges(modes) ? "the equilibrium diverges without oscillating" : reason;
}

Modes modes_at(const SlidingPoint& point, const Scene& scene, const ModesOptions& options)
{
  if (point.equilibrium.outcome.kind != OutcomeKind::converged)
    return not_run<Modes>(OutcomeKind::skipped, "there is no equilibrium to linearise about");
  if (!seeks_modes(scene)) return not_run<Modes>(OutcomeKind::off, "the scene turns it off");
  const Structure& structure = point.model->structure;
  if (auto kept = kept_modes(structure)) return std::move(*kept);
  Modes modes = find_modes(point.sliding(), *point.linearised, scene.modes, options);
  if (checkpoint_is_worth_it(comm_of(structure.load))) keep_modes(modes, structure);
  return modes;
}

std::vector<Estimate> estimates_at(const SlidingPoint& point, const Scene& scene)
{
  std::vector<Estimate> estimates;
  const std::string reason = no_mode_to_follow(point, scene);
  if (!reason.empty())
    estimates.push_back(not_run<Estimate>(OutcomeKind::skipped, reason));
  else
    for (const ComplexMode& mode : followed_modes(point, scene)) estimates.push_back(estimate_of(point, mode));
  return estimates;
}

} // namespace

std::optional<int> starts_sought(const SlidingPoint& point, const Scene& scene)
{
  constexpr int random = 5, together = 16; // random sums; trajectories that are integrated together at most
  constexpr double of_start = 400 * 256;   // steps, of periods and steps a period
  if (!scene.cycle.enabled) return std::nullopt;
  if (scene.cycle.starts > 0) return scene.cycle.starts;
  const auto oscillates = [](const ComplexMode& mode) { return mode.frequency_hz() > 0; };
  const int unstable = point.modes.unstable_count;
  const bool several = std::ranges::count_if(point.modes.unstable(), oscillates) > 1;
  // falling friction drives stick-slip beside sliding that is stable
  const bool falls = unstable == 0 && falls_with_speed(point.model->interface.friction);
  const int starts = several ? std::min(unstable * (unstable + 1) / 2 + random, together) : falls ? 1 + random : 0;
  const double work = (starts + 1) * of_start * work_of_step(point.model->structure);
  return (unstable > 0 || falls) && work <= affordable_work ? std::optional(starts) : std::nullopt;
}

namespace
{

/// Where there is no equilibrium: whether there is one without friction, which tells loads from friction. Collective.
std::string cause_of_none(const Model& model, const Outcome& outcome,
                          const std::function<Equilibrium(const Interface&)>& equilibrium)
{
  Interface smooth = sharing(model.interface);
  smooth.friction = PairFriction(FrictionLaw{});
  const bool stands = equilibrium(smooth).outcome.kind == OutcomeKind::converged;
  return outcome.reason + (stands ? "; without friction there is an equilibrium: friction is too large"
                                  : "; nor is there one without friction: a load pulls a body away from what holds it, "
                                    "or a support is missing");
}

} // namespace

SlidingPoint find_sliding(const Model& model, const ProgramOptions& options, const StageRunner& run)
{
  SlidingPoint point{&model, {}, {}, {}, {}, {}};
  const auto at = [&](const Interface& interface)
  { return find_equilibrium(model.structure, interface, options.equilibrium); };
  point.equilibrium = run_stage(run, Stage::equilibrium, "", [&] { return at(model.interface); });
  if (Outcome& outcome = point.equilibrium.outcome; outcome.kind == OutcomeKind::no_equilibrium)
    outcome.reason = cause_of_none(model, outcome, at);
  return point;
}

SlidingPoint with_small_motions(SlidingPoint point, const Scene& scene, const ProgramOptions& options,
                                const StageRunner& run)
{
  point.modes = run_stage(run, Stage::modes, why_off(Stage::modes, point, scene),
                          [&]
                          {
                            if (point.equilibrium.outcome.kind == OutcomeKind::converged)
                              point.linearised = linearise(point.sliding()); // friction enters Y and C
                            return modes_at(point, scene, options.modes);
                          });
  if (const std::string off = why_off(Stage::estimate, point, scene); !off.empty())
    point.estimates.push_back(not_run<Estimate>(OutcomeKind::off, off));
  else if (const std::string left_out =
               run(Stage::estimate, [&] { return point.estimates = estimates_at(point, scene), false; });
           !left_out.empty())
    point.estimates.push_back(not_run<Estimate>(OutcomeKind::skipped, left_out));
  return point;
}

std::span<const ComplexMode> followed_modes(const SlidingPoint& point, const Scene& scene)
{
  const CycleStartKind start = scene.cycle.start.kind;
  const bool given = scene.cycle.enabled && (start == CycleStartKind::file || start == CycleStartKind::transient ||
                                             (start == CycleStartKind::mode && scene.cycle.amplitude > 0));
  if (point.modes.unstable_count > 0 || !given || point.modes.modes.empty()) return point.modes.unstable();
  return std::span(point.modes.modes).first(1);
}

Estimate estimate_of(const SlidingPoint& point, const ComplexMode& mode)
{
  if (point.model->interface.pairs == 0)
    return not_run<Estimate>(OutcomeKind::skipped, "there is no contact that would limit the growth");
  if (mode.frequency_hz() == 0) return not_run<Estimate>(OutcomeKind::skipped, "the mode does not oscillate");
  return estimate_amplitude(point.sliding(), *point.linearised, mode);
}

bool only_diverges(std::span<const ComplexMode> unstable) // those that oscillate come first
{
  return !unstable.empty() && unstable.front().lambda.real() > 0 && unstable.front().frequency_hz() == 0;
}

std::string no_mode_among(const SlidingPoint& point, std::span<const ComplexMode> modes)
{
  if (point.equilibrium.outcome.kind != OutcomeKind::converged) return "there is no equilibrium to start from";
  if (point.modes.modes.empty()) return "no mode was found in the band";
  if (modes.empty()) return "the equilibrium is stable: no mode grows in the band";
  return {};
}

std::string no_unstable_mode(const SlidingPoint& point)
{
  return no_oscillation_among(point, point.modes.unstable());
}

std::string no_mode_to_follow(const SlidingPoint& point, const Scene& scene)
{
  return no_oscillation_among(point, followed_modes(point, scene));
}

bool seeks_modes(const Scene& scene)
{
  return scene.modes.enabled || scene.cycle.enabled || follows_a_mode(scene.transient);
}

std::string why_off(Stage which, const SlidingPoint& point, const Scene& scene)
{
  const std::string no_table = format("the scene has no [%s]", word(which)), turned_off = "the scene turns it off";
  switch (which)
  {
  case Stage::modes:
    return seeks_modes(scene) || scene.response ? "" : turned_off;
  case Stage::estimate:
    return scene.estimate.enabled || scene.cycle.enabled || follows_a_mode(scene.transient) ? "" : turned_off;
  case Stage::response:
    return scene.response ? "" : no_table;
  case Stage::transient:
    return scene.transient.enabled ? "" : no_table + ", or turns it off";
  case Stage::cycle:
    return scene.cycle.enabled ? "" : no_table + ", or turns it off";
  case Stage::attractors:
    return starts_sought(point, scene) ? "" : "cycle.starts is 0, and no other starts are sought by themselves";
  case Stage::branch:
    return scene.branch ? "" : no_table;
  case Stage::sensitivity:
    return scene.sensitivity ? "" : no_table;
  case Stage::sweep:
    return scene.sweep ? "" : no_table;
  case Stage::robustness:
    return scene.robustness ? "" : no_table;
  default:
    return {};
  }
}

Trajectory find_transient(const SlidingPoint& point, const Scene& scene, const ProgramOptions& options)
{
  TransientSettings settings = scene.transient;
  const std::string reason = no_mode_to_follow(point, scene);
  if (!reason.empty() && !scene.initial.empty() && settings.steps > 0 && !starts_without_a_mode(settings))
    settings.start.kind = StartKind::equilibrium; // [[initial]] alone moves it then
  if (point.equilibrium.outcome.kind != OutcomeKind::converged || (!reason.empty() && !starts_without_a_mode(settings)))
    return not_run<Trajectory>(OutcomeKind::skipped, reason);
  const ComplexMode* followed = reason.empty() ? &point.modes.modes.front() : nullptr;
  const UnstableModes started{followed_modes(point, scene), point.estimates};
  State start = transient_start(point.sliding(), started, settings);
  if (!std::isfinite(norm_of(start.u, NORM_2)))
    return not_run<Trajectory>(OutcomeKind::skipped, "no amplitude is known at which contact opens or slip reverses: "
                                                     "give transient.amplitude, with start = \"mode\"");
  add_initial_motions(*point.model, scene, start);
  return integrate(point.sliding(), followed, settings, options.step, std::move(start), point.model->probes);
}

} // namespace squeal
