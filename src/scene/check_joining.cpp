/// Checks of couplings, connectors, beams, masses and bolts, of the frames of supports and of loss factors, which
/// involve several keys.
#include "scene_checker.hpp"
#include "squeal/base/error.hpp"
#include "squeal/scene/scene.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace squeal
{

namespace
{

class JoiningChecker : SceneChecker
{
public:
  JoiningChecker(const Scene& scene, const Places& places) : SceneChecker(scene, places) {}

  void check_all() const
  {
    for (const Support& support : scene_.supports) check_support(support);
    for (const Force& force : scene_.forces) check_force(force);
    for (const Coupling& coupling : scene_.couplings) check_coupling(coupling);
    for (const Connector& connector : scene_.connectors) check_connector(connector);
    for (const Beam& beam : scene_.beams) check_beam(beam);
    for (const AddedMass& added : scene_.masses)
      if (!scene_.mesh) need_known(added.on, nodes_, &added.on, "[[mass]] on");
    for (const Bolt& bolt : scene_.bolts) check_bolt(bolt);
    check_steps();
    check_loss();
    check_rest();
  }

private:
  void check_axes(const Frame& frame, const std::string& label) const
  {
    if (std::abs(dot(frame.axis_1, frame.axis_2)) > largest_cosine)
      fail(&frame.axis_2, label + "axis_2 must be square to axis_1");
    if (frame.cylinder && (frame.axis_1 != Frame{}.axis_1 || frame.axis_2 != Frame{}.axis_2))
      fail(&*frame.cylinder, label + "cylinder excludes axis_1 and axis_2: keep one of them");
  }

  void check_support(const Support& support) const
  {
    const std::string label = "[[support]] " + support.on + " ";
    check_axes(support.frame, label);
    const auto need_fixed = [&](const Vec3& moved, std::size_t first, const char* key)
    {
      for (std::size_t c = 0; c < 3; ++c)
        if (moved[c] != 0 && !support.fixed[first + c])
          fail(&moved, label + key + " moves " + motion_words[first + c] +
                           ", which 'fixed' does not name: name it there, or leave it at 0");
    };
    need_fixed(support.displacement, 0, "displacement");
    need_fixed(support.rotation, 3, "rotation");
    if (scene_.matrices && !is_plain(support))
      fail(&support, label + "of a matrix scene holds rows as they are: take axes, displacement and rotation out");
  }

  void check_force(const Force& force) const
  {
    if (!places_.given.contains(&force.vector) && !places_.given.contains(&force.moment))
      fail(&force, "[[force]] on " + force.on + " needs the key 'vector' [N] or 'moment' [N m]");
    if (scene_.matrices && force.moment != Vec3{})
      fail(&force.moment, "[[force]] " + force.on +
                              ": a matrix scene has rows: name that of the rotation, dof:N, and "
                              "write vector = [value, 0, 0]");
  }

  void check_coupling(const Coupling& coupling) const
  {
    if (!coupling.weights.empty() && coupling.weights.size() != coupling.on.size())
      fail(&coupling.weights, "[[coupling]] " + coupling.name + " weights holds " +
                                  std::to_string(coupling.weights.size()) + " numbers for " +
                                  std::to_string(coupling.on.size()) + " groups: give one each");
    for (const std::string& on : coupling.on)
      if (!scene_.mesh) need_known(on, points_, &coupling.on, "[[coupling]] on");
  }

  void check_matrix(const std::vector<double>& values, const std::string& label) const
  {
    if (values.empty() || values.size() == 6) return;
    if (values.size() != 36) fail(&values, label + "holds " + std::to_string(values.size()) + " numbers: give 6 or 36");
    for (std::size_t i = 0; i < 6; ++i)
      for (std::size_t j = 0; j < i; ++j)
        if (values[6 * i + j] != values[6 * j + i])
          fail(&values, label + format("is not symmetric in row %zu, column %zu", i + 1, j + 1));
  }

  void check_connector(const Connector& connector) const
  {
    const std::string label = "[[connector]] from " + connector.from + " to " + connector.to + " ";
    need_known(connector.from, nodes_, &connector.from, "[[connector]] from");
    if (connector.to != ground) need_known(connector.to, nodes_, &connector.to, "[[connector]] to");
    if (connector.from == connector.to) fail(&connector.to, label + "joins a body to itself; it would do nothing");
    check_axes(connector.frame, label);
    check_matrix(connector.stiffness, label + "stiffness ");
    check_matrix(connector.damping, label + "damping ");
    if (connector.locked == Motions{} && connector.stiffness.empty() && connector.damping.empty())
      fail(&connector, label + "has neither locked motions nor stiffness nor damping");
  }

  void check_beam(const Beam& beam) const
  {
    const std::string label = "[[beam]] " + beam.name + " ";
    need_known(beam.from, nodes_, &beam.from, label + "from");
    need_known(beam.to, nodes_, &beam.to, label + "to");
    if (beam.from == beam.to) fail(&beam.to, label + "has the same point at both ends");
    if (beam.bending.size() > 2) fail(&beam.bending, label + "bending: give one or two numbers");
    const bool numbers = beam.area > 0 || beam.torsion > 0 || !beam.bending.empty();
    if (beam.diameter > 0 && numbers)
      fail(&beam.diameter, label + "diameter excludes area, bending and torsion: keep one of them");
    if (beam.diameter == 0 && !(beam.area > 0 && beam.torsion > 0 && !beam.bending.empty()))
      fail(&beam, label + "needs the key 'diameter' [m], or 'area', 'bending' and 'torsion'");
  }

  void check_bolt(const Bolt& bolt) const
  {
    const std::string label = "[[bolt]] " + bolt.name + " ";
    if (bolt.section.empty() == bolt.beam.empty()) fail(&bolt, label + "needs one of the keys 'section' and 'beam'");
    if (!bolt.beam.empty()) need_known(bolt.beam, names_of(scene_.beams), &bolt.beam, label + "beam");
    if (!bolt.section.empty() && !scene_.mesh) fail(&bolt.section, label + "section needs a [mesh]; name a beam");
    if (!bolt.section.empty() && bolt.axis == Vec3{})
      fail(&bolt, label + "needs the key 'axis', the direction of the shank at the section");
  }

  /// Nothing loads a structure at rest, and no load factor scales a preload.
  void check_rest() const
  {
    if (has_preload(scene_) && scene_.transient.enabled && scene_.transient.start.kind == StartKind::rest)
      fail(&scene_.transient.start,
           "[transient] start = \"rest\" is a structure that nothing loads: bolts, gravity and "
           "moved supports would let it jump; start from the equilibrium");
  }

  void check_steps() const
  {
    const std::vector<std::string> known = names_of(scene_.bolts);
    std::set<std::string> tightened;
    for (const LoadStep& step : scene_.steps)
      for (const std::string& name : step.bolts)
      {
        need_known(name, known, &step.bolts, "[[step]] " + step.name + " bolts");
        tightened.insert(name);
      }
    if (!tightened.empty() && tightened.size() < known.size())
      fail(&scene_.steps.front(),
           "[[step]] bolts: no step tightens " +
               *std::ranges::find_if(known, [&](const std::string& name) { return !tightened.contains(name); }) +
               ": name it in one of them");
  }

  void check_loss() const
  {
    constexpr double largest_loss = 10; // rubbers at their glass transition reach 2
    const double frequency = scene_.damping.loss_frequency;
    const double* lossy = nullptr;
    const auto look = [&](const auto& list, const std::string& table)
    {
      for (const auto& entry : list)
      {
        if (entry.loss_factor > largest_loss)
          fail(&entry.loss_factor,
               format("%s loss_factor = %g is no material's: those of rubber reach 2; give a number up to %g",
                      label_of_loss(table, entry).c_str(), entry.loss_factor, largest_loss));
        if (entry.loss_factor > 0 && frequency == 0)
          fail(&entry.loss_factor, label_of_loss(table, entry) +
                                       " loss_factor needs [damping] loss_frequency, at which time steps and the "
                                       "estimate take its viscous equivalent: give the squeal's frequency");
        if (entry.loss_factor > 0) lossy = &entry.loss_factor;
      }
    };
    look(scene_.parts, "part");
    look(scene_.connectors, "connector");
    look(scene_.beams, "beam");
    if (!lossy && frequency > 0)
      fail(&scene_.damping.loss_frequency, "[damping] loss_frequency belongs to a [[part]] with a loss_factor: give "
                                           "one, or take it out");
  }

  template <class Entry> static std::string label_of_loss(const std::string& table, const Entry& entry)
  {
    if constexpr (requires { entry.name; })
      return "[[" + table + "]] " + entry.name;
    else
      return "[[" + table + "]] from " + entry.from + " to " + entry.to;
  }
};

} // namespace

void check_joining(const Scene& scene, const Places& places)
{
  JoiningChecker(scene, places).check_all();
}

// A model is 1 cm to 10 m long and weighs at most 100 t: what squeals goes from a bicycle's brake pad to a bogie.
// Bounds of solids (Ashby, Materials Selection in Mechanical Design, charts of moduli and densities). Densities go
// from 20 kg/m3 (foams) to 22 590 (osmium), Young's moduli from 1e4 Pa (gels) to 1.3e12 (diamond). Speeds of
// sound sqrt(E/rho) go from 10 m/s (soft rubber has 30) to 20 000 (diamond has 18 000). A grain of dust of 10 um
// weighs 1e-12 kg.

namespace
{

constexpr double softest = 1e4;                // Young's modulus of gels [Pa]
constexpr double longest = 10, heaviest = 1e5; // [m], [kg]

bool is_outside(double value, double least, double greatest)
{
  return value < least || value > greatest;
}

/// A sentence about an implausible material; empty: it is plausible.
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
  const auto slides_smoothly = [](const Contact& contact) { return !is_undriven(contact) && !contact.friction; };
  if (std::max(scene.friction.coefficient, scene.friction.static_coefficient) == 0 && !scene.sweep &&
      std::ranges::any_of(scene.contacts, slides_smoothly))
    doubts.push_back("contacts slide without friction: [friction] coefficient is 0");
  if (length > 0) doubt_contacts(scene, length, doubts);
  if (scene.cycle.enabled && scene.fidelity == CycleModel::reduced && scene.cycle.tolerance > 0 && !scene.branch)
    doubts.push_back("cycle.tolerance is for the full model's shooting: with fidelity = \"reduced\" nothing uses it, "
                     "and accuracy decides");
  return doubts;
}

} // namespace squeal
