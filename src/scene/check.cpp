/// Checks of a scene that involve several keys: tables that exclude each other, undefined or repeated names, numbers
/// that contradict each other.
#include "scene_checker.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <set>

namespace squeal
{

namespace
{

class Checker : SceneChecker
{
public:
  Checker(const Scene& scene, const Places& places) : SceneChecker(scene, places) {}

  void check_all() const
  {
    if (scene_.matrices) check_matrix_scene();
    check_names();
    for (const Support& support : scene_.supports)
      if (support.fixed == Motions{}) fail(&support.fixed, "[[support]] " + support.on + " fixed holds nothing still");
    for (const Part& part : scene_.parts) check_material(part);
    for (const Spring& spring : scene_.springs) check_spring(spring);
    if (!scene_.mesh && !scene_.matrices)
    {
      for (const Support& support : scene_.supports) need_known(support.on, points_, &support.on, "[[support]] on");
      for (const Force& force : scene_.forces) need_known(force.on, nodes_, &force.on, "[[force]] on");
    }
    for (const Rotor& rotor : scene_.rotors) check_rotor(rotor);
    for (const Contact& contact : scene_.contacts) check_contact(contact);
    check_contacts_differ();
    check_steps();
    for (const InitialMotion& initial : scene_.initial) check_initial(initial);
    for (const Tie& tie : scene_.ties)
      if (tie.slave == tie.master)
        fail(&tie.master, "[[tie]] slave and master are both \"" + tie.slave + "\"; name two surfaces");
    for (const Probe& probe : scene_.probes) check_probe(probe);
    check_law(scene_.friction, &scene_.friction.decay_speed, "[friction]");
    check_damping();
    check_joining(scene_, places_);
    check_transient();
    check_cycle();
    if (scene_.response) check_response(*scene_.response);
  }

  /// The structure is of one kind.
  void check_source() const
  {
    const Scene& s = scene_;
    if (s.mesh && s.matrices) fail(&*s.matrices, "[mesh] and [matrices] exclude each other: keep one");
    if (!s.mesh && !s.matrices && s.points.empty())
      throw Error(places_.file + ": the scene has no structure: give [mesh], [matrices] or [[point]]");
    if (s.mesh && s.parts.empty())
      fail(&*s.mesh, "a mesh needs at least one [[part]] that gives a named group its material");
  }

private:
  void check_matrix_scene() const
  {
    const Scene& s = scene_;
    if (s.gravity != Vec3{})
      fail(&s.gravity, "gravity belongs to mesh and point scenes; in a matrix scene the folder's files hold it");
    for (const Support& support : s.supports)
    {
      const bool row = !need_rows(support.on, "[[support]] on").nodes;
      if (row && std::ranges::count(support.fixed, true) < 6)
        fail(&support.fixed, "[[support]] " + support.on + ": a row is one motion; write fixed = \"all\"");
    }
    for (const Force& force : s.forces)
    {
      const bool row = !need_rows(force.on, "[[force]] on").nodes;
      if (row && (force.vector[1] != 0 || force.vector[2] != 0))
        fail(&force.vector, "[[force]] " + force.on + ": a row is one motion; write vector = [value, 0, 0]");
    }
  }

  /// Returns the rows of a matrix scene that a text names. Throws Error if it is of another form.
  RowNames need_rows(const std::string& on, const std::string& key) const
  {
    const auto names = row_names(on);
    if (!names)
      fail(&on, key + " = \"" + on +
                    "\": a matrix scene knows rows, dof:N, and nodes, node:N, of its matrices; lists " +
                    "and ranges are written node:3,8,20-40");
    return *names;
  }

  void check_names() const
  {
    for (const auto& [name, value] : scene_.numbers)
      if (!std::isalpha(static_cast<unsigned char>(name[0])) ||
          !std::ranges::all_of(name, [](unsigned char c) { return std::isalnum(c) || c == '_'; }))
        fail(&scene_.numbers, "[numbers] '" + name + "': a name begins with a letter, and holds letters, digits and _");
  }

