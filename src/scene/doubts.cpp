/// A model is 1 cm to 10 m long and weighs at most 100 t: what squeals goes from a bicycle's brake pad to a bogie.
/// Bounds of solids (Ashby, Materials Selection in Mechanical Design, charts of moduli and densities). Densities go
/// from 20 kg/m3 (foams) to 22 590 (osmium), Young's moduli from 1e4 Pa (gels) to 1.3e12 (diamond). Speeds of
/// sound sqrt(E/rho) go from 10 m/s (soft rubber has 30) to 20 000 (diamond has 18 000). A grain of dust of 10 um
/// weighs 1e-12 kg.
#include "squeal/scene/scene.hpp"

#include "squeal/base/error.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr double softest = 1e4;                // Young's modulus of gels [Pa]
constexpr double longest = 10, heaviest = 1e5; // [m], [kg]

bool is_outside(double value, double least, double greatest)
{
  return value < least || value > greatest;
}

/// What is implausible about a material; empty if nothing is.
std::string doubt_about(const Material& material, double young)
{
  const double speed = std::sqrt(young / material.density);
  if (is_outside(material.density, 20, 23000))
    return format("a density of %g kg/m3 is that of no solid; steel has 7850", material.density);
  if (is_outside(young, softest, 1.3e12))
    return format("a Young's modulus of %g Pa is that of no solid; steel has 2.1e11", young);
  if (is_outside(speed, 10, 20000))
    return format("sound would travel at %.3g m/s by its modulus and density; in steel it does at 5200", speed);
  return {};
}

/// Bodies whose mass is there but can move nothing.
template <class Body> void doubt_masses(const std::vector<Body>& bodies, std::vector<std::string>& doubts)
{
  constexpr double dust = 1e-12; // [kg]
  for (const Body& body : bodies)
    if (body.mass > 0 && body.mass < dust)
      doubts.push_back(format("'%s': a mass of %g kg is less than a grain of dust's. Is its unit kg?",
                              shortened(body.name).c_str(), body.mass));
}

/// Loads that do nothing or pull.
void doubt_loads(const Scene& scene, std::vector<std::string>& doubts)
{
  for (const Force& force : scene.forces)
    if (force.vector == Vec3{} && force.moment == Vec3{})
      doubts.push_back("the force on '" + shortened(force.on) + "' is 0 N");
  for (const Pressure& pressure : scene.pressures)
    if (pressure.value == 0) doubts.push_back("the pressure on '" + shortened(pressure.on) + "' is 0 Pa");
  const std::vector<double>& factors = scene.transient.ramps.load.value;
  if (std::ranges::any_of(factors, [](double factor) { return factor < 0; }))
    doubts.push_back("[transient] load_factor falls below 0: all loads then act the other way round");
}

/// Gaps longer than the model, and layers softer than one of the softest gel that is as thick as the model is long.
void doubt_contacts(const Scene& scene, double length, std::vector<std::string>& doubts)
{
  for (const Contact& contact : scene.contacts)
  {
    const std::string label =
        "the contact of '" + shortened(contact.rotor) + "' and '" + shortened(contact.stator) + "': ";
    if (std::abs(contact.gap) > length)
      doubts.push_back(label + format("a gap of %g m is longer than the model, which has %.3g m. Is its unit m?",
                                      contact.gap, length));
    const bool of_points =
        std::ranges::any_of(scene.points, [&](const Point& point) { return point.name == contact.rotor; });
    if (!of_points && contact.compliance * softest > length)
      doubts.push_back(
          label + format("a compliance of %g m3/N is that of no layer: steel 1 mm thick has 4.8e-15. Is its unit m3/N?",
                         contact.compliance));
  }
}

void doubt_cycle(const Scene& scene, std::vector<std::string>& doubts)
{
  if (scene.cycle.enabled && scene.fidelity == CycleModel::reduced && scene.cycle.tolerance > 0 && !scene.branch)
    doubts.push_back("cycle.tolerance is for the full model's shooting: with fidelity = \"reduced\" nothing uses it, "
                     "and accuracy decides");
}

/// Whether contacts may feed a structure of parts in which nothing takes energy.
bool has_no_damping(const Scene& scene)
{
  const auto damps = [](const RayleighDamping& damping) { return damping.alpha > 0 || damping.beta > 0; };
  return !scene.parts.empty() && !scene.contacts.empty() && scene.superelements.empty() && !damps(scene.damping) &&
         scene.damping.loss_frequency == 0 &&
         std::ranges::none_of(scene.parts, [&](const Part& part) { return part.damping && damps(*part.damping); }) &&
         std::ranges::none_of(scene.springs, [](const Spring& spring) { return spring.damping > 0; }) &&
         std::ranges::all_of(scene.connectors, [](const Connector& joint) { return joint.damping.empty(); });
}

} // namespace

std::vector<std::string> doubts_about(const Scene& scene, double length, double mass)
{
  std::vector<std::string> doubts;
  for (const Part& part : scene.parts)
  {
    const Material& material = part.material;
    const double young = material.orthotropy ? *std::ranges::max_element(material.orthotropy->young) : material.young;
    if (const std::string doubt = doubt_about(material, young); !doubt.empty())
      doubts.push_back("part '" + part.name + "': " + doubt + ". Are its units Pa and kg/m3?");
  }
  doubt_masses(scene.points, doubts);
  doubt_masses(scene.rigid_bodies, doubts);
  doubt_loads(scene, doubts);
  if (scene.mesh && (length > longest || mass > heaviest))
    doubts.push_back(format("the model is %.3g m long and weighs %.3g kg: is its mesh in mm? then mesh.scale = 0.001",
                            length, mass));
  else if (scene.mesh && length > 0 && length < 0.01)
    doubts.push_back(format("the model is %.3g m long: is mesh.scale right?", length));
  for (const auto& [name, value] : scene.numbers)
    if (std::ranges::find(scene.number_uses, name, &NumberUse::name) == scene.number_uses.end())
      doubts.push_back("the number '" + name + "' of [numbers] stands nowhere in the scene");
  if (has_no_damping(scene))
    doubts.push_back("nothing damps the structure: modes that friction couples grow at any friction; give [damping]");
  if (length > 0) doubt_contacts(scene, length, doubts);
  doubt_cycle(scene, doubts);
  return doubts;
}

} // namespace squeal
