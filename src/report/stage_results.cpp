/// Results of equilibrium, modes and estimate.
#include "result.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

void add_contact(Entry out, const Contact& contact, const ContactResultant& resultant)
{
  out.brief("stator", "text", "the contact's stator", contact.stator);
  out.brief("rotor", "text", "the contact's rotor", contact.rotor);
  out.brief("normal_force_sum", "N", "sum of its normal reactions", resultant.normal_force);
  if (out.has(contact.rotation.has_value()))
    out.brief("torque", "N m", "torque with which it brakes its rotation", resultant.torque);
  out.brief("closed_share", "-", "share of its pairs that are closed", resultant.closed_share);
}

void add_bolt(Entry out, const BoltResult& bolt)
{
  out.brief("name", "text", "name of the bolt", bolt.name);
  out.brief("tension", "N", "its tension at equilibrium", bolt.tension);
  out.show("shortening", "m", "by which its shank was shortened", bolt.shortening);
}

void add_history(Entry out, const LoadHistory& history)
{
  out.show("stick", "-", "pairs without a drive that stick in the last increment", history.stick);
  out.show("slip", "-", "those that slip in it", history.slip);
  out.show("open", "-", "those that are open", history.open);
  out.show("at_limit", "-", "those that stick within 1 % of their friction", history.at_limit);
  out.show("increments", "-", "increments of the load path", history.increments);
  out.show("change", "-", "change of reactions over the largest of their contact, from half as many", history.change);
  out.add("index", "-", "sign of the determinant of the status system; -1: no rate of loading follows", history.index);
  out.add("reciprocal_condition", "-", "smallest over largest pivot of the status system",
          history.reciprocal_condition);
}

void add_mode(Entry out, const ComplexMode& mode)
{
  const bool grows = is_unstable(mode.lambda);
  out.show("frequency_hz", "Hz", "frequency of a mode; the largest growth rate comes first", mode.frequency_hz())
      .is_brief = grows;
  out.show("growth_rate", "1/s", "real part of its eigenvalue", mode.growth_rate()).is_brief = grows;
  out.show("damping_ratio", "-", "minus the real part over the modulus of the eigenvalue", mode.damping_ratio())
      .is_brief = grows;
  out.show("backward_error", "-", "backward error in the full problem", mode.backward_error);
  out.show("unstable", "switch", "it grows: the real part exceeds 1e-8 of the modulus", grows);
}

/// The meaning of a count that disagrees, and its remedy.
const char* count_remedy(const Modes& modes)
{
  if (modes.count.found > modes.count.expected)
    return "so none is known to be missing, but the count does not show it: friction or damping moves pairs across the "
           "end of the band; another modes.band may confirm it";
  return "so one is overdamped or an unstable one is missing: with friction.direction_damping = false fewer are "
         "overdamped, and modes.method = \"toar\" seeks them another way";
}

void add_mode_error(Entry out, const ModeOnFinerMesh& mode)
{
  out.show("frequency_hz", "Hz", "frequency of the mode on the scene's mesh", frequency_hz_of(mode.lambda));
  out.show("growth_rate", "1/s", "its growth rate there", mode.lambda.real());
  out.show("finer_frequency_hz", "Hz", "the frequency with every element divided", frequency_hz_of(mode.finer));
  out.show("finer_growth_rate", "1/s", "the growth rate there", mode.finer.real());
  out.add("held_frequency_hz", "Hz", "that with the closed pairs of the scene's mesh", frequency_hz_of(mode.held));
  out.add("held_growth_rate", "1/s", "the growth rate with them", mode.held.real());
  out.brief("corrected_frequency_hz", "Hz", "the frequency where both meshes lead", frequency_hz_of(mode.corrected()));
  out.error("frequency_error", "its bar", mode.bar().imag() / two_pi);
  out.brief("corrected_growth_rate", "1/s", "the growth rate where both meshes lead", mode.corrected().real());
  out.error("growth_error", "its bar", mode.bar().real());
  out.show("undecided", "switch", "the bar holds zero growth, or growth of the other sign", mode.is_undecided());
  out.add("backward_error", "-", "backward error on the finer mesh", mode.backward_error);
}

void add_mesh_error(Entry whole, const MeshError& error)
{
  if (!whole.has(error.outcome.kind != OutcomeKind::off)) return;
  const Entry out = whole.group("mesh_error");
  out.add("outcome", "whether the modes were found on the finer mesh", error.outcome.kind);
  out.text("reason", "why not", error.outcome.reason);
  out.add("dofs", "-", "degrees of freedom of the finer mesh", error.dofs);
  out.list("modes", add_mode_error, error.modes);
  if (!error.outcome.reason.empty())
    whole.warn(Severity::note, format("no error of the mesh: %s", error.outcome.reason.c_str()));
}