  void check_material(const Part& part) const
  {
    const Material& material = part.material;
    const std::string label = "[[part]] " + part.name + " ";
    if (part.rotation && part.thickness > 0)
      fail(&*part.rotation, label + "rotation is for solids: mesh the shell by solids, or take the rotation out");
    if (part.rotation && material.orthotropy)
      fail(&*part.rotation, label + "rotation needs a material that is alike in all directions: the axes of an "
                                    "orthotropic one would turn; give young and poisson");
    if (part.offset != 0 && part.thickness == 0)
      fail(&part.offset, label + "offset is for shells: give the part a thickness, or take the offset out");
    if (!material.orthotropy)
    {
      if (!(material.young > 0)) fail(&material.young, label + "needs the key 'young' [Pa] above 0, or 'orthotropic'");
      if (!places_.given.count(&material.poisson))
        fail(&part, label + "needs the key 'poisson' [-], or 'orthotropic' instead of it and of 'young'");
      return;
    }
    const Orthotropy& o = *material.orthotropy;
    if (material.young != 0 || material.poisson != 0)
      fail(&*material.orthotropy, label + "orthotropic excludes young and poisson: keep one of them");
    if (part.thickness > 0)
      fail(&*material.orthotropy, label + "orthotropic is for solids: give a shell young and poisson");
    for (const Vec3* moduli : {&o.young, &o.shear})
      if (!(std::min({(*moduli)[0], (*moduli)[1], (*moduli)[2]}) > 0))
        fail(moduli, label + "orthotropic: all of young and shear must be above 0");
    if (std::abs(dot(o.axis_1, o.axis_2)) > largest_cosine)
      fail(&o.axis_2, label + "orthotropic: axis_2 must be square to axis_1");
    if (!is_stable(o))
      fail(&o.poisson, label + "orthotropic: with these ratios a load would do negative work; nu12 sqrt(E2/E1) and its "
                               "like must be below 1, and not all near it");
  }

  /// Whether the compliance of direct stresses is positive definite: by the ratios b_ij = nu_ij sqrt(E_j/E_i).
  static bool is_stable(const Orthotropy& o)
  {
    const double b12 = o.poisson[0] * std::sqrt(o.young[1] / o.young[0]),
                 b13 = o.poisson[1] * std::sqrt(o.young[2] / o.young[0]),
                 b23 = o.poisson[2] * std::sqrt(o.young[2] / o.young[1]);
    return std::abs(b12) < 1 && 1 - b12 * b12 - b13 * b13 - b23 * b23 - 2 * b12 * b13 * b23 > 0;
  }

  void check_spring(const Spring& spring) const
  {
    std::vector<std::string> ends = nodes_;
    ends.push_back(ground);
    if (!scene_.mesh) // whose groups are known later
    {
      need_known(spring.from, ends, &spring.from, "[[spring]] from");
      need_known(spring.to, ends, &spring.to, "[[spring]] to");
    }
    if (spring.from == spring.to)
      fail(&spring.from, "[[spring]] from and to are both \"" + spring.from + "\"; it would do nothing");
    if (spring.stiffness == 0 && spring.damping == 0)
      fail(&spring.from, "[[spring]] " + spring.from + " has neither stiffness nor damping");
  }

  bool is_point(const std::string& name) const { return std::ranges::find(points_, name) != points_.end(); }

  void check_contact(const Contact& contact) const
  {
    if (contact.rotor == contact.stator)
      fail(&contact.stator, "[[contact]] rotor and stator are both \"" + contact.rotor + "\"; name two surfaces");
    if (!scene_.mesh || is_point(contact.rotor) != is_point(contact.stator))
    {
      need_known(contact.rotor, points_, &contact.rotor, "[[contact]] rotor");
      need_known(contact.stator, points_, &contact.stator, "[[contact]] stator");
    }
    if (is_point(contact.rotor) && !contact.normal)
      fail(&contact.rotor, "[[contact]] between points needs the key 'normal', out of the rotor into the stator");
    if (contact.rotation && contact.velocity != Vec3{})
      fail(&contact.velocity, "[[contact]] rotation and velocity exclude each other: keep one");
    if (contact.friction) check_law(*contact.friction, &contact.friction, "[[contact]]");
    if (contact.slip_compliance > 0) check_elastic_slip(contact);
    check_frame(contact);
  }

