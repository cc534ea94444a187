/// The keys of what joins bodies and of what moves them: couplings, connectors, beams, bolts, added masses, rotors.
#include "scene_keys.hpp"

namespace squeal
{

namespace
{

using enum Need;
using enum Rule;
using enum Effect;
using Study::derive, Study::double_it, Study::derive_and_double;

} // namespace

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
      {"loss_factor", &c.loss_factor, "-", "eta of its stiffness K (1 + i eta), as of a [[part]]", not_negative,
       damping, derive},
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
      {"loss_factor", &b.loss_factor, "-", "eta of its stiffness K (1 + i eta), as of a [[part]]", not_negative,
       damping, derive},
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
