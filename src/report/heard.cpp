#include "squeal/report/report.hpp"
#include "squeal/scene/numbers.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// A length with a prefix that leaves one to three digits before the point.
std::string length_text(double metres)
{
  const double size = std::abs(metres);
  if (size == 0) return "0 m";
  if (size >= 0.1) return format("%.3g m", metres);
  if (size >= 1e-3) return format("%.3g mm", 1e3 * metres);
  if (size >= 1e-6) return format("%.3g um", 1e6 * metres);
  return format("%.3g nm", 1e9 * metres);
}

/// The probe that swings most; empty without probes.
template <class Swings, class Size>
std::string largest_swing(const Scene& scene, const Swings& swings, const Size& size_of)
{
  const std::size_t probes = std::min(scene.probes.size(), swings.size());
  if (probes == 0) return {};
  const auto largest = std::max_element(swings.begin(), swings.begin() + static_cast<std::ptrdiff_t>(probes),
                                        [&](const auto& a, const auto& b) { return size_of(a) < size_of(b); });
  return ", " + scene.probes[static_cast<std::size_t>(largest - swings.begin())].name + " " +
         length_text(size_of(*largest)) + " peak to peak";
}

/// Where the frequency is 2 % or more off the nearest unstable mode's, that too: a shift that a listener hears.
std::string beside_mode(const Report& report, double frequency_hz)
{
  const auto unstable = report.point.modes.unstable();
  const auto end = // those that oscillate come first
      std::find_if(unstable.begin(), unstable.end(), [](const ComplexMode& mode) { return mode.frequency_hz() == 0; });
  if (end == unstable.begin()) return {};
  const auto nearest =
      std::min_element(unstable.begin(), end,
                       [&](const ComplexMode& a, const ComplexMode& b) {
                         return std::abs(a.frequency_hz() - frequency_hz) < std::abs(b.frequency_hz() - frequency_hz);
                       });
  const double mode = nearest->frequency_hz(), away = frequency_hz / mode - 1;
  if (!(std::abs(away) >= 0.02)) return {};
  return format(", %.2g %% %s the unstable mode at %.5g Hz", 100 * std::abs(away), away < 0 ? "below" : "above", mode);
}

std::string stability_text(const Multipliers& multipliers)
{
  if (multipliers.values.empty())
    return multipliers.stability == Stability::undecided ? ", whether it lasts is undecided"
                                                         : ", whether it lasts was not examined";
  std::size_t place = 0; // of the largest, or of the first that leaves it undecided
  if (multipliers.stability == Stability::undecided)
    while (place < multipliers.values.size() && multipliers.upper_bound(place) < 1) ++place;
  place %= multipliers.values.size();
  const double modulus = std::abs(multipliers.values[place]), error = multipliers.errors[place];
  const double bound = largest_upper_bound(multipliers); // closer than the error, which is of both sides
  const bool decided = multipliers.stability == Stability::stable || multipliers.stability == Stability::unstable;
  const std::string which = place == 0 ? "largest" : "a";
  if (multipliers.stability == Stability::undecided && !multipliers.complete)
    return format(", whether it lasts is undecided (%s multiplier found is %.4f +- %.0e, but others may be missing)",
                  place == 0 ? "the largest" : "a", modulus, error);
  const std::string largest =
      modulus + error >= 1 && bound < 1 ? format(" (largest multiplier %.4f, at most %.6f)", modulus, bound)
      : decided && largest_reaches_across(multipliers) && bound >= 1 && !multipliers.seen.empty()
          ? format(" (the distance of a motion beside it changes by %.4f +- %.0e times a period)",
                   multipliers.seen.back().growth, multipliers.seen.back().error)
          : format(" (%s multiplier %.4f +- %.0e)", which.c_str(), modulus, error);
  switch (multipliers.stability)
  {
  case Stability::stable:
    return ", stable" + largest +
           (multipliers.offsets > 0 ? format(", %d offsets of joints held", multipliers.offsets) : "");
  case Stability::unstable:
    return ", which repels" + largest;
  default:
    return ", whether it lasts is undecided" + largest;
  }
}