  void check_rotor(const Rotor& rotor) const
  {
    const std::string label = "[[rotor]] " + rotor.part + " ";
    std::vector<std::string> known = names_of(scene_.parts);
    known.insert(known.end(), points_.begin(), points_.end());
    need_known(rotor.part, known, &rotor.part, "[[rotor]] part");
    if (std::ranges::count(scene_.rotors, rotor.part, &Rotor::part) > 1)
      fail(&rotor.part, label + "is there twice: one part moves in one way; keep one of the tables");
    const bool turns = rotor.rotation.axis != Vec3{}, moves = rotor.velocity != Vec3{};
    if (turns == moves || (rotor.rotation.rate != 0 && !turns))
      fail(&rotor,
           label + (turns ? "has a rate and a velocity: keep one of them" : "needs axis and rate, or a velocity"));
  }

  void check_elastic_slip(const Contact& contact) const
  {
    const auto refuse = [&](const char* why)
    { fail(&contact.slip_compliance, "[[contact]] slip_compliance " + std::string(why)); };
    if (!is_undriven(contact)) refuse("is of contacts that stick: one with a rotation or velocity slides");
    if (depends_on_speed(contact.friction ? *contact.friction : scene_.friction))
      refuse("goes with a friction that does not change with the speed: give the contact its own, without "
             "static_coefficient and factor_at_speed");
    if (scene_.cycle.enabled) refuse("is not known to cycles: take it out, or [cycle]");
  }

  /// Two contacts of the same surfaces would share their pressure in no particular way.
  void check_contacts_differ() const
  {
    std::set<std::pair<std::string, std::string>> known;
    for (const Contact& contact : scene_.contacts)
      if (!known.insert(std::minmax(contact.rotor, contact.stator)).second)
        fail(&contact.rotor, "[[contact]] \"" + contact.rotor + "\" and \"" + contact.stator +
                                 "\" are in contact already; remove one of the two tables");
  }

  /// The last step ends at the scene's own loads and friction, which modes and motions belong to.
  void check_steps() const
  {
    const auto need_factors = [&](const std::vector<double>& factors, std::size_t count, const char* key)
    {
      if (!factors.empty() && factors.size() != count)
        fail(&factors, std::string("[[step]] ") + key + " holds " + std::to_string(factors.size()) +
                           " factors for the scene's " + std::to_string(count) + ": give one each");
    };
    for (const LoadStep& step : scene_.steps)
    {
      need_factors(step.forces, scene_.forces.size(), "forces");
      need_factors(step.pressures, scene_.pressures.size(), "pressures");
    }
    if (scene_.steps.empty()) return;
    const LoadStep& last = scene_.steps.back();
    const auto is_one = [](double factor) { return factor == 1; };
    if (last.load != 1 || last.friction != 1 || !std::ranges::all_of(last.forces, is_one) ||
        !std::ranges::all_of(last.pressures, is_one))
      fail(&last, "[[step]] " + last.name +
                      " is the last one: its factors must be 1, since modes and motions belong to the scene's own "
                      "loads and friction; change these instead");
  }

  void check_initial(const InitialMotion& initial) const
  {
    if (initial.displacement == Vec3{} && initial.velocity == Vec3{})
      fail(&initial, "[[initial]] on " + initial.on + " moves nothing: give displacement or velocity");
    if (!scene_.transient.enabled)
      fail(&initial, "[[initial]] is where the [transient] starts: give that table, or take this one out");
    if (scene_.matrices)
      fail(&initial,
           "[[initial]] is for mesh and point scenes: a matrix scene starts from a state file, [transient] start");
    if (!scene_.mesh) need_known(initial.on, points_, &initial.on, "[[initial]] on");
  }