void warn_of_modes(Entry out, const Modes& modes, const ModelSummary& model)
{
  if (modes.modes.empty() && modes.outcome.kind == OutcomeKind::converged)
    out.warn(Severity::severe, format("no mode lies below %g Hz", modes.band) +
                                   (model.length > 0 ? format(": raise modes.band, or is mesh.scale wrong (the model "
                                                              "is %.3g m long), or a modulus or density?",
                                                              model.length)
                                                     : ": is modes.band right, and are the units of M and K?"));
  if (model.rounding_hz > 0.001 * modes.band)
    out.warn(Severity::warning,
             format("modes below %.3g Hz are lost in rounding beside the stiffest entry of K: make what is rigid "
                    "a rigid body, not a stiff spring",
                    model.rounding_hz));
  constexpr double narrow = 1e-4; // of |lambda|: less than a mesh or a damping value is known to
  const auto on_the_edge =
      std::ranges::count_if(modes.modes, [](const ComplexMode& mode)
                            { return std::abs(mode.growth_rate()) < narrow * std::abs(mode.lambda); });
  if (on_the_edge > 0)
    out.warn(Severity::note,
             format("%td of the modes are within 0.01 %% of the threshold: mesh and damping decide their sign",
                    on_the_edge));
  if (!modes.decays.empty())
    out.warn(Severity::note, format("%zu real eigenvalues in the band decay, the slowest by %.4g 1/s",
                                    modes.decays.size(), *std::ranges::max_element(modes.decays)));
  if (modes.count.certified_by == Certificate::none && modes.count.expected != modes.count.found)
    out.warn(Severity::severe, format("%d pairs were found where %d are expected, %s", modes.count.found,
                                      modes.count.expected, count_remedy(modes)));
}

} // namespace

std::vector<double> closed_reactions(const Equilibrium& equilibrium)
{
  std::vector<double> forces;
  const PairView reactions(equilibrium.reactions, equilibrium.directions);
  for (std::size_t i = 0; i < reactions.pairs(); ++i)
    if (equilibrium.closed[i]) forces.push_back(reactions.normal(i));
  return forces;
}

void add_probes(Entry out, const std::string& name, const char* meaning, const std::vector<double>& values)
{
  const Entry probes = out.group(name);
  for (std::size_t i = 0; i < std::min(out.scene().probes.size(), values.size()); ++i)
    probes.show(out.scene().probes[i].name, "m", meaning, values[i]);
  if (probes.is_example()) probes.add("<probe>", "m", meaning, 0.);
}

void add_equilibrium(Entry whole, const Report& report)
{
  const Equilibrium& found = report.point.equilibrium;
  const Entry out = found.outcome.kind == OutcomeKind::no_equilibrium ? whole.hidden() : whole;
  const std::vector<double> forces = closed_reactions(found);
  const auto [least, greatest] = std::ranges::minmax_element(forces);
  double sum = 0;
  for (const double force : forces) sum += force;
  out.show("iterations", "-", "iterations of the contact status", found.outcome.iterations);
  out.brief("closed", "-", "contact pairs that are closed", forces.size());
  out.show("normal_force_sum", "N", "sum of the normal reactions", sum);
  out.show("normal_force_min", "N", "smallest normal reaction of a closed pair", forces.empty() ? 0 : *least);
  out.show("normal_force_max", "N", "largest normal reaction of a pair", forces.empty() ? 0 : *greatest);
  const bool is_found = found.outcome.kind == OutcomeKind::converged;
  out.check(is_found, "residual", "-", "largest natural map of a pair over the largest reaction",
            found.outcome.residual);
  out.check(is_found, "force_residual", "-", "norm of K u - F - B' r over the norm of F; null without an equilibrium",
            is_found ? found.force_residual : std::nan(""));
  (found.auxiliary_stiffness > 0 ? out : out.hidden())
      .show("auxiliary_stiffness", "N/m", "springs across pairs that alone hold a body; 0: none",
            found.auxiliary_stiffness);
  out.add("uniqueness", "whether other equilibria are excluded", found.uniqueness);
  if (out.has(found.history.has_value()))
    add_history(out.group("undriven_pairs"), found.history.value_or(LoadHistory{}));
  out.list("contacts", add_contact, out.scene().contacts, report.contacts);
  if (out.has(!report.bolts.empty())) out.list("bolts", add_bolt, report.bolts);
  add_probes(out, "probes", "displacement of the probe at equilibrium", report.equilibrium_probes);
  if (report.model.length > 0 && report.displacement > report.model.length)
    out.warn(Severity::severe,
             format("the loads move the structure by %.3g m, which is longer than itself: one pulls a "
                    "body away from what holds it; turn it round, or add a support",
                    report.displacement));
  if (found.uniqueness == Uniqueness::not_assured)
    out.warn(Severity::note, "with this much friction other equilibria may exist beside this one");
  if (report.model.pairs > 0 && found.outcome.kind == OutcomeKind::converged && forces.empty())
    out.warn(Severity::severe,
             "no contact pair is closed: nothing touches, and friction does nothing. Is the gap too large, or does a "
             "load pull the bodies apart?");
  if (!forces.empty() && found.outcome.kind == OutcomeKind::converged && !(*greatest > 0))
    out.warn(Severity::severe, "no load presses the contact: give a [[force]] or a [[pressure]]");
}