/// As many digits as the error leaves, at least two; where it leaves none, the bound.
std::string energy_text(const MeanValue& energy)
{
  if (energy.error >= energy.value) return format(", mean energy at most %.2g J", energy.value + energy.error);
  const double ratio = energy.value / std::max(energy.error, 1e-5 * energy.value);
  const int digits = std::clamp(static_cast<int>(std::ceil(std::log10(std::max(ratio, 1.)))) + 1, 2, 6);
  return format(", mean energy %.*g +- %.0e J", digits, energy.value, energy.error);
}

/// Where most of the starts lead that do not lead to the answer; empty: all that have settled lead to it.
template <class IsAnswer> std::string starts_text(const Report& report, const char* to, const IsAnswer& is_answer)
{
  std::size_t settled = 0;
  const ReachedMotion* other = nullptr;
  for (const ReachedMotion& motion : report.attractors.motions) // by falling number of starts
  {
    const bool same = is_answer(motion);
    if (motion.kind == ReachedKind::unsettled && !same) continue; // it may still come there
    settled += motion.starts.size();
    if (!same && !other) other = &motion;
  }
  if (!has_run(report.attractors.outcome) || !other) return {};
  return format(", but %zu of %zu starts lead to ", other->starts.size(), settled) +
         (other->kind == ReachedKind::rest
              ? "rest"
              : format("a %s at %.5g Hz, mean energy %.3g J", to, other->frequency.value, other->energy.value));
}

/// A cycle that starts lead to in place of the settled motion.
std::string steady_starts_text(const Report& report)
{
  const SettledMotion& settled = report.motion.settled;
  const MeanValue energy{settled.fluctuating_energy.value, settled.fluctuating_energy.error + settled.step_error},
      frequency{settled.examined.base.first, 0};
  return starts_text(report, "cycle",
                     [&](const ReachedMotion& motion)
                     { return motion.kind != ReachedKind::steady || is_cycle(motion, energy, frequency); });
}

std::string settled_text(const Report& report, const Scene& scene)
{
  const ExaminedMotion& motion = report.motion.settled.examined;
  const MotionVerdict& verdict = motion.verdict;
  const double first = motion.base.first, second = motion.base.second;
  std::string text;
  switch (verdict.kind)
  {
  case MotionKind::periodic:
    text = format("a cycle attracts that shooting did not find: %.5g Hz", first);
    if (motion.base.closes_after > 1) text += format(", closing after %d periods", motion.base.closes_after);
    break;
  case MotionKind::quasi_periodic:
    text = format("no cycle attracts that was found: quasi-periodic, %.5g and %.5g Hz", first, second);
    break;
  case MotionKind::irregular:
    text = format("no cycle attracts that was found: irregular, strongest line %.5g Hz", first);
    break;
  case MotionKind::undecided:
    text = "no cycle attracts that was found: undecided between " + verdict.between +
           format(", strongest line %.5g Hz", first);
    break;
  }
  MeanValue energy = report.motion.settled.fluctuating_energy;
  energy.error += report.motion.settled.step_error;
  text += beside_mode(report, first) + energy_text(energy) +
          largest_swing(scene, report.motion.settled.peak_to_peak, [](const MeanValue& swing) { return swing.value; }) +
          steady_starts_text(report);
  if (!depends_on_steps(report.motion.settled)) return text;
  return text +
         format("; by %d steps a period, and half as many change the energy by %.0f %%: more may change the kind",
                report.motion.settled.steps_per_period,
                100 * report.motion.settled.step_error / report.motion.settled.fluctuating_energy.value);
}

/// A mean with the relative error of the step, where that is known.
MeanValue with_step_error(double value, double relative)
{
  return {value, std::isfinite(relative) ? relative * value : 0};
}

/// A sentence about the motions that starts lead to in place of the cycle. Means agree. Steps that do not fit the
/// period may keep a motion varying beside a slowly attracting cycle.
std::string starts_beside_cycle(const Report& report)
{
  const LimitCycle& cycle = report.motion.cycle;
  const Fidelity& fidelity = report.motion.fidelity;
  const MeanValue energy = with_step_error(cycle.measured.mean_fluctuating_energy, fidelity.step_energy_error),
                  frequency = with_step_error(1 / cycle.orbit.period, fidelity.step_frequency_error);
  return starts_text(report, "motion",
                     [&](const ReachedMotion& motion) { return is_cycle(motion, energy, frequency); });
}

