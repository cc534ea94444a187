/// The keys of a scene and of the tables of its model, and headings, labels and absent values of the tree. Functions
/// keys_of stand outside of the unnamed namespace: the templates before them find them by the type of the argument.
#include "scene_keys.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

using enum Need;
using enum Rule;
using enum Effect;
using Study::derive, Study::double_it, Study::derive_and_double;

template <class Entry> std::string title_of(const Entry& entry)
{
  if constexpr (requires { entry.name; })
    return entry.name;
  else if constexpr (requires { entry.part; })
    return entry.part;
  else if constexpr (requires { entry.stator; })
    return entry.stator + " on " + entry.rotor;
  else if constexpr (
      requires { entry.direction, entry.to; } || requires { entry.locked, entry.to; })
    return entry.from + " to " + entry.to;
  else if constexpr (requires { entry.on; })
    return "on " + entry.on;
  else
    return {};
}

SceneKeys keys_of(std::filesystem::path& matrices)
{
  return {{"folder", &matrices, "path",
           "folder of M K B gap drive, each with the ending .petsc; C F G H compliance dofs.txt may be there", required,
           folder}};
}

template <class Entry> TableEntry entry_of(Entry& entry)
{
  std::string name;
  if constexpr (requires { entry.name; }) name = entry.name;
  return {&entry, name, title_of(entry), keys_of(entry)};
}

template <class Entry> TableTarget table_of(std::vector<Entry>& list, TableForm)
{
  return {TableForm::list, [&list] { return list.size(); }, [&list](std::size_t size) { list.resize(size); },
          [&list](std::size_t place) { return entry_of(list[place]); }};
}

template <class Entry> TableTarget table_of(std::optional<Entry>& entry, TableForm form)
{
  return {form, [&entry] { return std::size_t{entry.has_value()}; }, [&entry](std::size_t) { entry.emplace(); },
          [&entry](std::size_t) { return entry_of(*entry); }};
}

template <class Entry> TableTarget table_of(Entry& entry, TableForm form)
{
  const auto enable = [&entry](std::size_t)
  {
    if constexpr (requires { entry.enabled; }) entry.enabled = true;
  };
  return {form, [] { return std::size_t{1}; }, enable, [&entry](std::size_t) { return entry_of(entry); }};
}

template <class Member> SceneKey section(const char* name, Member& member, const char* meaning)
{
  return {name, table_of(member, TableForm::single), "table", meaning};
}

template <class Member> TableTarget braces(Member& member)
{
  return table_of(member, TableForm::braces);
}

} // namespace

SceneKeys keys_of(MeshSource& m)
{
  return {
      {"file", &m.file, "path", "a .geo to mesh, or a mesh with named groups that gmsh reads", required, file},
      {"scale", &m.scale, "m", "length unit of the file", positive},
      {"size_field", &m.size_field, "path", "sizes of elements that gmsh merges after the .geo", file},
      {"refine", &m.refine, "-", "number of times that each element is divided, a solid in 8", not_negative},
      {"parameters", &m.parameters, "table", "values for the DefineConstant of a .geo"},
  };
}

SceneKeys keys_of(Orthotropy& o)
{
  return {
      {"young", &o.young, "Pa", "E1, E2, E3 along the axes", required, double_it},
      {"poisson", &o.poisson, "-",
       "nu12, nu13, nu23; nu12 is the contraction along 2 over the extension along 1 under tension along 1", required},
      {"shear", &o.shear, "Pa", "G12, G13, G23", required, double_it},
      {"axis_1", &o.axis_1, "-", "direction of the first axis: x, y, z or a vector", direction},
      {"axis_2", &o.axis_2, "-", "direction of the second one, square to it; the third is square to both", direction},
      {"cylinder", braces(o.cylinder), "table",
       "instead of both axes, the first one radial and the second tangential: {axis, centre}", stiffness_and_mass},
  };
}

SceneKeys keys_of(Rotation& r)
{
  return {
      {"axis", &r.axis, "-", "axis of rotation: x, y, z or a vector", required, direction},
      {"centre", &r.centre, "m", "a point of the axis; the origin when absent"},
      {"rate", &r.rate, "rad/s", "angular velocity", required, derive},
  };
}

