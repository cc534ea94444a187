#include "sensitivity_results.hpp"

#include "squeal/base/constants.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace squeal
{

namespace
{

using Json = nlohmann::ordered_json;

double in_hz(double omega)
{
  return omega / two_pi;
}

/// A change of an eigenvalue as one of growth rate and of frequency.
Json change_entry(std::complex<double> lambda)
{
  return {{"growth_rate", lambda.real()}, {"frequency_hz", in_hz(lambda.imag())}};
}

Json number_entry(const NumberDerivative& derivative, const Scene& scene)
{
  const auto& [key, value] = derivative.number;
  Json entry = {{"key", key}, {"name", name_of_number(scene, key)}, {"value", value}};
  entry["known"] = derivative.known;
  if (!derivative.known) return entry;
  entry["growth_rate_by"] = derivative.lambda.real();
  entry["frequency_hz_by"] = in_hz(derivative.lambda.imag());
  return entry;
}

Json mode_entry(const ModeCauses& causes, const Scene& scene)
{
  Json entry = change_entry(causes.lambda);
  entry["backward_error"] = causes.backward_error;
  entry["derivatives"] = Json::array();
  for (const NumberDerivative& derivative : causes.numbers)
    entry["derivatives"].push_back(number_entry(derivative, scene));
  entry["probes"] = Json::array();
  for (std::size_t i = 0; i < causes.probes.size(); ++i)
    entry["probes"].push_back({{"name", scene.probes[i].name},
                               {"growth_rate_by_mass", causes.probes[i].mass.real()},
                               {"growth_rate_by_damping", causes.probes[i].damping.real()},
                               {"growth_rate_by_stiffness", causes.probes[i].stiffness.real()}});
  entry["shares"] = Json::array();
  for (const EnergyShare& share : causes.shares)
    entry["shares"].push_back(
        {{"table", share.table}, {"name", share.name}, {"kinetic", share.kinetic}, {"strain", share.strain}});
  entry["contact_powers"] = causes.contact_powers;
  entry["falling_friction_powers"] = causes.falling_friction_powers;
  entry["turning_friction_powers"] = causes.turning_friction_powers;
  entry["damping_power"] = causes.damping_power;
  entry["power_defect"] = causes.defect;
  entry["changes"] = Json::array();
  for (std::size_t i = 0; i < causes.changes.size(); ++i)
  {
    const Change& change = scene.changes[i];
    Json effect = {{"probe", change.probe},
                   {"mass", change.mass},
                   {"damping", change.damping},
                   {"stiffness", change.stiffness},
                   {"predicted", change_entry(causes.changes[i].predicted)}};
    if (causes.changes[i].found) effect["computed"] = change_entry(causes.changes[i].computed);
    entry["changes"].push_back(effect);
  }
  return entry;
}

/// Derivatives by falling effect of a relative change.
std::vector<NumberDerivative> strongest(const ModeCauses& causes)
{
  std::vector<NumberDerivative> list = causes.numbers;
  std::erase_if(list, [](const NumberDerivative& derivative) { return !derivative.known; });
  const auto effect = [](const NumberDerivative& d) { return std::abs(d.number.value * d.lambda.real()); };
  std::stable_sort(list.begin(), list.end(), [&](const auto& a, const auto& b) { return effect(a) > effect(b); });
  return list;
}

/// What holds most of an energy.
std::string shares_text(std::vector<EnergyShare> shares, double EnergyShare::*energy)
{
  constexpr std::size_t shown = 4;
  constexpr double least = 0.005;
  std::erase_if(shares, [&](const EnergyShare& share) { return share.*energy < least; });
  std::ranges::stable_sort(shares, std::greater(), energy);
  if (shares.size() > shown) shares.resize(shown);
  std::string text;
  for (const EnergyShare& share : shares)
    text += format("%s%s %.0f %%", text.empty() ? "" : ", ", (share.name.empty() ? share.table : share.name).c_str(),
                   100 * share.*energy);
  return text;
}

std::string sum_text(const std::vector<double>& powers)
{
  std::string text;
  for (const double power : powers) text += format("%s%.5g", text.empty() ? "" : " + ", power);
  return text;
}

/// What is added.
std::string change_text(const Change& change)
{
  std::string text;
  for (const auto& [value, unit] : {std::pair{change.mass, "kg"}, {change.damping, "N s/m"}, {change.stiffness, "N/m"}})
    if (value != 0) text += format("%s%g %s", text.empty() ? "" : " and ", value, unit);
  return text;
}

/// What friction puts in beside the reactions, if anything.
std::string friction_text(const ModeCauses& causes)
{
  const auto any = [](double power) { return power != 0; };
  std::string text;
  if (std::ranges::any_of(causes.falling_friction_powers, any))
    text += ", friction that falls with speed " + sum_text(causes.falling_friction_powers);
  if (std::ranges::any_of(causes.turning_friction_powers, any))
    text += ", friction that turns " + sum_text(causes.turning_friction_powers);
  return text;
}

} // namespace

void add_sensitivity(const Sensitivity& sensitivity, const Scene& scene, Json& entry)
{
  entry["residual"] = sensitivity.outcome.residual;
  entry["modes"] = Json::array();
  for (const ModeCauses& causes : sensitivity.modes) entry["modes"].push_back(mode_entry(causes, scene));
}

std::vector<std::string> sensitivity_lines(const Sensitivity& sensitivity, const Scene& scene)
{
  constexpr std::size_t modes_shown = 3, numbers_shown = 6;
  std::vector<std::string> lines;
  for (std::size_t m = 0; m < std::min(modes_shown, sensitivity.modes.size()); ++m)
  {
    const ModeCauses& causes = sensitivity.modes[m];
    lines.push_back(format("%.7g Hz, growth %.6g 1/s: contacts put in %s 1/s of the energy%s, damping takes %.5g 1/s",
                           in_hz(causes.lambda.imag()), causes.lambda.real(), sum_text(causes.contact_powers).c_str(),
                           friction_text(causes).c_str(), causes.damping_power));
    lines.push_back("  kinetic energy: " + shares_text(causes.shares, &EnergyShare::kinetic) +
                    "; strain energy: " + shares_text(causes.shares, &EnergyShare::strain));
    const std::vector<NumberDerivative> list = strongest(causes);
    for (std::size_t i = 0; i < std::min(numbers_shown, list.size()); ++i)
      lines.push_back(format("  1 %% of %-28s moves the growth by %+.4g 1/s, the frequency by %+.4g Hz",
                             label_of_number(scene, list[i].number.key).c_str(),
                             0.01 * list[i].number.value * list[i].lambda.real(),
                             0.01 * list[i].number.value * in_hz(list[i].lambda.imag())));
    for (std::size_t i = 0; i < causes.changes.size(); ++i)
      lines.push_back(format("  %s at %s: growth %.6g 1/s predicted", change_text(scene.changes[i]).c_str(),
                             scene.changes[i].probe.c_str(), causes.changes[i].predicted.real()) +
                      (causes.changes[i].found ? format(", %.6g 1/s computed", causes.changes[i].computed.real())
                                               : std::string(", not found")));
  }
  return lines;
}

} // namespace squeal
