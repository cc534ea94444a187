/// Checks of couplings, connectors, beams, masses and bolts, of the frames of supports and of loss factors, which
/// involve several keys.
#include "scene_checker.hpp"

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

} // namespace squeal