/// The errors of the steps, where one is above the accuracy.
std::string missed_accuracy(const Fidelity& fidelity)
{
  const double frequency = fidelity.step_frequency_error, energy = fidelity.step_energy_error;
  if (!(std::max(frequency, energy) > fidelity.accuracy)) return {};
  return format("; %d steps a period leave %.2g %% of error in the frequency and %.2g %% in the energy%s",
                fidelity.steps_per_period, 100 * frequency, 100 * energy,
                fidelity.chooses_steps ? format(", where %.2g %% was asked", 100 * fidelity.accuracy).c_str() : "");
}

std::string cycle_sentence(const Report& report, const Scene& scene)
{
  const LimitCycle& cycle = report.motion.cycle;
  const double frequency = 1 / cycle.orbit.period;
  return format("squeals at %.5g Hz", frequency) + beside_mode(report, frequency) +
         largest_swing(scene, cycle.measured.peak_to_peak, [](double swing) { return swing; }) +
         stability_text(cycle.multipliers) + starts_beside_cycle(report) +
         (report.point.modes.unstable_count == 0 ? ", beside a stable equilibrium that another start leads to" : "") +
         missed_accuracy(report.motion.fidelity);
}

/// Why friction cannot feed a motion; empty: it may, or something else does, such as another code's friction in K.
std::string without_friction(const Report& report)
{
  const std::vector<double> forces = closed_reactions(report.point.equilibrium);
  if (!forces.empty() && std::ranges::none_of(forces, [](double force) { return force > 0; }))
    return "nothing presses: the contact carries no force, and what its friction does is unknown";
  if (report.point.modes.unstable_count > 0) return {};
  if (report.model.pairs == 0) return "no contact: nothing is there that friction could feed";
  if (forces.empty()) return "nothing touches: no contact pair is closed, and friction does nothing";
  if (!report.model.slides)
    return "nothing slides: no drive moves a contact along its surface; no mode grows in the band";
  return {};
}

/// Where no mode grows: silence, unless starts lead to something else, or may.
std::string stable_text(const Report& report)
{
  const Attractors& seen = report.attractors;
  const std::string others =
      starts_text(report, "motion", [](const ReachedMotion& motion) { return motion.kind == ReachedKind::rest; });
  std::size_t open = 0;
  for (const ReachedMotion& motion : seen.motions)
    if (motion.kind == ReachedKind::unsettled) open += motion.starts.size();
  if (others.empty() && open > 0)
    return format("undecided: no mode grows in the band, but %zu of %zu starts still moved after %ld periods", open,
                  seen.starts.size(), seen.periods);
  return "silent: no mode grows in the band" + others;
}

/// Without a cycle.
std::string linear_text(const Report& report)
{
  if (report.point.equilibrium.outcome.kind != OutcomeKind::converged)
    return "nothing is known: no equilibrium was found";
  if (!has_run(report.point.modes.outcome)) return "nothing is known: the modes were not computed";
  if (const std::string text = without_friction(report); !text.empty()) return text;
  if (report.point.modes.unstable_count == 0)
    return report.point.modes.outcome.kind == OutcomeKind::converged ? stable_text(report)
                                                                     : "nothing is known: the modes are incomplete";
  const ComplexMode& mode = report.point.modes.modes.front();
  if (mode.frequency_hz() == 0)
    return format("the equilibrium diverges without oscillating, by a factor e in %.3g s", 1 / mode.growth_rate());
  return format("the equilibrium is unstable at %.5g Hz", mode.frequency_hz());
}

/// Key and coefficient of the first driven contact's friction.
std::pair<std::string, double> driven_friction(const Scene& scene)
{
  const auto driven = std::ranges::find_if_not(scene.contacts, [](const Contact& c) { return is_undriven(c); });
  if (driven == scene.contacts.end() || !driven->friction)
    return {friction_coefficient_key, scene.friction.coefficient};
  return {format("contact.%td.friction", driven - scene.contacts.begin()), driven->friction->coefficient};
}

