#include "squeal/contact/resultants.hpp"

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

} // namespace squeal
