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
      {"title", &scene.title, optional, Rule::any, "text", "what the scene shows; the printed table starts with it"},
      {"fidelity", choice_of(scene.fidelity), optional, Rule::any, "word",
       "model on which the cycle is sought; auto: what the scene leaves open is chosen as the accuracy needs it"},
      {"accuracy", &scene.accuracy, optional, Rule::positive, "-",
       "relative error that fidelity = \"auto\" may leave in the cycle's frequency and mean fluctuating energy"},
  };
}

SceneKeys keys_of(MeshSource& m)
{
  return {
      {"file", &m.file, required, Rule::file, "path", "a .geo to mesh, or a mesh with named groups that gmsh reads"},
      {"scale", &m.scale, optional, Rule::positive, "m", "length unit of the file"},
      {"parameters", &m.parameters, optional, Rule::any, "table", "values for the DefineConstant of a .geo"},
  };
}

SceneKeys keys_of(std::filesystem::path& matrices)
{
  return {{"folder", &matrices, required, Rule::folder, "path",
           "folder of M K B gap drive, each with the ending .petsc; C F G H compliance dofs.txt may be there"}};
}

SceneKeys keys_of(Part& p)
{
  return {
      {"name", &p.name, required, Rule::any, "text", "named group of the mesh"},
      {"young", &p.material.young, optional, Rule::not_negative, "Pa",
       "Young's modulus; required unless orthotropic is given", stiffness_and_mass},
      {"poisson", &p.material.poisson, optional, Rule::poisson, "-",
       "Poisson's ratio; required unless orthotropic is given", stiffness_and_mass},
      {"orthotropic", &p.material.orthotropy, optional, Rule::any, "table",
       "of a solid, nine constants and their axes instead: {young, poisson, shear, axis_1, axis_2}",
       stiffness_and_mass},
      {"density", &p.material.density, required, Rule::positive, "kg/m3", "mass density", mass},
      {"thickness", &p.thickness, optional, Rule::not_negative, "m", "thickness of a shell; 0 is a solid",
       stiffness_and_mass},
      {"loss_factor", &p.loss_factor, optional, Rule::not_negative, "-",
       "eta of the stiffness K (1 + i eta), at most 10, with damping.loss_frequency; it adds to Rayleigh damping",
       damping},
      {"rotation", &p.rotation, optional, Rule::any, "table",
       "spin of a solid of revolution, alike in all directions, about its own axis, seen from the frame at rest: "
       "{axis, centre, rate}; gyroscopic and centrifugal terms",
       stiffness_and_mass},
      {"alpha", DampingTarget{&p.damping, &RayleighDamping::alpha}, optional, Rule::not_negative, "1/s",
       "the part's own Rayleigh damping, mass part; [damping] when both are absent", damping},
      {"beta", DampingTarget{&p.damping, &RayleighDamping::beta}, optional, Rule::not_negative, "s",
       "the part's own Rayleigh damping, stiffness part", damping},
  };
}

SceneKeys keys_of(Orthotropy& o)
{
  return {
      {"young", &o.young, required, Rule::any, "Pa", "E1, E2, E3 along the axes"},
      {"poisson", &o.poisson, required, Rule::any, "-",
       "nu12, nu13, nu23; nu12 is the contraction along 2 over the extension along 1 under tension along 1"},
      {"shear", &o.shear, required, Rule::any, "Pa", "G12, G13, G23"},
      {"axis_1", &o.axis_1, optional, Rule::direction, "-", "direction of the first axis: x, y, z or a vector"},
      {"axis_2", &o.axis_2, optional, Rule::direction, "-",
       "direction of the second one, square to it; the third is square to both"},
  };
}

SceneKeys keys_of(Point& p)
{
  return {
      {"name", &p.name, required, Rule::any, "text", "name for springs, forces, contacts and probes"},
      {"at", &p.at, required, Rule::any, "m", "position", mesh},
      {"mass", &p.mass, optional, Rule::not_negative, "kg", "point mass", mass},
      {"free", &p.free, required, Rule::any, "motions", "motions that are free: any of x y z rx ry rz, or all, none"},
  };
}

