#include "squeal/contact/resultants.hpp"

namespace squeal
{

std::vector<ContactResultant> contact_resultants(const Interface& interface, const std::vector<double>& reactions,
                                                 const std::vector<Contact>& contacts)
{
  std::vector<ContactResultant> resultants(contacts.size());
  const PairView view(reactions, interface.directions);
  const TangentView drive(interface.drive, interface.directions);
  for (std::size_t i = 0; i < interface.geometry.size(); ++i)
  {
    const auto contact = static_cast<std::size_t>(interface.geometry[i].contact);
    resultants[contact].normal_force += view.normal(i);
    const auto& rotation = contacts[contact].rotation;
    if (rotation && rotation->rate != 0)
      resultants[contact].torque += dot(view.tangential(i), drive.of(i)) / rotation->rate;
  }
  return resultants;
}

} // namespace squeal