  void check_law(const FrictionLaw& f, const void* member, const char* table) const
  {
    const auto& at = f.factor_at_speed.at;
    if (!at.empty() && (f.static_coefficient > 0 || f.coefficient == 0 || at.front() < 0))
      fail(member, std::string(table) + " factor_at_speed is on a coefficient above 0, of speeds from 0 on, and takes "
                                        "the place of static_coefficient and decay_speed");
    if (f.decay_speed > 0 && f.static_coefficient == 0)
      fail(member, std::string(table) + " decay_speed needs the static_coefficient from which friction decays");
    if (has_two_levels(f) && f.static_coefficient < f.coefficient)
      fail(member,
           std::string(table) + " static_coefficient without a decay_speed is at least the friction of sliding");
  }

  /// Rayleigh damping is of parts and of given matrices: masses of points and bodies and springs carry none.
  void check_damping() const
  {
    const RayleighDamping& damping = scene_.damping;
    const bool needed =
        !scene_.beams.empty() || std::ranges::any_of(scene_.parts, [](const Part& part) { return !part.damping; });
    if (needed || scene_.matrices || !scene_.superelements.empty()) return;
    const std::string why = scene_.parts.empty()
                                ? "it is of [[part]]s, and the scene has none; give each [[spring]] its damping"
                                : "every [[part]] has an alpha or beta of its own; take one of them out";
    const auto refuse = [&](const void* member, const char* key)
    { fail(member, "[damping] " + std::string(key) + " has no effect: " + why); };
    if (damping.alpha != 0) refuse(&damping.alpha, "alpha");
    if (damping.beta != 0) refuse(&damping.beta, "beta");
  }

  void check_frame(const Contact& contact) const
  {
    const auto& tangents = contact.tangents;
    if (tangents.size() > 2) fail(&contact.tangents, "[[contact]] tangents: give one or two directions");
    if (contact.normal)
      for (const Vec3& tangent : tangents)
        if (std::abs(dot(tangent, *contact.normal)) > largest_cosine)
          fail(&contact.tangents, "[[contact]] tangents must be square to the normal");
    if (tangents.size() == 2 && std::abs(dot(tangents[0], tangents[1])) > largest_cosine)
      fail(&contact.tangents, "[[contact]] the two tangents must be square to each other");
  }

  void check_probe(const Probe& probe) const
  {
    const std::string label = "[[probe]] " + probe.name + " ";
    if (probe.name.empty() || probe.name == "." || probe.name == ".." || probe.name.find('/') != std::string::npos)
      fail(&probe.name, "[[probe]] name = \"" + probe.name +
                            "\": results are stored under the name; give another one, "
                            "without /");
    if (scene_.matrices)
    {
      const RowNames names = need_rows(probe.on, label + "on");
      if (!names.is_single()) fail(&probe.on, label + "on = \"" + probe.on + "\": a probe reads one row or node");
      if (!names.nodes) return;
    }
    else if (row_names(probe.on))
      fail(&probe.on, label + "on = \"" + probe.on + "\": rows and nodes are for matrix scenes; name a point or group");
    if (!scene_.mesh && !scene_.matrices) need_known(probe.on, points_, &probe.on, label + "on");
    if (probe.direction == Vec3{}) fail(&probe.name, label + "needs the key 'direction': x, y, z or a vector");
  }

  void check_transient() const
  {
    const TransientSettings& t = scene_.transient;
    if ((t.steps > 0) != (t.step_size > 0))
      fail(t.steps > 0 ? static_cast<const void*>(&t.steps) : &t.step_size,
           "[transient] steps and step_size go together: give both, or periods and steps_per_period");
    if (t.enabled && t.steps == 0 && t.periods * t.steps_per_period < 0.5)
      fail(&t.periods, "[transient] periods x steps_per_period is less than one time step");
    if (t.enabled && t.start.kind == StartKind::rest && factor_at(t.ramps.load, 0) != 0)
      fail(t.ramps.load.at.empty() ? static_cast<const void*>(&t.start) : &t.ramps.load,
           "[transient] start = \"rest\" is a structure without displacements, which a load would move at once: let "
           "load_factor rise from 0, such as load_factor = [[0, 0], [0.01, 1]]");
  }