SceneKeys keys_of(RigidBody& b)
{
  return {
      {"name", &b.name, required, Rule::any, "text", "name for springs, forces and probes"},
      {"surfaces", &b.surfaces, required, Rule::any, "texts", "a named surface, or a list of them"},
      {"at", &b.at, required, Rule::any, "m", "reference point", mesh},
      {"mass", &b.mass, optional, Rule::not_negative, "kg", "mass at the reference point", mass},
      {"inertia", &b.inertia, optional, Rule::any, "kg m2", "xx yy zz, or xx yy zz xy yz zx, about the reference point",
       mass},
      {"free", &b.free, required, Rule::any, "motions", "motions that are free: any of x y z rx ry rz, or all, none"},
  };
}

SceneKeys keys_of(Spring& s)
{
  return {
      {"from", &s.from, required, Rule::any, "text", "point or rigid body"},
      {"to", &s.to, optional, Rule::any, "text", "point, rigid body or ground"},
      {"direction", &s.direction, required, Rule::direction, "-", "line of action: x, y, z or a vector",
       stiffness_and_mass},
      {"stiffness", &s.stiffness, optional, Rule::not_negative, "N/m", "stiffness of the spring", stiffness_and_mass},
      {"damping", &s.damping, optional, Rule::not_negative, "N s/m", "constant of the dashpot", damping},
  };
}

SceneKeys keys_of(Superelement& s)
{
  return {
      {"name", &s.name, required, Rule::any, "text", "name for messages"},
      {"folder", &s.folder, required, Rule::folder, "path",
       "folder of M K .petsc, dofs.txt, nodes.txt, as tools/matrices writes them; C.petsc may be there"},
      {"on", &s.on, required, Rule::any, "texts",
       "named group, point or rigid body that has its retained nodes, or a list of them"},
  };
}

SceneKeys keys_of(Support& s)
{
  return {
      {"on", &s.on, required, Rule::any, "text", "named group or point; rows or nodes of a matrix scene"},
      {"fixed", &s.fixed, required, Rule::any, "motions", "motions that are held: any of x y z rx ry rz, or all"},
  };
}

SceneKeys keys_of(Force& f)
{
  return {
      {"on", &f.on, required, Rule::any, "text",
       "point, rigid body, or named group, whose nodes share the force; rows or nodes of a matrix scene"},
      {"vector", &f.vector, required, Rule::any, "N", "the whole force", load},
  };
}

SceneKeys keys_of(Pressure& p)
{
  return {
      {"on", &p.on, required, Rule::any, "text", "named surface"},
      {"value", &p.value, required, Rule::any, "Pa", "pressure; a positive one presses onto the solid", load},
  };
}

SceneKeys keys_of(Rotation& r)
{
  return {
      {"axis", &r.axis, required, Rule::direction, "-", "axis of rotation: x, y, z or a vector"},
      {"centre", &r.centre, optional, Rule::any, "m", "a point of the axis; the origin when absent"},
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
       "largest distance of the surfaces along the normal; it adds to the gap", mesh},
      {"normal", &c.normal, optional, Rule::direction, "-",
       "normal out of the rotor; points need it, surfaces have that of the slave side at each node", mesh},
      {"compliance", &c.compliance, optional, Rule::not_negative, "m3/N",
       "approach of the surfaces over pressure, as of rough linings, in series with the pairs; of points in m/N; 0: "
       "rigid",
       contact},
      {"slave", choice_of(c.slave), optional, Rule::any, "word",
       "side whose nodes have the pairs: the finer or softer one"},
      {"tangents", &c.tangents, optional, Rule::direction, "-",
       "one direction: plane friction along it; or two; when absent, two are chosen", contact},
      {"rotation", &c.rotation, optional, Rule::any, "table", "rotation of the rotor: {axis, centre, rate}", contact},
      {"velocity", &c.velocity, optional, Rule::any, "m/s", "velocity of the rotor's surface, instead of a rotation",
       contact},
  };
}