SceneKeys keys_of(Part& p)
{
  return {
      {"name", &p.name, "text", "named group of the mesh", required},
      {"young", &p.material.young, "Pa", "Young's modulus; required unless orthotropic is given", not_negative,
       stiffness_and_mass, derive_and_double},
      {"poisson", &p.material.poisson, "-", "Poisson's ratio; required unless orthotropic is given", poisson,
       stiffness_and_mass},
      {"orthotropic", braces(p.material.orthotropy), "table",
       "of a solid, nine constants and their axes instead: {young, poisson, shear, axis_1, axis_2}",
       stiffness_and_mass},
      {"density", &p.material.density, "kg/m3", "mass density", required, positive, mass, derive_and_double},
      {"thickness", &p.thickness, "m", "thickness of a shell; 0 is a solid", not_negative, stiffness_and_mass},
      {"offset", &p.offset, "m", "distance of a shell's middle surface from its nodes, along its normal",
       stiffness_and_mass},
      {"loss_factor", &p.loss_factor, "-",
       "eta of the stiffness K (1 + i eta), at most 10, with damping.loss_frequency; it adds to Rayleigh damping",
       not_negative, damping, derive},
      {"rotation", braces(p.rotation), "table",
       "spin of a solid of revolution, alike in all directions, about its own axis, seen from the frame at rest: "
       "{axis, centre, rate}; gyroscopic and centrifugal terms",
       stiffness_and_mass},
      {"alpha", DampingTarget{&p.damping, &RayleighDamping::alpha}, "1/s",
       "the part's own Rayleigh damping, mass part; [damping] when both are absent", not_negative, damping, derive},
      {"beta", DampingTarget{&p.damping, &RayleighDamping::beta}, "s",
       "the part's own Rayleigh damping, stiffness part", not_negative, damping, derive},
  };
}

SceneKeys keys_of(Point& p)
{
  return {
      {"name", &p.name, "text", "name for springs, forces, contacts and probes", required},
      {"at", &p.at, "m", "position", required, mesh},
      {"mass", &p.mass, "kg", "point mass", not_negative, mass, derive_and_double},
      {"free", &p.free, "motions", "motions that are free: any of x y z rx ry rz, or all, none", required},
  };
}

SceneKeys keys_of(RigidBody& b)
{
  return {
      {"name", &b.name, "text", "name for springs, forces and probes", required},
      {"surfaces", &b.surfaces, "texts", "a named surface, or a list of them", required},
      {"at", &b.at, "m", "reference point", required, mesh},
      {"mass", &b.mass, "kg", "mass at the reference point", not_negative, mass, derive_and_double},
      {"inertia", &b.inertia, "kg m2", "xx yy zz, or xx yy zz xy yz zx, about the reference point", mass, Rule::inertia,
       double_it},
      {"free", &b.free, "motions", "motions that are free: any of x y z rx ry rz, or all, none", required},
      {"motions", &b.motions, "motions", "motions of the surfaces' nodes that follow it; the others are their own"},
  };
}

SceneKeys keys_of(Spring& s)
{
  return {
      {"from", &s.from, "text", "point, rigid body, coupling, or named group, whose nodes share the spring", required},
      {"to", &s.to, "text", "the same, or ground; one end at most is a group"},
      {"direction", &s.direction, "-", "line of action: x, y, z or a vector", required, direction, stiffness_and_mass},
      {"stiffness", &s.stiffness, "N/m", "stiffness of the spring", not_negative, stiffness_and_mass,
       derive_and_double},
      {"damping", &s.damping, "N s/m", "constant of the dashpot", not_negative, damping, derive},
  };
}

SceneKeys keys_of(Superelement& s)
{
  return {
      {"name", &s.name, "text", "name for messages", required},
      {"folder", &s.folder, "path",
       "folder of M K .petsc, dofs.txt, nodes.txt, as tools/matrices writes them; C.petsc may be there", required,
       folder},
      {"on", &s.on, "texts", "named group, point or rigid body that has its retained nodes, or a list of them",
       required},
  };
}

