#include "squeal/contact/resultants.hpp"

namespace squeal
{

std::vector<ContactResultant> contact_resultants(const Interface& interface, const std::vector<double>& reactions,
                                                 const std::vector<Contact>& contacts)
{
  std::vector<ContactResultant> resultants(contacts.size());
  const auto directions = static_cast<std::size_t>(interface.directions);
  for (std::size_t i = 0; i < interface.contact.size(); ++i)
  {
    const auto contact = static_cast<std::size_t>(interface.contact[i]);
    const double* r = &reactions[i * (1 + directions)];
    resultants[contact].normal_force += r[0];
    const auto& rotation = contacts[contact].rotation;
    if (!rotation || rotation->rate == 0) continue;
    for (std::size_t k = 0; k < directions; ++k)
      resultants[contact].torque += r[1 + k] * interface.drive[i * directions + k] / rotation->rate;
  }
  return resultants;
}

} // namespace squeal