SceneKeys keys_of(Tie& t)
{
  return {
      {"slave", &t.slave, required, Rule::any, "text",
       "named surface whose nodes follow: the finer or softer side, and the smaller one; or a named curve, the edge of "
       "a shell"},
      {"master", &t.master, required, Rule::any, "text", "named surface that they follow"},
      {"reach", &t.reach, optional, Rule::not_negative, "m",
       "largest distance of the surfaces along the normal; 0: they coincide, curved ones up to the chords of their "
       "faces"},
  };
}

SceneKeys keys_of(FrictionLaw& f)
{
  return {
      {"coefficient", &f.coefficient, optional, Rule::not_negative, "-",
       "Coulomb's mu; with a decay_speed its value at high speed", friction},
      {"static_coefficient", &f.static_coefficient, optional, Rule::not_negative, "-",
       "mu at rest; it goes with decay_speed, without which mu is constant", friction},
      {"decay_speed", &f.decay_speed, optional, Rule::not_negative, "m/s",
       "mu(s) = coefficient + (static_coefficient - coefficient) exp(-s/decay_speed) at the sliding speed s; 0: "
       "constant",
       friction},
      {"direction_damping", &f.direction_damping, optional, Rule::any, "switch",
       "keep the damping mu r_n/abs(v_d) (I - e e') that the friction direction adds to the modes"},
  };
}

SceneKeys keys_of(RayleighDamping& d)
{
  return {
      {"alpha", &d.alpha, optional, Rule::not_negative, "1/s", "mass part", damping},
      {"beta", &d.beta, optional, Rule::not_negative, "s", "stiffness part", damping},
      {"loss_frequency", &d.loss_frequency, optional, Rule::not_negative, "Hz",
       "where loss factors have their viscous equivalent eta/omega K in time steps and in the estimate; modes take "
       "complex stiffness",
       damping},
      {"measured", &d.measured, optional, Rule::positive, "table",
       "instead of alpha and beta, which are fitted to damping ratios measured on modes: [[frequency in Hz, ratio], "
       "...], at least two, frequencies rising"},
  };
}

SceneKeys keys_of(ModesSettings& m)
{
  return {
      {"enabled", &m.enabled, optional, Rule::any, "switch", "run this stage"},
      {"method", choice_of(m.method), optional, Rule::any, "word",
       "projection on real modes, the full sparse problem, or both, where the full one decides; auto is full, and both "
       "where the count of pairs below the band is not confirmed"},
      {"real_modes", &m.real_modes, optional, Rule::not_negative, "-",
       "number of real modes of the projection; 0: those of the band"},
      {"residual_passes", &m.residual_passes, optional, Rule::not_negative, "-",
       "corrections of the projection by the residual"},
      {"band", &m.band, optional, Rule::positive, "Hz", "every mode below is reported"},
      {"reduced_matrices", &m.reduced_matrices, optional, Rule::any, "switch",
       "writes the brake, reduced to the modes found and to the attachment shapes of all pairs, as a matrix scene into "
       "reduced/"},
  };
}

SceneKeys keys_of(EstimateSettings& e)
{
  return {{"enabled", &e.enabled, optional, Rule::any, "switch", "run this stage"}};
}