SceneKeys keys_of(Support& s)
{
  return {
      {"on", &s.on, "text", "named group or point; rows or nodes of a matrix scene", required},
      {"fixed", &s.fixed, "motions", "motions that are held: any of x y z rx ry rz, or all", required},
      {"axis_1", &s.frame.axis_1, "-", "x of its motions: x, y, z or a vector", direction, mesh},
      {"axis_2", &s.frame.axis_2, "-", "y of its motions, square to it; z is square to both", direction, mesh},
      {"cylinder", braces(s.frame.cylinder), "table",
       "instead of both axes, x radial, y tangential and z along it at each node: {axis, centre}", mesh},
      {"displacement", &s.displacement, "m", "of fixed x y z; no load factor scales it", load},
      {"rotation", &s.rotation, "rad", "of fixed rx ry rz, likewise", load},
  };
}

SceneKeys keys_of(Force& f)
{
  return {
      {"on", &f.on, "text",
       "point, rigid body, or named group, whose nodes share the force; rows or nodes of a matrix scene", required},
      {"vector", &f.vector, "N", "the whole force", load},
      {"moment", &f.moment, "N m", "the whole moment, on what rotates; one of both is needed", load},
  };
}

SceneKeys keys_of(Pressure& p)
{
  return {
      {"on", &p.on, "text", "named surface", required},
      {"value", &p.value, "Pa", "pressure; a positive one presses onto the solid", required, load},
  };
}

SceneKeys keys_of(Contact& c)
{
  return {
      {"rotor", &c.rotor, "text", "named surface or point that the drive moves", required},
      {"stator", &c.stator, "text", "named surface or point that slides on it", required},
      {"gap", &c.gap, "m", "initial gap, positive when open", gap},
      {"gap_file", &c.gap_file, "path",
       "text file with a line `x y z gap` in m for each node of the slave side; they add to the gap", file},
      {"reach", &c.reach, "m", "largest distance of the surfaces along the normal; it adds to the gap", not_negative,
       mesh},
      {"normal", &c.normal, "-",
       "normal out of the rotor; points need it, surfaces have that of the slave side at each node", direction, mesh},
      {"compliance", &c.compliance, "m3/N",
       "approach of the surfaces over pressure, as of rough linings, in series with the pairs; of points in m/N; 0: "
       "rigid",
       not_negative, gap},
      {"slip_compliance", &c.slip_compliance, "m3/N",
       "elastic slip of a contact that sticks, over shear stress, in series with its friction; of points in m/N; 0: "
       "rigid",
       not_negative, gap},
      {"slave", choice_of(c.slave), "word", "side whose nodes have the pairs: the finer or softer one"},
      {"tangents", &c.tangents, "-", "one direction: plane friction along it; or two; when absent, two are chosen",
       direction, drive},
      {"rotation", braces(c.rotation), "table",
       "rotation of the rotor: {axis, centre, rate}; a [[rotor]] of its part says it once", drive},
      {"velocity", &c.velocity, "m/s",
       "velocity of the rotor's surface, instead of a rotation; without either the contact sticks or slips by itself",
       velocity, drive},
      {"friction", FrictionTarget{&c.friction, &FrictionLaw::coefficient}, "-",
       "the contact's own Coulomb's mu; 0 is a smooth stop; [friction] when absent", not_negative, friction},
      {"static_coefficient", FrictionTarget{&c.friction, &FrictionLaw::static_coefficient}, "-",
       "its own mu at rest, as of [friction]", not_negative, friction},
      {"decay_speed", FrictionTarget{&c.friction, &FrictionLaw::decay_speed}, "m/s", "of its own law, as of [friction]",
       not_negative, friction},
      {"factor_at_speed", FrictionTableTarget{&c.friction, &FrictionLaw::factor_at_speed}, "table",
       "of its own law, as of [friction]", not_negative, friction},
  };
}

SceneKeys keys_of(LoadStep& s)
{
  return {
      {"name", &s.name, "text", "name in messages and results", required},
      {"load", &s.load, "-", "factor at the step's end on all forces and pressures; 1 in the last step"},
      {"forces", &s.forces, "-", "factors beside it, one a [[force]]; 1 when absent, and in the last step"},
      {"pressures", &s.pressures, "-", "factors beside it, one a [[pressure]]; 1 when absent, and in the last step"},
      {"friction", &s.friction, "-",
       "factor at the step's end on the friction of driven contacts: 0 while the rotor is at rest; 1 in the last step",
       not_negative},
      {"bolts", &s.bolts, "texts",
       "bolts that have their tension at the step's end; the others keep their length. When no step names any, all are "
       "tightened before the first"},
  };
}

