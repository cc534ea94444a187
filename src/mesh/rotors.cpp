/// Rotors of a scene: which contacts have their surfaces.
#include "squeal/base/error.hpp"
#include "squeal/mesh/shapes.hpp"

#include <algorithm>

namespace squeal
{

std::string part_of(const Scene& scene, const Mesh& mesh, const std::string& surface)
{
  if (mesh.points.contains(surface)) return surface;
  const auto faces = mesh.surfaces.find(surface);
  if (faces == mesh.surfaces.end() || faces->second.empty()) return {};
  const std::span<const int> face = nodes_of(faces->second.front());
  for (const Element& element : mesh.elements)
  {
    const std::span<const int> nodes = nodes_of(element);
    if (std::ranges::all_of(face, [&](int node) { return std::ranges::find(nodes, node) != nodes.end(); }))
      return scene.parts[static_cast<std::size_t>(element.part)].name;
  }
  return {};
}

std::vector<int> rotors_of_contacts(const Scene& scene, const Mesh& mesh)
{
  std::vector<int> rotors;
  const auto rotor_of = [&](const std::string& surface)
  {
    const auto rotor = std::ranges::find(scene.rotors, part_of(scene, mesh, surface), &Rotor::part);
    return rotor == scene.rotors.end() ? -1 : static_cast<int>(rotor - scene.rotors.begin());
  };
  for (const Contact& contact : scene.contacts)
  {
    rotors.push_back(rotor_of(contact.rotor));
    if (const int other = rotor_of(contact.stator); other >= 0 && rotors.back() < 0)
      throw Error("[[contact]] of " + contact.stator + " on " + contact.rotor + ": [[rotor]] " +
                  scene.rotors[static_cast<std::size_t>(other)].part + " has the surface " + contact.stator +
                  ", which the contact names for its stator: exchange rotor and stator");
  }
  return rotors;
}

} // namespace squeal
