/// The keys of the tables of stages and studies.
#include "scene_keys.hpp"

namespace squeal
{

namespace
{

using enum Need;
using enum Rule;
using enum Effect;
using Study::derive, Study::double_it, Study::derive_and_double;

/// The key of the loss factor of beams and connectors.
SceneKey loss_factor_key(double& loss_factor)
{
  return {"loss_factor", &loss_factor, "-",   "eta of its stiffness K (1 + i eta), as of a [[part]]",
          not_negative,  damping,      derive};
}

} // namespace

SceneKeys keys_of(ModesSettings& m)
{
  return {
      {"enabled", &m.enabled, "switch", "run this stage"},
      {"method", choice_of(m.method), "word",
       "slices of the band, corrected by residuals (full), or SLEPc's TOAR around zero, to compare "
       "with "
       "(toar)"},
      {"band", &m.band, "Hz", "every mode below is reported", positive},
      {"mesh_error", choice_of(m.mesh_error), "word",
       "what the mesh leaves open on the unstable modes and the two stable ones of least damping ratio: off, or by a "
       "model with every element divided (refinement), which takes eight times the memory and more"},
  };
}

SceneKeys keys_of(EstimateSettings& e)
{
  return {{"enabled", &e.enabled, "switch", "run this stage"}};
}

SceneKeys keys_of(TransientSettings& t)
{
  return {
      {"enabled", &t.enabled, "switch", "run this stage; true when the table is there"},
      {"start", StartTarget{choice_of(t.start.kind), &t.start.file}, "word",
       "mode (a small motion of the unstable mode), estimate (its estimated amplitude), equilibrium (sliding without "
       "vibration, from which the factors below lead away), rest (no displacement and no velocity), or a state file"},
      {"amplitude", &t.amplitude, "m", "largest displacement with start = \"mode\"; 0: a tenth of first lift-off",
       not_negative},
      {"periods", &t.periods, "-",
       "length in periods of the unstable mode that is followed; where none is unstable, steps and step_size give the "
       "length",
       positive},
      {"steps_per_period", &t.steps_per_period, "-", "time steps a period", positive},
      {"steps", &t.steps, "-", "number of time steps, with step_size, instead of periods", not_negative},
      {"step_size", &t.step_size, "s", "time step, with steps, instead of periods", not_negative},
      {"theta", &t.theta, "-", "parameter of the theta-method; 0.5 conserves energy", fraction},
      {"load_factor", &t.ramps.load, "table",
       "factor in time on all forces and pressures: [[0, 0], [0.1, 1]], rows of a time in s and the factor, straight "
       "lines between"},
      {"speed_factor", &t.ramps.speed, "table", "factor in time on the drive velocities of all contacts"},
      {"friction_factor", &t.ramps.friction, "table", "factor in time on the coefficients of friction", not_negative},
      {"save_state", &t.save_state, "path", "state file that is written at the end"},
  };
}

SceneKeys keys_of(CycleSettings& c)
{
  return {
      {"enabled", &c.enabled, "switch", "run this stage; true when the table is there"},
      {"start", StartTarget{choice_of(c.start.kind), &c.start.file}, "word",
       "where the search starts: the unstable modes at their estimates (estimate), the followed mode at an amplitude "
       "(mode), the end of the run's own transient (transient), or a state file"},
      {"amplitude", &c.amplitude, "m", "largest displacement at start = \"mode\"; 0: twice first lift-off",
       not_negative},
      {"steps_per_period", &c.steps_per_period, "-", "time steps a period; 0: chosen", not_negative},
      {"tolerance", &c.tolerance, "-", "largest residual in the full space that counts as a cycle; 0: chosen",
       not_negative},
      {"free_periods", &c.free_periods, "-", "periods integrated before the first Newton step", not_negative},
      {"starts", &c.starts, "-",
       "number of starts whose motions are listed: the unstable modes, their pairs, random sums of modes; beside a "
       "stable equilibrium the mode that decays slowest, or that a given start has most of; 0, where trajectories cost "
       "little: a small motion of the first unstable mode; where several grow these, their pairs and five random sums, "
       "at "
       "most 16; six beside stable sliding where friction falls with speed",
       not_negative},
      {"theta", &c.theta, "-", "parameter of the theta-method; 0.5 conserves energy", fraction},
      {"save_state", &c.save_state, "path", "state file of the cycle's start"},
  };
}

SceneKeys keys_of(BranchSettings& b)
{
  return {
      {"key", &b.key, "text",
       "number of the structure, its contact or its loads, as --set names it: friction.coefficient, force.0.vector.2",
       required},
      {"from", &b.from, "-", "its value at one end of the branch, in its own unit", required},
      {"to", &b.to, "-", "its value at the other end; the scene's own value is between them", required},
      {"points", &b.points, "-", "number of points if this number alone changed along the branch", positive},
  };
}

SceneKeys keys_of(SweepSettings& s)
{
  return {
      {"key", &s.key, "texts", "number of the structure, its contact or its loads, as --set names it"},
      {"from", &s.from, "-", "its first value, in its own unit"},
      {"to", &s.to, "-", "its last value"},
      {"points", &s.points, "-", "number of values from the first to the last", positive},
      {"values", &s.values, "-", "list of values, instead of the grid"},
      {"table", &s.table, "path",
       "CSV file of points instead of all these: a head of keys, such as numbers.clamp, and a line of values a point. "
       "Modes are named by the first one's",
       file},
      {"directions", choice_of(s.directions), "word", "one direction of rotation, that of the scene, or both"},
      {"stages", choice_of(s.stages), "word", "at each point the equilibrium alone, or the modes too"},
  };
}

SceneKeys keys_of(SensitivitySettings& s)
{
  return {{"numbers", &s.numbers, "texts",
           "derivatives with respect to these numbers only, as --set names them; else friction, moduli, densities, "
           "loss factors, damping, springs, masses and rates of rotation, where they are not 0"}};
}

SceneKeys keys_of(Change& c)
{
  return {
      {"probe", &c.probe, "text", "name of the probe where it acts, along the probe's direction", required},
      {"mass", &c.mass, "kg", "added mass", not_negative},
      {"damping", &c.damping, "N s/m", "constant of a dashpot to the ground", not_negative},
      {"stiffness", &c.stiffness, "N/m", "stiffness of a spring to the ground, which is relaxed at equilibrium",
       not_negative},
  };
}

SceneKeys keys_of(ResponseSettings& r)
{
  return {
      {"excitation", &r.excitation, "texts",
       "names of the probes that are driven, each by a unit force along its direction; without it all are"},
      {"from", &r.from, "Hz", "lowest frequency", required, positive},
      {"to", &r.to, "Hz", "highest frequency", required, positive},
      {"count", &r.count, "-", "number of frequencies, evenly spread, from 2 to 100 000", positive},
  };
}

SceneKeys keys_of(RobustnessSettings& r)
{
  return {
      {"samples", &r.samples, "-", "number of random scenes", positive},
      {"seed", &r.seed, "-", "seed of the random numbers", not_negative},
      {"confidence", &r.confidence, "-", "confidence of the intervals of the probabilities", fraction},
  };
}

SceneKeys keys_of(UncertainNumber& u)
{
  return {
      {"key", &u.key, "text", "number of the structure, its contact or its loads, as --set names it", required},
      {"distribution", choice_of(u.distribution), "word", "normal, lognormal or uniform"},
      {"mean", &u.mean, "-", "mean of the number itself, in its own unit; 0: the scene's value"},
      {"deviation", &u.deviation, "-", "standard deviation of the number itself", not_negative},
      {"from", &u.from, "-", "least value of a uniform number"},
      {"to", &u.to, "-", "greatest value of a uniform number"},
  };
}

// The keys of what joins bodies and of what moves them: couplings, connectors, beams, bolts, added masses, rotors.

SceneKeys keys_of(Axis& a)
{
  return {
      {"axis", &a.axis, "-", "axis of the cylinder: x, y, z or a vector", required, direction},
      {"centre", &a.centre, "m", "a point of the axis; the origin when absent"},
  };
}

SceneKeys keys_of(Coupling& c)
{
  return {
      {"name", &c.name, "text", "name for springs, connectors, forces and probes", required},
      {"on", &c.on, "texts", "a named group, or a list of them, whose nodes it follows", required},
      {"at", &c.at, "m", "reference point", required, mesh},
      {"weights", &c.weights, "-", "of each node in the mean, one a group; 1 when absent", positive, mesh},
      {"mass", &c.mass, "kg", "mass at the reference point", not_negative, mass, derive_and_double},
      {"inertia", &c.inertia, "kg m2", "xx yy zz, or xx yy zz xy yz zx, about the reference point", mass, Rule::inertia,
       double_it},
  };
}

SceneKeys keys_of(Connector& c)
{
  return {
      {"from", &c.from, "text", "point, rigid body or coupling", required},
      {"to", &c.to, "text", "the same, or ground, which is the default"},
      {"at", &c.at, "m",
       "place at which both motions are compared; the middle between them when absent, of the ground `from` itself",
       mesh},
      {"axis_1", &c.frame.axis_1, "-", "x of its motions: x, y, z or a vector", direction, mesh},
      {"axis_2", &c.frame.axis_2, "-", "y of its motions, square to it; z is square to both", direction, mesh},
      {"locked", &c.locked, "motions",
       "motions that both share: all but rx are a hinge about axis_1, all but x a slot along it, all but x rx a "
       "cylinder"},
      {"stiffness", &c.stiffness, "N/m", "six of x y z rx ry rz, or the 36 of a symmetric matrix; rotations in N m",
       stiffness_and_mass, double_it},
      {"damping", &c.damping, "N s/m", "six or 36 constants, likewise; rotations in N m s", damping},
      loss_factor_key(c.loss_factor),
  };
}

SceneKeys keys_of(Beam& b)
{
  return {
      {"name", &b.name, "text", "name for bolts and messages", required},
      {"from", &b.from, "text", "point, rigid body or coupling at one end", required},
      {"to", &b.to, "text", "the same at the other end", required},
      {"young", &b.young, "Pa", "Young's modulus", required, positive, stiffness_and_mass, derive_and_double},
      {"poisson", &b.poisson, "-", "Poisson's ratio", poisson, stiffness_and_mass},
      {"density", &b.density, "kg/m3", "mass density; 0: no mass", not_negative, mass, derive_and_double},
      {"diameter", &b.diameter, "m", "of a round section; when absent, the next three are needed", not_negative,
       stiffness_and_mass},
      {"area", &b.area, "m2", "area of the section", not_negative, stiffness_and_mass},
      {"bending", &b.bending, "m4", "second moments of area for bending along axis_2 and across it; one for both",
       positive, stiffness_and_mass},
      {"torsion", &b.torsion, "m4", "torsion constant", not_negative, stiffness_and_mass},
      {"shear_factor", &b.shear_factor, "-", "area that carries shear over the area: 0.9 of round ones; 0: rigid",
       not_negative, stiffness_and_mass},
      {"axis_2", &b.axis_2, "-", "direction across the beam; any when absent", direction, stiffness_and_mass},
      {"elements", &b.elements, "-", "number of elements along it", positive},
      loss_factor_key(b.loss_factor),
  };
}

SceneKeys keys_of(AddedMass& m)
{
  return {
      {"on", &m.on, "text", "named group, whose nodes share the mass equally", required},
      {"mass", &m.mass, "kg", "the whole mass", required, not_negative, mass, derive_and_double},
  };
}

SceneKeys keys_of(Bolt& b)
{
  return {
      {"name", &b.name, "text", "name for steps and results", required},
      {"section", &b.section, "text", "named surface of the mesh across the shank, between its elements"},
      {"axis", &b.axis, "-", "direction of the shank at the section: x, y, z or a vector", direction, load},
      {"beam", &b.beam, "text", "a [[beam]] as the shank, instead of a section"},
      {"tension", &b.tension, "N", "force that it is tightened to; it keeps its length from then on", required,
       positive, load},
  };
}

SceneKeys keys_of(Rotor& r)
{
  return {
      {"part", &r.part, "text", "part that moves past others, or a point", required},
      {"axis", &r.rotation.axis, "-", "axis of rotation: x, y, z or a vector; with rate", direction, drive},
      {"centre", &r.rotation.centre, "m", "a point of the axis; the origin when absent", drive},
      {"rate", &r.rotation.rate, "rad/s", "angular velocity", drive, derive},
      {"velocity", &r.velocity, "m/s", "of its surface, instead of axis and rate: a belt", velocity, drive},
  };
}

} // namespace squeal