SceneKeys keys_of(InitialMotion& m)
{
  return {
      {"on", &m.on, "text", "point, rigid body or named group", required},
      {"displacement", &m.displacement, "m", "displacement of all its nodes, beside that of [transient] start"},
      {"velocity", &m.velocity, "m/s", "velocity of all its nodes, likewise"},
  };
}

SceneKeys keys_of(Tie& t)
{
  return {
      {"slave", &t.slave, "text", "named surface whose nodes follow: the finer or softer side, and the smaller one",
       required},
      {"master", &t.master, "text", "named surface that they follow", required},
      {"reach", &t.reach, "m",
       "largest distance of the surfaces along the normal; 0: they coincide, curved ones up to the chords of their "
       "faces",
       not_negative},
  };
}

SceneKeys keys_of(FrictionLaw& f)
{
  return {
      {"coefficient", &f.coefficient, "-", "Coulomb's mu; with a decay_speed its value at high speed", not_negative,
       friction, derive},
      {"static_coefficient", &f.static_coefficient, "-",
       "mu at rest; without a decay_speed a level of its own, which any sliding leaves", not_negative, friction},
      {"decay_speed", &f.decay_speed, "m/s",
       "mu(s) = coefficient + (static_coefficient - coefficient) exp(-s/decay_speed) at the sliding speed s; 0: "
       "`coefficient` at any",
       not_negative, friction},
      {"factor_at_speed", &f.factor_at_speed, "table",
       "mu(s) = coefficient times a factor of the sliding speed s: [[0, 1.5], [0.2, 1]], rows of a speed in m/s and "
       "the "
       "factor, straight lines between",
       not_negative, friction},
      {"direction_damping", &f.direction_damping, "switch",
       "keep the damping mu r_n/abs(v_d) (I - e e') that the friction direction adds to the modes"},
      {"slipped_pairs_stick", &f.slipped_pairs_stick, "switch",
       "modes take pairs without a drive that slipped on the load path as stuck; false: as sliding along their last "
       "friction"},
  };
}

SceneKeys keys_of(RayleighDamping& d)
{
  return {
      {"alpha", &d.alpha, "1/s", "mass part", not_negative, damping, derive},
      {"beta", &d.beta, "s", "stiffness part", not_negative, damping, derive},
      {"loss_frequency", &d.loss_frequency, "Hz",
       "where loss factors have their viscous equivalent eta/omega K in time steps and in the estimate; modes take "
       "complex stiffness",
       not_negative, damping},
  };
}

SceneKeys keys_of(Probe& p)
{
  return {
      {"name", &p.name, "text", "name in the results", required},
      {"on", &p.on, "text", "point, rigid body or named group; a row or node of a matrix scene", required},
      {"at", &p.at, "m", "the group's node that is nearest to this position"},
      {"direction", &p.direction, "-", "direction of the displacement: x, y, z or a vector; not for dof:N", direction},
  };
}

