/// The keys of every table.
#include "scene_keys.hpp"

#include <algorithm>

namespace squeal
{

namespace
{
constexpr Need optional = Need::optional, required = Need::required;
using enum Effect;
} // namespace

bool has_unit(const std::string& unit)
{
  static const std::vector<std::string> none = {"-", "text", "texts", "word", "path", "switch", "motions", "table"};
  return std::find(none.begin(), none.end(), unit) == none.end();
}

SceneKeys keys_of(Scene& scene)
{
  return {
      {"title", &scene.title, optional, Rule::any, "text", "what the scene shows"},
      {"fidelity", choice_of(scene.fidelity), optional, Rule::any, "word",
       "of the cycle's model: full, reduced, or auto (what the scene leaves open, as the accuracy needs it)"},
      {"accuracy", &scene.accuracy, optional, Rule::positive, "-",
       "required relative accuracy of the cycle's frequency and energy"},
  };
}

SceneKeys keys_of(MeshSource& m)
{
  return {
      {"file", &m.file, required, Rule::file, "path", "a .geo to mesh, or a mesh gmsh reads, with named groups"},
      {"scale", &m.scale, optional, Rule::positive, "m", "length unit of the file"},
      {"parameters", &m.parameters, optional, Rule::any, "table", "values for the DefineConstant of a .geo"},
  };
}

SceneKeys keys_of(std::filesystem::path& matrices)
{
  return {{"folder", &matrices, required, Rule::folder, "path",
           "folder of M K B gap drive .petsc; of C F G H .petsc, dofs.txt"}};
}

SceneKeys keys_of(Part& p)
{
  return {
      {"name", &p.name, required, Rule::any, "text", "named group of the mesh"},
      {"young", &p.material.young, optional, Rule::not_negative, "Pa", "Young's modulus; required unless orthotropic",
       stiffness_and_mass},
      {"poisson", &p.material.poisson, optional, Rule::poisson, "-", "Poisson's ratio", stiffness_and_mass},
      {"orthotropic", &p.material.orthotropy, optional, Rule::any, "table",
       "of a solid, instead of young and poisson: {young, poisson, shear, axis_1, axis_2}", stiffness_and_mass},
      {"density", &p.material.density, required, Rule::positive, "kg/m3", "mass density", mass},
      {"thickness", &p.thickness, optional, Rule::not_negative, "m", "of a shell; 0 is a solid", stiffness_and_mass},
      {"loss_factor", &p.loss_factor, optional, Rule::not_negative, "-",
       "eta of the stiffness K (1 + i eta), at most 10; with damping.loss_frequency", damping},
      {"rotation", &p.rotation, optional, Rule::any, "table",
       "of a solid of revolution that spins: {axis, centre, rate}", stiffness_and_mass},
      {"alpha", DampingTarget{&p.damping, &RayleighDamping::alpha}, optional, Rule::not_negative, "1/s",
       "own Rayleigh damping, mass part", damping},
      {"beta", DampingTarget{&p.damping, &RayleighDamping::beta}, optional, Rule::not_negative, "s",
       "own Rayleigh damping, stiffness part", damping},
  };
}

SceneKeys keys_of(Orthotropy& o)
{
  return {
      {"young", &o.young, required, Rule::any, "Pa", "E1, E2, E3 along the axes"},
      {"poisson", &o.poisson, required, Rule::any, "-", "nu12, nu13, nu23: contraction along 2 under tension along 1"},
      {"shear", &o.shear, required, Rule::any, "Pa", "G12, G13, G23"},
      {"axis_1", &o.axis_1, optional, Rule::direction, "-", "x, y, z or a vector"},
      {"axis_2", &o.axis_2, optional, Rule::direction, "-", "square to axis_1; axis 3 is square to both"},
  };
}

SceneKeys keys_of(Point& p)
{
  return {
      {"name", &p.name, required, Rule::any, "text", "name for springs, forces, contacts, probes"},
      {"at", &p.at, required, Rule::any, "m", "position", mesh},
      {"mass", &p.mass, optional, Rule::not_negative, "kg", "point mass", mass},
      {"free", &p.free, required, Rule::any, "motions", "free motions: any of x y z rx ry rz, all, none"},
  };
}

SceneKeys keys_of(RigidBody& b)
{
  return {
      {"name", &b.name, required, Rule::any, "text", "name for springs, forces, probes"},
      {"surfaces", &b.surfaces, required, Rule::any, "texts", "named surface, or a list of them"},
      {"at", &b.at, required, Rule::any, "m", "reference point", mesh},
      {"mass", &b.mass, optional, Rule::not_negative, "kg", "mass at the reference point", mass},
      {"inertia", &b.inertia, optional, Rule::any, "kg m2", "xx yy zz, or xx yy zz xy yz zx, about that point", mass},
      {"free", &b.free, required, Rule::any, "motions", "free motions: any of x y z rx ry rz, all, none"},
  };
}

SceneKeys keys_of(Spring& s)
{
  return {
      {"from", &s.from, required, Rule::any, "text", "point or rigid body"},
      {"to", &s.to, optional, Rule::any, "text", "point, rigid body or ground"},
      {"direction", &s.direction, required, Rule::direction, "-", "line of action: x, y, z or a vector",
       stiffness_and_mass},
      {"stiffness", &s.stiffness, optional, Rule::not_negative, "N/m", "of the spring", stiffness_and_mass},
      {"damping", &s.damping, optional, Rule::not_negative, "N s/m", "of the dashpot", damping},
  };
}

SceneKeys keys_of(Superelement& s)
{
  return {
      {"name", &s.name, required, Rule::any, "text", "name for messages"},
      {"folder", &s.folder, required, Rule::folder, "path", "folder of M K .petsc, dofs.txt, nodes.txt; of C.petsc"},
      {"on", &s.on, required, Rule::any, "texts", "named group, point or rigid body that has its nodes, or a list"},
  };
}

SceneKeys keys_of(Support& s)
{
  return {
      {"on", &s.on, required, Rule::any, "text", "named group or point; rows or nodes of a matrix scene"},
      {"fixed", &s.fixed, required, Rule::any, "motions", "fixed motions: any of x y z rx ry rz, all"},
  };
}

SceneKeys keys_of(Force& f)
{
  return {
      {"on", &f.on, required, Rule::any, "text",
       "point, rigid body, or named group (force shared by its nodes); rows or nodes of a matrix scene"},
      {"vector", &f.vector, required, Rule::any, "N", "total force", load},
  };
}

SceneKeys keys_of(Pressure& p)
{
  return {
      {"on", &p.on, required, Rule::any, "text", "named surface"},
      {"value", &p.value, required, Rule::any, "Pa", "positive presses onto the solid", load},
  };
}

SceneKeys keys_of(Rotation& r)
{
  return {
      {"axis", &r.axis, required, Rule::direction, "-", "of rotation: x, y, z or a vector"},
      {"centre", &r.centre, optional, Rule::any, "m", "a point of the axis"},
      {"rate", &r.rate, required, Rule::any, "rad/s", "angular velocity"},
  };
}

SceneKeys keys_of(Contact& c)
{
  return {
      {"rotor", &c.rotor, required, Rule::any, "text", "named surface or point that the drive moves"},
      {"stator", &c.stator, required, Rule::any, "text", "named surface or point that slides on it"},
      {"gap", &c.gap, optional, Rule::any, "m", "initial gap, positive when open", contact},
      {"reach", &c.reach, optional, Rule::not_negative, "m",
       "largest distance of the surfaces along the normal, which adds to the gap", mesh},
      {"normal", &c.normal, optional, Rule::direction, "-",
       "out of the rotor; required for points, else that of the slave surface at each node", mesh},
      {"compliance", &c.compliance, optional, Rule::not_negative, "m3/N",
       "approach of the surfaces over pressure, in series with the pairs; of points m/N; 0: rigid", contact},
      {"slave", choice_of(c.slave), optional, Rule::any, "word",
       "side whose nodes have the pairs: the finer or softer one"},
      {"tangents", &c.tangents, optional, Rule::direction, "-", "one direction: plane friction along it; or two",
       contact},
      {"rotation", &c.rotation, optional, Rule::any, "table", "of the rotor: {axis, centre, rate}", contact},
      {"velocity", &c.velocity, optional, Rule::any, "m/s", "of the rotor's surface, instead of a rotation", contact},
  };
}

SceneKeys keys_of(Tie& t)
{
  return {
      {"slave", &t.slave, required, Rule::any, "text",
       "named surface whose nodes follow, the finer or softer side, or curve, a shell's edge"},
      {"master", &t.master, required, Rule::any, "text", "named surface that they follow"},
      {"reach", &t.reach, optional, Rule::not_negative, "m",
       "largest distance of the surfaces along the normal; 0: they coincide"},
  };
}

SceneKeys keys_of(FrictionLaw& f)
{
  return {
      {"coefficient", &f.coefficient, optional, Rule::not_negative, "-", "Coulomb's mu; with decay_speed at high speed",
       friction},
      {"static_coefficient", &f.static_coefficient, optional, Rule::not_negative, "-", "mu at rest, with decay_speed",
       friction},
      {"decay_speed", &f.decay_speed, optional, Rule::not_negative, "m/s",
       "mu goes as exp(-speed/decay_speed) from rest to high speed; 0: constant", friction},
      {"direction_damping", &f.direction_damping, optional, Rule::any, "switch",
       "keep mu r_n/|v_d| (I - e e') in the modes"},
  };
}

SceneKeys keys_of(RayleighDamping& d)
{
  return {
      {"alpha", &d.alpha, optional, Rule::not_negative, "1/s", "mass part", damping},
      {"beta", &d.beta, optional, Rule::not_negative, "s", "stiffness part", damping},
      {"loss_frequency", &d.loss_frequency, optional, Rule::not_negative, "Hz",
       "where loss factors have their viscous equivalent in time; modes take complex stiffness", damping},
      {"measured", &d.measured, optional, Rule::positive, "table",
       "instead of alpha and beta, which are fitted to [[frequency in Hz, damping ratio], ...] of modes"},
  };
}

SceneKeys keys_of(ModesSettings& m)
{
  return {
      {"enabled", &m.enabled, optional, Rule::any, "switch", "run this stage"},
      {"method", choice_of(m.method), optional, Rule::any, "word",
       "projection on real modes, full sparse problem, or both; auto: full, and both where the count is not confirmed"},
      {"real_modes", &m.real_modes, optional, Rule::not_negative, "-",
       "real modes of the projection; 0: those of the band"},
      {"residual_passes", &m.residual_passes, optional, Rule::not_negative, "-", "corrections of the projection"},
      {"band", &m.band, optional, Rule::positive, "Hz", "every mode below is reported"},
      {"reduced_matrices", &m.reduced_matrices, optional, Rule::any, "switch",
       "write the brake reduced to the modes and the pairs' attachment shapes as matrices, into reduced/"},
  };
}

SceneKeys keys_of(EstimateSettings& e)
{
  return {{"enabled", &e.enabled, optional, Rule::any, "switch", "run this stage"}};
}

SceneKeys keys_of(TransientSettings& t)
{
  return {
      {"enabled", &t.enabled, optional, Rule::any, "switch", "run this stage"},
      {"start", &t.start, optional, Rule::any, "word", "mode, estimate, rest, equilibrium, or a state file"},
      {"amplitude", &t.amplitude, optional, Rule::not_negative, "m",
       "largest displacement at start = \"mode\"; 0: a tenth of first lift-off"},
      {"periods", &t.periods, optional, Rule::positive, "-", "length, in periods of the followed mode"},
      {"steps_per_period", &t.steps_per_period, optional, Rule::positive, "-", "time steps a period"},
      {"steps", &t.steps, optional, Rule::not_negative, "-", "with step_size, instead of periods"},
      {"step_size", &t.step_size, optional, Rule::not_negative, "s", "with steps, instead of periods"},
      {"theta", &t.theta, optional, Rule::fraction, "-", "of the theta-method; 0.5 conserves energy"},
      {"load_factor", &t.ramps.load, optional, Rule::any, "table",
       "on all forces and pressures in time: [[time in s, factor], ...], straight lines between"},
      {"speed_factor", &t.ramps.speed, optional, Rule::any, "table", "likewise on the drive velocities"},
      {"friction_factor", &t.ramps.friction, optional, Rule::not_negative, "table",
       "likewise on the friction coefficients"},
      {"save_state", &t.save_state, optional, Rule::any, "path", "state file written at the end"},
  };
}

SceneKeys keys_of(CycleSettings& c)
{
  return {
      {"enabled", &c.enabled, optional, Rule::any, "switch", "run this stage"},
      {"start", &c.start, optional, Rule::any, "word",
       "estimate, mode, transient (its end), coarse (the cycle on a coarser mesh), or a state file"},
      {"amplitude", &c.amplitude, optional, Rule::not_negative, "m",
       "largest displacement at start = \"mode\"; 0: twice first lift-off"},
      {"coarse_parameters", &c.coarse_parameters, optional, Rule::any, "table",
       "of start = \"coarse\": values for the DefineConstant of the geometry that make its mesh coarser"},
      {"coarse_mesh", &c.coarse_mesh, optional, Rule::file, "path", "or a mesh or geometry of its own, likewise named"},
      {"steps_per_period", &c.steps_per_period, optional, Rule::not_negative, "-", "time steps a period; 0: chosen"},
      {"tolerance", &c.tolerance, optional, Rule::not_negative, "-", "on the full-space residual; 0: chosen"},
      {"free_periods", &c.free_periods, optional, Rule::not_negative, "-", "integrated before the first Newton step"},
      {"starts", &c.starts, optional, Rule::not_negative, "-", "starts whose motions are listed; 0: chosen"},
      {"theta", &c.theta, optional, Rule::fraction, "-", "of the theta-method; 0.5 conserves energy"},
      {"save_state", &c.save_state, optional, Rule::any, "path", "state file of the cycle's start"},
  };
}

SceneKeys keys_of(BranchSettings& b)
{
  return {
      {"key", &b.key, required, Rule::any, "text", "number of the scene, as --set names it"},
      {"from", &b.from, required, Rule::any, "-", "its value at one end, in its own unit"},
      {"to", &b.to, required, Rule::any, "-", "its value at the other end"},
      {"points", &b.points, optional, Rule::positive, "-", "number of points if it alone changed along the branch"},
      {"corrections", &b.corrections, optional, Rule::not_negative, "-",
       "number of points of a reduced model's branch that the full model corrects"},
  };
}

SceneKeys keys_of(SweepSettings& s)
{
  return {
      {"key", &s.key, required, Rule::any, "texts", "number of the scene, as --set names it, or a list of two"},
      {"from", &s.from, optional, Rule::any, "-",
       "first value, in the number's own unit; a list of two numbers' values"},
      {"to", &s.to, optional, Rule::any, "-", "last value"},
      {"points", &s.points, optional, Rule::positive, "-", "number of values from the first to the last"},
      {"values", &s.values, optional, Rule::any, "-", "list of a single number's values, instead"},
      {"samples", &s.samples, optional, Rule::not_negative, "-", "number of random points of the ranges, instead"},
      {"seed", &s.seed, optional, Rule::not_negative, "-", "of the random points"},
      {"directions", choice_of(s.directions), optional, Rule::any, "word", "of rotation: one, or both"},
      {"stages", choice_of(s.stages), optional, Rule::any, "word",
       "at each point: equilibrium alone, modes too, or the cycle where modes grow"},
  };
}

SceneKeys keys_of(SensitivitySettings& s)
{
  return {{"numbers", &s.numbers, optional, Rule::any, "texts",
           "derivatives with respect to these only, as --set names them"}};
}

SceneKeys keys_of(Change& c)
{
  return {
      {"probe", &c.probe, required, Rule::any, "text", "name of the probe where it acts, along its direction"},
      {"mass", &c.mass, optional, Rule::not_negative, "kg", "added mass"},
      {"damping", &c.damping, optional, Rule::not_negative, "N s/m", "dashpot to the ground"},
      {"stiffness", &c.stiffness, optional, Rule::not_negative, "N/m", "spring to the ground, relaxed at equilibrium"},
  };
}

SceneKeys keys_of(ResponseSettings& r)
{
  return {
      {"excitation", &r.excitation, optional, Rule::any, "texts",
       "names of the probes that are driven, along their directions; without it all are"},
      {"from", &r.from, required, Rule::positive, "Hz", "lowest frequency"},
      {"to", &r.to, required, Rule::positive, "Hz", "highest frequency"},
      {"count", &r.count, optional, Rule::positive, "-", "number of frequencies, evenly spread"},
  };
}

SceneKeys keys_of(RobustnessSettings& r)
{
  return {
      {"samples", &r.samples, optional, Rule::positive, "-", "number of random scenes"},
      {"checks", &r.checks, optional, Rule::not_negative, "-", "number of them computed by the full problem as well"},
      {"seed", &r.seed, optional, Rule::not_negative, "-", "of the random numbers"},
      {"confidence", &r.confidence, optional, Rule::fraction, "-", "of the intervals of the probabilities"},
  };
}

SceneKeys keys_of(UncertainNumber& u)
{
  return {
      {"key", &u.key, required, Rule::any, "text", "number of the scene, as --set names it"},
      {"distribution", choice_of(u.distribution), optional, Rule::any, "word", "normal, lognormal or uniform"},
      {"mean", &u.mean, optional, Rule::any, "-", "of the number, in its own unit; 0: the scene's value"},
      {"deviation", &u.deviation, optional, Rule::not_negative, "-", "standard deviation of the number"},
      {"from", &u.from, optional, Rule::any, "-", "least value of a uniform distribution"},
      {"to", &u.to, optional, Rule::any, "-", "greatest value of a uniform distribution"},
  };
}

SceneKeys keys_of(Probe& p)
{
  return {
      {"name", &p.name, required, Rule::any, "text", "name in the results"},
      {"on", &p.on, required, Rule::any, "text", "point, rigid body or named group; a row or node of a matrix scene"},
      {"at", &p.at, optional, Rule::any, "m", "the group's node nearest to this position"},
      {"direction", &p.direction, optional, Rule::direction, "-", "x, y, z or a vector; not for dof:N"},
  };
}

} // namespace squeal
