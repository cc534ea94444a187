/// Results of responses, branches and sensitivities.
#include "result.hpp"
#include "squeal/base/constants.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// The largest |H| of a probe's response.
void add_peak(Entry out, const std::string& excitation, const std::string& probe,
              const std::vector<double>& frequency_hz, const std::vector<std::complex<double>>& receptance)
{
  const auto peak = std::ranges::max_element(receptance, {}, [](const auto& value) { return std::abs(value); });
  const bool has_peak = peak != receptance.end();
  const auto place = static_cast<std::size_t>(peak - receptance.begin());
  out.brief("excitation", "text", "probe that is driven", excitation);
  out.brief("probe", "text", "probe that is read", probe);
  out.brief("frequency_hz", "Hz", "frequency at which it moves most", has_peak ? frequency_hz[place] : 0);
  out.brief("receptance", "m/N", "displacement over force there", has_peak ? std::abs(*peak) : 0);
}

void add_branch_point(Entry out, const BranchPoint& point)
{
  const PointMeasures& measures = point.measures;
  const auto& values = point.multipliers.values;
  const double largest = values.empty() ? std::nan("") : std::abs(values.front());
  out.show("parameter", "unit of the key", "value of the number", point.parameter);
  out.add("period", "s", "period of the cycle", point.orbit.period);
  out.show("frequency_hz", "Hz", "its frequency", 1 / point.orbit.period);
  out.add("residual", "-", "in the full space: up to ten tolerances where the period's map jumps",
          point.orbit.residual);
  out.add("mean_energy", "J", "mean mechanical energy", measures.mean_energy);
  out.show("mean_fluctuating_energy", "J", "mean energy about equilibrium", measures.mean_fluctuating_energy);
  out.add("open_pairs_mean", "-", "mean number of open pairs", measures.open_pairs_mean);
  out.add("open_steps", "-", "steps at which a pair is open that also closes", measures.open_steps);
  out.add("lift_offs", "-", "times that such a pair opens", measures.lift_offs);
  out.add("stick_steps", "-", "steps at which a pair sticks, of all pairs", measures.stick_steps);
  out.show("largest_multiplier", "-", "modulus of its largest multiplier", largest);
  out.show("stability", "verdict on the cycle", point.multipliers.stability);
  add_multipliers(out, "multipliers", point.multipliers);
  add_probes(out.hidden(), "peak_to_peak", "swing of the probe", measures.peak_to_peak);
}

void add_event(Entry out, const BranchEvent& event)
{
  out.brief("kind", "what happens along the branch", event.kind);
  out.brief("parameter", "unit of the key", "where it happens", event.parameter);
  out.error("error", "error; other phases of the steps move events of contact by up to four times it", event.error);
  out.show("frequency_hz", "Hz", "of the cycle there; at a Hopf point of the mode", 1 / event.period);
  out.add("mean_fluctuating_energy", "J", "of the cycle there; 0 at a Hopf point", event.mean_fluctuating_energy);
  out.show("change", "-", "change of unstable modes, unstable multipliers or lift-offs", event.change);
}

void add_equilibrium_point(Entry out, const SweepPoint& point)
{
  const auto least = std::ranges::find_if(point.modes, [](const SweptMode& mode) { return mode.lambda.imag() > 0; });
  const std::complex<double> lambda = least == point.modes.end() ? 0 : least->lambda;
  out.add("parameter", "unit of the key", "value of the number", point.values.empty() ? 0 : point.values[0]);
  out.add("unstable_modes", "-", "unstable modes of the equilibrium", point.unstable);
  out.add("growth_rate", "1/s", "growth rate of its least stable mode", lambda.real());
  out.add("frequency_hz", "Hz", "frequency of that mode", frequency_hz_of(lambda));
}

/// An eigenvalue as growth rate and frequency.
void add_eigenvalue(Entry out, const char* meaning, std::complex<double> lambda)
{
  out.brief("growth_rate", "1/s", meaning, lambda.real());
  out.brief("frequency_hz", "Hz", "its frequency", lambda.imag() / two_pi);
}

void add_derivative(Entry out, const NumberDerivative& derivative)
{
  const double growth = derivative.lambda.real(), frequency = derivative.lambda.imag() / two_pi,
               percent = 0.01 * derivative.number.value;
  add_key(out, "number of the scene", derivative.number.key);
  out.add("value", "unit of the key", "its value", derivative.number.value);
  out.add("known", "switch", "the same pairs are closed on both sides of the value", derivative.known);
  if (!out.has(derivative.known)) return;
  out.add("growth_rate_by", "1/s per unit of the key", "derivative of the growth rate", growth);
  out.add("frequency_hz_by", "Hz per unit of the key", "derivative of the frequency", frequency);
  out.show("growth_rate_by_percent", "1/s", "change of the growth rate by 1 % of the value", percent * growth);
  out.show("frequency_hz_by_percent", "Hz", "change of the frequency by 1 % of the value", percent * frequency);
}

void add_probe_derivative(Entry out, const Probe& probe, const ProbeDerivative& derivative)
{
  out.add("name", "text", "probe, along whose direction something is added", probe.name);
  out.add("growth_rate_by_mass", "1/(kg s)", "derivative of the growth rate by a mass", derivative.mass.real());
  out.add("growth_rate_by_damping", "m/(N s2)", "by a dashpot to the ground", derivative.damping.real());
  out.add("growth_rate_by_stiffness", "m/(N s)", "by a spring to the ground", derivative.stiffness.real());
}

void add_share(Entry out, const EnergyShare& share)
{
  out.show("table", "text", "table of the scene; `contact`: of a compliance", share.table);
  out.show("name", "text", "which one holds energy; superelements stand together", share.name);
  out.show("kinetic", "-", "its share of the kinetic energy; all are 1 together", share.kinetic);
  out.show("strain", "-", "its share of the strain energy; all are 1 together", share.strain);
}