SceneKeys keys_of(Scene& scene)
{
  return {
      {"title", &scene.title, "text", "what the scene shows; the printed table starts with it"},
      {"fidelity", choice_of(scene.fidelity), "word",
       "model on which the cycle is sought; auto: what the scene leaves open is chosen as the accuracy needs it"},
      {"accuracy", &scene.accuracy, "-",
       "relative error that fidelity = \"auto\" may leave in the cycle's frequency and mean fluctuating energy",
       positive},
      {"gravity", &scene.gravity, "m/s2", "acceleration of gravity; no load factor scales it", load},
      {"numbers", &scene.numbers, "table",
       "named numbers: a name in quotes, or \"-name\", then stands for the number wherever a key takes one"},
      section("mesh", scene.mesh, "a mesh and how to read it"),
      section("matrices", scene.matrices, "matrices of another code instead of a mesh"),
      section("part", scene.parts, "a named volume of the mesh, or a named surface with a thickness (shell)"),
      section("point", scene.points, "a node of its own: a point mass, or an end of springs"),
      section("rigid_body", scene.rigid_bodies, "named surfaces that move as one rigid body"),
      section("coupling", scene.couplings, "a point that follows the mean motion of nodes, and loads them alike"),
      section("spring", scene.springs, "spring and dashpot between points, rigid bodies or a group, or to \"ground\""),
      section("connector", scene.connectors, "a joint or bushing between two points or bodies, or to \"ground\""),
      section("beam", scene.beams, "a straight beam between two points or bodies"),
      section("mass", scene.masses, "mass shared by the nodes of a group"),
      section("superelement", scene.superelements, "a reduced structure of another code, joined to nodes"),
      section("support", scene.supports, "fixed motions of a named group or point"),
      section("force", scene.forces, "force on a point, a rigid body or a named group"),
      section("pressure", scene.pressures, "pressure on a named surface"),
      section("bolt", scene.bolts, "a bolt that is tightened and then keeps its length"),
      section("rotor", scene.rotors, "a part that turns or moves, and drives all contacts that it is the rotor of"),
      section("contact", scene.contacts, "two named surfaces or two points in contact with friction"),
      section("step", scene.steps, "a step on the way to the loads; undriven contacts depend on their order"),
      section("initial", scene.initial, "a displacement or velocity that the transient starts with"),
      section("tie", scene.ties, "two named surfaces of parts meshed apart that move as one"),
      section("friction", scene.friction, "Coulomb's law of contacts that have none of their own"),
      section("damping", scene.damping, "Rayleigh damping C = alpha M + beta K of parts that give none of their own"),
      section("modes", scene.modes, "stability of the sliding equilibrium"),
      section("estimate", scene.estimate, "energy estimate of the cycle's amplitude"),
      section("transient", scene.transient, "time integration; runs when the table is present"),
      section("cycle", scene.cycle, "limit cycle by shooting; runs when the table is present"),
      section("branch", scene.branch, "the limit cycle along a number of the scene; runs when the table is present"),
      section("sweep", scene.sweep,
              "stability at many values of a number, or at design points; runs when the table is present"),
      section("sensitivity", scene.sensitivity,
              "derivatives, energies and powers of the unstable modes; runs when the table is present"),
      section("change", scene.changes, "a mass, damper or spring proposed at a probe, predicted and computed"),
      section("response", scene.response, "frequency responses about steady sliding; runs when the table is present"),
      section("robustness", scene.robustness, "probability of unstable modes; runs when the table is present"),
      section("uncertain", scene.uncertain, "a number of the scene that is random in [robustness]"),
      section("probe", scene.probes, "a displacement that is recorded in time"),
  };
}

std::string heading_of(const SceneKey& table)
{
  const TableForm form = std::get<TableTarget>(table.target).form;
  if (form == TableForm::list) return "[[" + table.name + "]]";
  return form == TableForm::single ? "[" + table.name + "]" : table.name;
}

std::string label_of(const SceneKey& table, const std::string& name, const std::string& label)
{
  return label + heading_of(table) + " " + (name.empty() ? "" : shortened(name) + " ");
}

bool is_absent(const SceneKey& key)
{
  const auto of_value = [&](const auto& value) -> bool
  {
    using Value = std::remove_cvref_t<decltype(value)>;
    if constexpr (std::is_same_v<Value, Vec3>)
      return (key.rule == Rule::direction || key.rule == Rule::velocity) && value == Vec3{};
    else if constexpr (std::is_same_v<Value, FactorTable>)
      return value.at.empty();
    else if constexpr (requires { value.has_value(); })
      return !value.has_value();
    else if constexpr (requires { value.empty(); } && !std::is_same_v<Value, std::string>)
      return value.empty();
    return false;
  };
  const auto of_target = [&](const auto& target) -> bool
  {
    using Kind = std::remove_cvref_t<decltype(target)>;
    if constexpr (std::is_pointer_v<Kind>) return of_value(*target);
    if constexpr (requires { target.part; })
      return !target.part->has_value() || of_value((**target.part).*target.member);
    if constexpr (std::is_same_v<Kind, TableTarget>) return target.size() == 0;
    return false;
  };
  return std::visit(of_target, key.target);
}

bool has_unit(const std::string& unit)
{
  static const std::vector<std::string> none = {"-", "text", "texts", "word", "path", "switch", "motions", "table"};
  return std::find(none.begin(), none.end(), unit) == none.end();
}

} // namespace squeal