  void check_cycle() const
  {
    const CycleSettings& c = scene_.cycle;
    if (c.start.kind == CycleStartKind::transient && c.enabled && !scene_.transient.enabled)
      fail(&c.start, "[cycle] start = 'transient' needs the [transient] that it starts from the end of");
    constexpr double of_rounding = 1e-14; // what the steps of a period leave of the fluctuation
    if (c.tolerance > 0 && c.tolerance < of_rounding)
      fail(&c.tolerance,
           format("[cycle] tolerance = %g is below what rounding leaves: give %g or more", c.tolerance, of_rounding));
    if (!(c.tolerance < 1)) fail(&c.tolerance, "[cycle] tolerance is a part of the fluctuation: give less than 1");
    constexpr int fewest = 8; // show three harmonics
    if (c.steps_per_period > 0 && c.steps_per_period < fewest)
      fail(&c.steps_per_period,
           "[cycle] steps_per_period must be at least " + std::to_string(fewest) + ", or 0, which lets squeal choose");
    if (!(scene_.accuracy < 1)) fail(&scene_.accuracy, "accuracy is a relative error: give less than 1, such as 1e-3");
    if (c.amplitude > 0 && c.start.kind != CycleStartKind::mode)
      fail(&c.amplitude, "[cycle] amplitude belongs to start = \"mode\": give that too, or leave it out");
  }

  void check_response(const ResponseSettings& r) const
  {
    constexpr int most = 100000; // frequencies: ten times what a rig's analyser takes
    const std::vector<std::string> probes = names_of(scene_.probes);
    if (probes.empty()) fail(&r, "[response] needs a [[probe]] where the structure is driven and read");
    for (const std::string& name : r.excitation)
    {
      need_known(name, probes, &r.excitation, "[response] excitation");
      if (std::ranges::count(r.excitation, name) > 1)
        fail(&r.excitation, "[response] excitation names \"" + name + "\" twice; keep one");
    }
    if (r.count < 2 || r.count > most)
      fail(&r.count, "[response] count = " + std::to_string(r.count) + ": give from 2 to " + std::to_string(most));
    if (!(r.from < r.to))
      fail(&r.to, format("[response] goes from %g to %g Hz: give a 'to' above 'from'", r.from, r.to));
  }
};

} // namespace

namespace
{

/// Throws Error for a table that a scene of its kind has no use for, and for a name that is taken.
void check_tables(Scene& scene, const Places& places)
{
  constexpr std::array of_mesh = {"part", "rigid_body", "pressure", "tie"};
  constexpr std::array nodes = {"point", "rigid_body", "coupling"};
  constexpr std::array of_matrices = {"support", "force", "step", "initial", "probe", "change", "uncertain"};
  const auto is_in = [](const auto& tables, const std::string& table)
  { return std::ranges::find(tables, table) != tables.end(); };
  std::map<std::string, std::set<std::string>> taken = {{"node", {ground}}}; // springs refer to the ground
  for (const SceneKey& key : keys_of(scene))
  {
    const auto* table = std::get_if<TableTarget>(&key.target);
    for (std::size_t i = 0; table && table->form == TableForm::list && i < table->size(); ++i)
    {
      const TableEntry entry = table->entry(i);
      if (scene.matrices && !is_in(of_matrices, key.name))
        places.refuse(entry.member, heading_of(key) + " belongs to mesh and point scenes; in a matrix scene the "
                                                      "folder's files hold it");
      if (!scene.matrices && !scene.mesh && is_in(of_mesh, key.name))
        places.refuse(entry.member, heading_of(key) + " needs a [mesh]; without one give [[point]], [[spring]] and "
                                                      "[[force]]");
      if (entry.name.empty() || key.name == "step") continue;
      if (!taken[is_in(nodes, key.name) ? "node" : key.name].insert(entry.name).second)
        places.refuse(std::get<std::string*>(entry.keys.front().target),
                      heading_of(key) + " name = \"" + entry.name + "\" is taken; give another name");
    }
  }
}

} // namespace

void check_scene(Scene& scene, const Places& places)
{
  const Checker checker(scene, places);
  checker.check_source();
  check_tables(scene, places);
  checker.check_all();
}

} // namespace squeal