void add_change(Entry out, const Change& change, const ChangeEffect& effect)
{
  out.brief("probe", "text", "where a change is proposed", change.probe);
  out.show("mass", "kg", "mass that is added", change.mass);
  out.show("damping", "N s/m", "dashpot that is added", change.damping);
  out.show("stiffness", "N/m", "spring that is added", change.stiffness);
  add_eigenvalue(out.group("predicted"), "growth rate by the derivatives", effect.predicted);
  if (out.has(effect.found))
    add_eigenvalue(out.group("computed"), "growth rate of the changed structure's mode", effect.computed);
}

/// The keys of the numbers whose relative change moves the growth rate most.
std::vector<std::string> strongest(std::vector<NumberDerivative> derivatives)
{
  constexpr std::size_t most = 6;
  std::erase_if(derivatives, [](const NumberDerivative& by) { return !by.known; });
  std::ranges::stable_sort(derivatives, std::greater(),
                           [](const NumberDerivative& by) { return std::abs(by.number.value * by.lambda.real()); });
  std::vector<std::string> keys;
  for (std::size_t i = 0; i < std::min(most, derivatives.size()); ++i) keys.push_back(derivatives[i].number.key);
  return keys;
}

void add_causes(Entry out, const ModeCauses& causes)
{
  add_eigenvalue(out, "growth rate of an unstable mode", causes.lambda);
  out.add("backward_error", "-", "the larger one of its right and its left vector", causes.backward_error);
  out.show("contact_powers", "1/s", "power of each contact's reactions over energy", causes.contact_powers);
  out.show("falling_friction_powers", "1/s", "power as friction falls with the speed", causes.falling_friction_powers);
  out.show("turning_friction_powers", "1/s", "power as friction turns, as damping", causes.turning_friction_powers);
  out.show("damping_power", "1/s", "power that dampers, Rayleigh damping and loss factors take", causes.damping_power);
  out.add("power_defect", "1/s", "all of these less twice the growth rate: rounding", causes.defect);
  out.brief("strongest", "text", "numbers of which 1 % moves the growth rate most", strongest(causes.numbers));
  out.list("derivatives", add_derivative, causes.numbers);
  out.list("probes", add_probe_derivative, out.scene().probes, causes.probes);
  out.list("shares", add_share, causes.shares);
  out.list("changes", add_change, out.scene().changes, causes.changes);
}

} // namespace

void add_key(Entry out, const char* meaning, const std::string& key)
{
  out.show("key", "text", meaning, key);
  out.show("name", "text", "a name for the place in the key; empty where the key says it",
           out.is_example() ? "" : description_of(out.scene(), key).name);
}

void add_response(Entry out, const Report& report)
{
  const Response& response = report.response;
  const std::vector<double>& frequency = response.frequency_hz;
  out.show("from_hz", "Hz", "lowest frequency", frequency.empty() ? 0 : frequency.front());
  out.show("to_hz", "Hz", "highest frequency", frequency.empty() ? 0 : frequency.back());
  out.show("count", "-", "number of frequencies", frequency.size());
  out.check(response.outcome.kind == OutcomeKind::converged, "residual", "-", "residual force over a unit force",
            response.outcome.residual);
  out.show("change", "-", "relative change of a receptance by the last correction", response.change);
  out.show("shapes", "-", "shapes of the basis", response.shapes);
  const Entry peaks = out.list("peaks");
  const std::vector<Probe>& probes = out.scene().probes;
  for (std::size_t i = 0; i < response.excitations.size(); ++i)
    for (std::size_t j = 0; j < response.receptance[i].size(); ++j)
      add_peak(peaks.group(""), probes[static_cast<std::size_t>(response.excitations[i])].name, probes[j].name,
               frequency, response.receptance[i][j]);
  if (out.is_example()) add_peak(peaks.group(""), "", "", {}, {});
  const Modes& modes = report.point.modes;
  if (modes.unstable_count > 0)
    out.warn(Severity::note,
             format("%d of the modes are unstable: no vibration settles on these responses, and no rig measures them",
                    modes.unstable_count));
  else if (modes.outcome.kind != OutcomeKind::converged || modes.band < (frequency.empty() ? 0 : frequency.back()))
    out.warn(Severity::note,
             "whether all modes of this band are stable is not known, without which no rig measures these responses: "
             "give modes.band its highest frequency");
}

void add_branch(Entry out, const Report& report)
{
  const BranchSettings& settings = *out.scene().branch;
  const Branch& branch = report.branch.branch;
  add_key(out, "number that changes along the branch", settings.key);
  out.brief("from", "unit of the key", "one end of its range", settings.from);
  out.brief("to", "unit of the key", "the other end", settings.to);
  out.show("periods_integrated", "-", "periods integrated", branch.periods);
  out.show("tangent_columns", "-", "columns of the tangent, those of the multipliers included", branch.columns);
  const Entry ends = out.group("ends");
  ends.show("backward", "why the side towards smaller values ended", branch.ends.backward);
  ends.show("forward", "why the side towards larger values ended", branch.ends.forward);
  out.list("points", add_branch_point, branch.points);
  out.list("events", add_event, branch.events);
  std::vector<SweepPoint> known = report.branch.beside.points;
  std::erase_if(known, [](const SweepPoint& point) { return point.outcome.kind != OutcomeKind::converged; });
  out.list("equilibria", add_equilibrium_point, known);
}

void add_sensitivity(Entry out, const Report& report)
{
  out.show("residual", "-", "largest backward error of right and left vectors", report.sensitivity.outcome.residual);
  out.list("modes", add_causes, report.sensitivity.modes);
}

} // namespace squeal