/// Options that lead on from what was found; empty: it is complete, and the report page shows it.
std::string options_to_go_on(const Report& report, const Scene& scene)
{
  const OutcomeKind equilibrium = report.point.equilibrium.outcome.kind, cycle = report.motion.cycle.outcome.kind;
  const Modes& modes = report.point.modes;
  const auto [friction, coefficient] = driven_friction(scene);
  const bool has_motion = cycle == OutcomeKind::converged || has_run(report.motion.settled.outcome);
  const bool has_study = scene.sweep || scene.sensitivity || scene.robustness || scene.response || scene.branch;
  if (equilibrium != OutcomeKind::converged) return format(" --set %s=%g", friction.c_str(), coefficient / 2);
  if (has_run(modes.outcome) && !without_friction(report).empty()) return {};
  if (modes.outcome.kind == OutcomeKind::not_converged) return " --set modes.method=toar";
  if (cycle == OutcomeKind::converged && report.motion.cycle.multipliers.stability == Stability::undecided)
    return " -cycle_watched_periods 200";
  if (has_motion || has_study || !has_run(modes.outcome)) return {};
  if (has_run(report.motion.cycle.outcome) && modes.unstable_count > 0)
    return " --set transient.periods=400 --set cycle.start=transient";
  if (modes.unstable_count > 0 && modes.modes.front().frequency_hz() > 0) return " --set cycle.enabled=true";
  if (modes.unstable_count > 0 || coefficient == 0) return {};
  return format(" --set sweep.key=%s --set sweep.from=%g --set sweep.to=%g --set cycle.enabled=false", friction.c_str(),
                coefficient, 2 * coefficient);
}

} // namespace

std::string next_command(const Report& report, const Scene& scene)
{
  if (!report.ended_by.empty())
    return report.command + (report.command.find(" --restart") == std::string::npos ? " --restart" : "");
  const std::string options = options_to_go_on(report, scene);
  if (options.empty()) return report.program + " report " + report.place.string();
  std::string command = report.command; // without the keys that the options set anew
  for (std::size_t at = options.find(" --set "); at != std::string::npos; at = options.find(" --set ", at + 1))
  {
    const std::string key = options.substr(at, options.find('=', at) + 1 - at);
    for (std::size_t old = 0; (old = command.find(key)) != std::string::npos;)
      command.erase(old, command.find(' ', old + key.size()) - old);
  }
  return command + options;
}

namespace
{

/// Modes whose growth the mesh leaves open; empty: none that it was asked about.
std::string undecided_by_mesh(const Report& report)
{
  const auto& modes = report.point.mesh_error.modes;
  const auto open = std::ranges::find_if(modes, &ModeOnFinerMesh::is_undecided);
  if (open == modes.end()) return {};
  return format("; whether the mode at %.5g Hz grows is undecided by the mesh (growth rate %.3g +- %.2g 1/s)",
                frequency_hz_of(open->lambda), open->corrected().real(), open->bar().real());
}

std::string what_is_heard(const Report& report, const Scene& scene)
{
  if (has_run(report.motion.settled.outcome)) return settled_text(report, scene);
  const Outcome& outcome = report.motion.cycle.outcome;
  if (outcome.kind == OutcomeKind::converged) return cycle_sentence(report, scene);
  if (!has_run(outcome)) return linear_text(report);
  if (outcome.kind == OutcomeKind::collapsed_to_equilibrium && report.point.modes.unstable_count == 0)
    return linear_text(report) + ", and the motion from cycle.start falls to rest";
  if (outcome.kind == OutcomeKind::unstable_cycle && !report.motion.cycle.multipliers.values.empty())
    return format("passes by a cycle at %.5g Hz", 1 / report.motion.cycle.orbit.period) +
           beside_mode(report, 1 / report.motion.cycle.orbit.period) + stability_text(report.motion.cycle.multipliers) +
           "; what it leads to was not found";
  const std::string end = report.ended_by.empty()
                              ? "the search for a cycle ended with " + std::string(word(outcome.kind))
                              : "the run was ended " + report.ended_by;
  return linear_text(report) + "; what is heard was not found: " + end;
}

} // namespace

std::string heard(const Report& report, const Scene& scene)
{
  return what_is_heard(report, scene) + undecided_by_mesh(report);
}

} // namespace squeal