SceneKeys keys_of(TransientSettings& t)
{
  return {
      {"enabled", &t.enabled, optional, Rule::any, "switch", "run this stage; true when the table is there"},
      {"start", &t.start, optional, Rule::any, "word",
       "mode (a small motion of the unstable mode), estimate (its estimated amplitude), equilibrium (sliding without "
       "vibration, from which the factors below lead away), rest (no displacement and no velocity), or a state file"},
      {"amplitude", &t.amplitude, optional, Rule::not_negative, "m",
       "largest displacement with start = \"mode\"; 0: a tenth of first lift-off"},
      {"periods", &t.periods, optional, Rule::positive, "-",
       "length in periods of the unstable mode that is followed; where none is unstable, steps and step_size give the "
       "length"},
      {"steps_per_period", &t.steps_per_period, optional, Rule::positive, "-", "time steps a period"},
      {"steps", &t.steps, optional, Rule::not_negative, "-",
       "number of time steps, with step_size, instead of periods"},
      {"step_size", &t.step_size, optional, Rule::not_negative, "s", "time step, with steps, instead of periods"},
      {"theta", &t.theta, optional, Rule::fraction, "-", "parameter of the theta-method; 0.5 conserves energy"},
      {"load_factor", &t.ramps.load, optional, Rule::any, "table",
       "factor in time on all forces and pressures: [[0, 0], [0.1, 1]], rows of a time in s and the factor, straight "
       "lines between"},
      {"speed_factor", &t.ramps.speed, optional, Rule::any, "table",
       "factor in time on the drive velocities of all contacts"},
      {"friction_factor", &t.ramps.friction, optional, Rule::not_negative, "table",
       "factor in time on the coefficients of friction"},
      {"save_state", &t.save_state, optional, Rule::any, "path", "state file that is written at the end"},
  };
}

SceneKeys keys_of(CycleSettings& c)
{
  return {
      {"enabled", &c.enabled, optional, Rule::any, "switch", "run this stage; true when the table is there"},
      {"start", &c.start, optional, Rule::any, "word",
       "where the search starts: the unstable modes at their estimates (estimate), the followed mode at an amplitude "
       "(mode), the end of the run's own transient (transient), the cycle on a coarser mesh (coarse), or a state file"},
      {"amplitude", &c.amplitude, optional, Rule::not_negative, "m",
       "largest displacement at start = \"mode\"; 0: twice first lift-off"},
      {"coarse_parameters", &c.coarse_parameters, optional, Rule::any, "table",
       "with start = \"coarse\": values for the DefineConstant of the scene's .geo that make its mesh coarser"},
      {"coarse_mesh", &c.coarse_mesh, optional, Rule::file, "path",
       "or a mesh or geometry of its own, with the same parts, surfaces and groups; coarse_parameters are then its "
       "own"},
      {"steps_per_period", &c.steps_per_period, optional, Rule::not_negative, "-", "time steps a period; 0: chosen"},
      {"tolerance", &c.tolerance, optional, Rule::not_negative, "-",
       "largest residual in the full space that counts as a cycle; 0: chosen"},
      {"free_periods", &c.free_periods, optional, Rule::not_negative, "-",
       "periods integrated before the first Newton step"},
      {"starts", &c.starts, optional, Rule::not_negative, "-",
       "number of starts whose motions are listed: the unstable modes, their pairs, random sums of modes; beside a "
       "stable equilibrium the mode that decays slowest, or that a given start has most of; 0: where several modes of "
       "a model of at most 50 degrees of freedom are unstable these, their pairs and five random sums, at most 16; "
       "else none"},
      {"theta", &c.theta, optional, Rule::fraction, "-", "parameter of the theta-method; 0.5 conserves energy"},
      {"save_state", &c.save_state, optional, Rule::any, "path", "state file of the cycle's start"},
  };
}

SceneKeys keys_of(BranchSettings& b)
{
  return {
      {"key", &b.key, required, Rule::any, "text",
       "number of the structure, its contact or its loads, as --set names it: friction.coefficient, force.0.vector.2"},
      {"from", &b.from, required, Rule::any, "-", "its value at one end of the branch, in its own unit"},
      {"to", &b.to, required, Rule::any, "-", "its value at the other end; the scene's own value is between them"},
      {"points", &b.points, optional, Rule::positive, "-",
       "number of points if this number alone changed along the branch"},
      {"corrections", &b.corrections, optional, Rule::not_negative, "-",
       "number of points, evenly spread, where the full model's cycle is found beside a reduced model's; none where "
       "the full model is followed"},
  };
}

