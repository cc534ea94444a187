#include "squeal/contact/interface.hpp"

#include <algorithm>

namespace squeal
{

std::vector<ContactResultant> contact_resultants(const Interface& interface, const std::vector<double>& reactions,
                                                 const std::vector<Contact>& contacts)
{
  std::vector<ContactResultant> resultants(contacts.size());
  std::vector<int> pairs(contacts.size());
  const PairView view(reactions, interface.directions);
  const TangentView drive(interface.drive, interface.directions);
  for (std::size_t i = 0; i < interface.geometry.size(); ++i)
  {
    const auto contact = static_cast<std::size_t>(interface.geometry[i].contact);
    resultants[contact].normal_force += view.normal(i);
    resultants[contact].closed_share += view.normal(i) > 0;
    ++pairs[contact];
    const auto& rotation = contacts[contact].rotation;
    if (rotation && rotation->rate != 0)
      resultants[contact].torque += dot(view.tangential(i), drive.of(i)) / rotation->rate;
  }
  for (std::size_t c = 0; c < contacts.size(); ++c) resultants[c].closed_share /= std::max(pairs[c], 1);
  return resultants;
}

std::vector<double> past_sliding(PairView<const double> velocity, TangentView<const double> drive,
                                 const std::vector<ContactStatus>& status, double weight)
{
  std::vector<double> result(velocity.size(), 0.);
  const PairView past(result, velocity.directions());
  for (std::size_t i = 0; i < status.size(); ++i)
    for (std::size_t k = 0; status[i] != ContactStatus::stick && k < past.tangential(i).size(); ++k)
      past.tangential(i)[k] = weight * (velocity.tangential(i)[k] - drive.of(i)[k]);
  return result;
}

bool leave_out_where_turned(PairView<const double> r, PairView<const double> w, PairView<double> past)
{
  bool any = false;
  for (std::size_t i = 0; i < r.pairs(); ++i)
  {
    const std::span<double> before = past.tangential(i);
    if (r.normal(i) <= 0 || dot(w.tangential(i), before) >= dot(before, before)) continue;
    std::fill(before.begin(), before.end(), 0.);
    any = true;
  }
  return any;
}

PairFriction at_release(PairFriction friction, PairView<const double> last, PairView<const double> before)
{
  constexpr double more = 1 + 1e-6; // than in sliding
  if (!any_law(friction, has_two_levels)) return friction;
  for (std::size_t i = 0; i < before.pairs(); ++i)
  {
    FrictionLaw law = friction.of(i);
    if (!has_two_levels(law) || last.normal(i) <= 0 || before.normal(i) <= 0) continue;
    const auto use = [&](PairView<const double> r)
    { return length(r.tangential(i)) / (law.static_coefficient * r.normal(i)); };
    const double now = use(last), rise = now - use(before);
    if (rise <= 0 || now * law.static_coefficient <= more * law.coefficient) continue;
    const double part = std::clamp((1 - now) / rise - 0.5, -0.5, 0.5); // of the step, less what the last one held
    law.coefficient = std::max(0., law.coefficient + part * (law.static_coefficient - law.coefficient));
    friction.number_of_own.resize(before.pairs(), -1);
    friction.number_of_own[i] = static_cast<int>(friction.own.size());
    friction.own.push_back(law);
  }
  return friction;
}

PairFriction sliding_on(const PairFriction& friction, PairView<const double> past)
{
  if (!any_law(friction, has_two_levels)) return friction;
  const auto without_rest = [](FrictionLaw& law) { law.static_coefficient *= law.decay_speed > 0; };
  return changed(friction, past.pairs(), without_rest, [&](std::size_t pair) { return !opposes_end(past, pair); });
}

bool opposes_end(PairView<const double> past, std::size_t pair)
{
  const std::span<const double> before = past.tangential(pair);
  return std::all_of(before.begin(), before.end(), [](double component) { return component == 0; });
}

} // namespace squeal