void add_modes(Entry out, const Report& report)
{
  const Modes& modes = report.point.modes;
  const ModeCount& count = modes.count;
  const bool is_certified = count.certified_by != Certificate::none;
  out.brief("unstable_count", "-", "modes that grow", modes.unstable_count);
  out.brief("band_hz", "Hz", "every mode below is reported", modes.band);
  out.show("method", "how the modes are found", modes.method);
  out.add("iterations", "-", "iterations of the eigensolver", modes.outcome.iterations);
  out.check(modes.outcome.kind == OutcomeKind::converged, "residual", "-", "largest backward error of a reported mode",
            modes.outcome.residual);
  out.check(is_certified || count.expected == count.found, "count_check", "text",
            "numbers of modes found, and expected by inertia", modes.count_check);
  out.add("count_certified_by", "word", "`inertia`; `all pairs`: the problem was solved whole; `null`: not certified",
          is_certified ? Json(word(count.certified_by)) : Json());
  out.add("count_expected", "-", "number of pairs below `count_frequency_hz` by that count", count.expected);
  out.add("count_found", "-", "number of pairs found below it", count.found);
  out.add("count_frequency_hz", "Hz", "where pairs were counted: the band, or just above it", count.frequency);
  out.add("real_eigenvalues", "1/s", "real negative eigenvalues in the band: overdamped motions", modes.decays);
  out.add("beyond_band_hz", "Hz", "pairs between the band and `count_frequency_hz`", modes.beyond_band);
  const auto& linearised = report.point.linearised;
  const int dependent = linearised ? linearised->contact.dependent_rows : 0;
  if (out.has(dependent > 0))
    out.show("dependent_rows", "-", "rows of pairs that stick which the other rows imply", dependent);
  out.list("modes", add_mode, modes.modes);
  add_mesh_error(out, report.point.mesh_error);
  warn_of_modes(out, modes, report.model);
}

void add_estimate(Entry out, const Report& report)
{
  const Estimate& estimate = followed_estimate(report);
  const bool has_balance = estimate.outcome.kind == OutcomeKind::balance; // else there is no amplitude, not one of zero
  out.brief("amplitude", "m", "amplitude of the balance; the mode's largest entry is 1",
            has_balance ? Json(estimate.amplitude) : Json());
  out.show("mean_energy", "J", "mean energy of the vibration there", has_balance ? Json(estimate.mean_energy) : Json());
  out.brief("lift_off_amplitude", "m", "amplitude at which the first pair lifts off", estimate.lift_off_amplitude);
  out.show("reversal_amplitude", "m", "amplitude at which sliding first reverses", estimate.reversal_amplitude);
  if (out.has(std::isfinite(estimate.slip_amplitude)))
    out.show("slip_amplitude", "m", "amplitude at which the first pair that sticks slips", estimate.slip_amplitude);
  out.show("damping_rate", "1/s", "power of damping over energy", estimate.damping_rate);
  out.show("friction_rate_linear", "1/s", "power of friction over energy, at small ones",
           estimate.friction_rate_linear);
  out.add("phase", "rad", "phase of the start, at which the smallest normal reaction is largest", estimate.phase);
  out.add("residual", "-", "imbalance of the powers at the amplitude found", estimate.outcome.residual);
  const Entry curve = out.group("curve");
  curve.add("amplitude", "m", "amplitudes of the curve", estimate.curve_amplitude);
  curve.add("friction_rate", "1/s", "power of friction over energy there", estimate.curve_rate);
  const double lift_off = estimate.lift_off_amplitude;
  if (report.motion.cycle.outcome.kind == OutcomeKind::converged || has_run(report.motion.settled.outcome))
    return; // the motion itself is known
  if (estimate.outcome.kind == OutcomeKind::no_balance && std::isfinite(lift_off))
    out.warn(Severity::note,
             format("no amplitude is predicted; start = \"estimate\" is first lift-off times %g, %.5g m",
                    lift_off_multiple, lift_off_multiple * lift_off));
  if (has_balance && estimate.amplitude > 3 * lift_off)
    out.warn(Severity::note, format("%.2g times first lift-off: the cycle itself may be far smaller, down to that",
                                    estimate.amplitude / lift_off));
  if (has_balance && estimate.reversal_amplitude < lift_off)
    out.warn(Severity::note,
             "slip reverses before anything lifts off: pairs will stick, and the cycle may be twice as large");
}

} // namespace squeal