SceneKeys keys_of(SweepSettings& s)
{
  return {
      {"key", &s.key, required, Rule::any, "texts",
       "number of the structure, its contact or its loads, as --set names it, or a list of two"},
      {"from", &s.from, optional, Rule::any, "-",
       "its first value, in its own unit; a list of two for two numbers, here and in the next lines"},
      {"to", &s.to, optional, Rule::any, "-", "its last value"},
      {"points", &s.points, optional, Rule::positive, "-", "number of values from the first to the last"},
      {"values", &s.values, optional, Rule::any, "-", "list of values of a single number, instead of the grid"},
      {"samples", &s.samples, optional, Rule::not_negative, "-",
       "number of random points of the ranges, evenly distributed, instead of the grid; 0: none"},
      {"seed", &s.seed, optional, Rule::not_negative, "-", "seed of the random points"},
      {"directions", choice_of(s.directions), optional, Rule::any, "word",
       "one direction of rotation, that of the scene, or both"},
      {"stages", choice_of(s.stages), optional, Rule::any, "word",
       "at each point the equilibrium alone, or the modes too, or also the cycle where modes grow"},
  };
}

SceneKeys keys_of(SensitivitySettings& s)
{
  return {{"numbers", &s.numbers, optional, Rule::any, "texts",
           "derivatives with respect to these numbers only, as --set names them; else friction, moduli, densities, "
           "loss factors, damping, springs, masses and rates of rotation, where they are not 0"}};
}

SceneKeys keys_of(Change& c)
{
  return {
      {"probe", &c.probe, required, Rule::any, "text", "name of the probe where it acts, along the probe's direction"},
      {"mass", &c.mass, optional, Rule::not_negative, "kg", "added mass"},
      {"damping", &c.damping, optional, Rule::not_negative, "N s/m", "constant of a dashpot to the ground"},
      {"stiffness", &c.stiffness, optional, Rule::not_negative, "N/m",
       "stiffness of a spring to the ground, which is relaxed at equilibrium"},
  };
}

SceneKeys keys_of(ResponseSettings& r)
{
  return {
      {"excitation", &r.excitation, optional, Rule::any, "texts",
       "names of the probes that are driven, each by a unit force along its direction; without it all are"},
      {"from", &r.from, required, Rule::positive, "Hz", "lowest frequency"},
      {"to", &r.to, required, Rule::positive, "Hz", "highest frequency"},
      {"count", &r.count, optional, Rule::positive, "-", "number of frequencies, evenly spread, from 2 to 100 000"},
  };
}

SceneKeys keys_of(RobustnessSettings& r)
{
  return {
      {"samples", &r.samples, optional, Rule::positive, "-", "number of random scenes"},
      {"checks", &r.checks, optional, Rule::not_negative, "-",
       "number of them, the first ones, that are computed by the full problem as well"},
      {"seed", &r.seed, optional, Rule::not_negative, "-", "seed of the random numbers"},
      {"confidence", &r.confidence, optional, Rule::fraction, "-", "confidence of the intervals of the probabilities"},
  };
}

SceneKeys keys_of(UncertainNumber& u)
{
  return {
      {"key", &u.key, required, Rule::any, "text",
       "number of the structure, its contact or its loads, as --set names it"},
      {"distribution", choice_of(u.distribution), optional, Rule::any, "word", "normal, lognormal or uniform"},
      {"mean", &u.mean, optional, Rule::any, "-", "mean of the number itself, in its own unit; 0: the scene's value"},
      {"deviation", &u.deviation, optional, Rule::not_negative, "-", "standard deviation of the number itself"},
      {"from", &u.from, optional, Rule::any, "-", "least value of a uniform number"},
      {"to", &u.to, optional, Rule::any, "-", "greatest value of a uniform number"},
  };
}

SceneKeys keys_of(Probe& p)
{
  return {
      {"name", &p.name, required, Rule::any, "text", "name in the results"},
      {"on", &p.on, required, Rule::any, "text", "point, rigid body or named group; a row or node of a matrix scene"},
      {"at", &p.at, optional, Rule::any, "m", "the group's node that is nearest to this position"},
      {"direction", &p.direction, optional, Rule::direction, "-",
       "direction of the displacement: x, y, z or a vector; not for dof:N"},
  };
}

} // namespace squeal
