#pragma once
/// The pieces of a scene's model: materials, parts, points, springs, supports, loads, contacts and ties, as plain data
/// in SI units.
#include "squeal/base/vec3.hpp"
#include "squeal/base/words.hpp"

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace squeal
{

/// A choice among the motions x y z rx ry rz of a node or body.
using Motions = std::array<bool, 6>;

inline constexpr std::array motion_words = {"x", "y", "z", "rx", "ry", "rz"};
inline constexpr Motions every_motion = {true, true, true, true, true, true};
inline constexpr const char *all_motions = "all", *no_motions = "none"; // instead of a list of them

/// The axis of a cylindrical frame.
struct Axis
{
  Vec3 axis{};   // [-] unit vector
  Vec3 centre{}; // [m] a point of it
};

/// A local frame with the axes 1, 2 and 3 = 1 x 2.
struct Frame
{
  Vec3 axis_1 = {1, 0, 0};        // [-] unit
  Vec3 axis_2 = {0, 1, 0};        // [-] unit, square to axis_1
  std::optional<Axis> cylinder{}; // if given, axis 1 is radial, 2 tangential, 3 along it, at each place
};

/// Nine constants of orthotropic elasticity along the axes 1, 2 and 3 = 1 x 2. A stress along i alone strains i by
/// stress/E_i and j by -nu_ij stress/E_i; nu_ij/E_i = nu_ji/E_j.
struct Orthotropy
{
  Vec3 young{};                   // [Pa] E1 E2 E3
  Vec3 poisson{};                 // [-] nu12 nu13 nu23: contraction along the second axis under tension along the first
  Vec3 shear{};                   // [Pa] G12 G13 G23
  Vec3 axis_1 = {1, 0, 0};        // [-] unit
  Vec3 axis_2 = {0, 1, 0};        // [-] unit, square to axis_1
  std::optional<Axis> cylinder{}; // if given, axis 1 is radial and axis 2 tangential about it, at each element
};

/// Linear elasticity.
struct Material
{
  double young = 0;                       // [Pa] Young's modulus
  double poisson = 0;                     // [-] Poisson's ratio
  double density = 0;                     // [kg/m3] mass density
  std::optional<Orthotropy> orthotropy{}; // instead of young and poisson; of solids
};

/// Rayleigh damping C = alpha M + beta K.
struct RayleighDamping
{
  double alpha = 0;          // [1/s]
  double beta = 0;           // [s]
  double loss_frequency = 0; // [Hz] at which loss factors have their viscous equivalent in time; of the scene alone
};

/// A rotation about a fixed axis.
struct Rotation
{
  Vec3 axis{};     // [-] unit vector
  Vec3 centre{};   // [m] a point of the axis
  double rate = 0; // [rad/s]
};

/// A named volume of the mesh, or a named surface if it has a thickness (shell).
struct Part
{
  std::string name;
  Material material;
  double thickness = 0;                   // [m] of a shell; 0 for a solid
  std::optional<RayleighDamping> damping; // if absent, the scene's
  double loss_factor = 0;                 // [-] eta of the stiffness K (1 + i eta)
  std::optional<Rotation> rotation{};     // of a solid of revolution that spins; if absent, it is at rest
  double offset = 0;                      // [m] of a shell: from its nodes to its middle surface, along its normal
};

/// A node of its own: a point mass, or an end of springs.
struct Point
{
  std::string name;
  Vec3 at{};       // [m] position
  double mass = 0; // [kg]
  Motions free{};  // the other motions are fixed
};

/// Named surfaces that move as one rigid body: u(x) = u_ref + theta x (x - at), an exact constraint.
struct RigidBody
{
  std::string name;
  std::vector<std::string> surfaces;
  Vec3 at{};                       // [m] reference point
  double mass = 0;                 // [kg] at the reference point
  std::array<double, 6> inertia{}; // [kg m2] xx yy zz xy yz zx about the reference point
  Motions free{};                  // of the reference point; the other motions are fixed
  Motions motions = every_motion;  // of the surfaces' nodes that follow; the others are the nodes' own
};

/// A point that moves with the weighted mean of nodes: a distributing coupling. What acts on it is shared by the nodes.
struct Coupling
{
  std::string name;
  std::vector<std::string> on;     // named groups
  Vec3 at{};                       // [m] reference point
  std::vector<double> weights;     // [-] of each node, one a group; empty: 1
  double mass = 0;                 // [kg] at the reference point
  std::array<double, 6> inertia{}; // [kg m2] as of a rigid body
};

/// The end of a spring that does not move.
inline constexpr const char* ground = "ground";

/// A spring and a dashpot in parallel, between two points, bodies or groups, or from one of them to the ground. The
/// nodes of a group have equal shares of it.
struct Spring
{
  std::string from;        // point, rigid body, coupling, group or ground
  std::string to = ground; // the same
  Vec3 direction{};        // [-] unit vector of the line of action
  double stiffness = 0;    // [N/m]
  double damping = 0;      // [N s/m]
};

/// A joint of two bodies, or of one with the ground; both rigid bodies are taken to one place. The motion of `to`
/// relative to `from` is locked as in a joint, or has stiffness as in a bushing.
struct Connector
{
  std::string from;                // point, rigid body or coupling
  std::string to = ground;         // the same, or ground
  std::optional<Vec3> at{};        // [m] if absent, the middle between both; at `from` of one to the ground
  Frame frame{};                   // of all below
  Motions locked{};                // that are zero
  std::vector<double> stiffness{}; // [N/m, N m] six of x y z rx ry rz, or 36 by rows; empty: none
  std::vector<double> damping{};   // [N s/m, N m s] the same
  double loss_factor = 0;          // [-] eta of the stiffness K (1 + i eta)
};

/// A straight beam between two points or bodies, whose nodes between them are its own.
struct Beam
{
  std::string name;
  std::string from, to;          // points, rigid bodies or couplings
  double young = 0;              // [Pa]
  double poisson = 0;            // [-]
  double density = 0;            // [kg/m3]
  double diameter = 0;           // [m] of a round section; 0: by the numbers below
  double area = 0;               // [m2]
  std::vector<double> bending{}; // [m4] second moments of area for bending along axes 2 and 3; one: both
  double torsion = 0;            // [m4] torsion constant
  double shear_factor = 0;       // [-] area of shear over area; 0: rigid in shear
  Vec3 axis_2{};                 // [-] unit, across the beam; zero: any
  int elements = 8;              // [-]
  double loss_factor = 0;        // [-]
};

/// Mass that the nodes of a group share equally.
struct AddedMass
{
  std::string on;  // named group
  double mass = 0; // [kg]
};

/// A reduced structure of another code: its matrices on motions of retained nodes and on modal coordinates.
struct Superelement
{
  std::string name;
  std::filesystem::path folder; // of M K C .petsc, dofs.txt and nodes.txt; absolute
  std::vector<std::string> on;  // named groups, points or rigid bodies that have its retained nodes
};

/// Fixed motions of the nodes of a group.
struct Support
{
  std::string on; // named group or point; rows of a matrix scene (RowNames), also below
  Motions fixed{};
  Frame frame{};       // of the motions
  Vec3 displacement{}; // [m] that fixed x y z have
  Vec3 rotation{};     // [rad] that fixed rx ry rz have
};

/// Whether a support moves what it holds.
inline bool moves(const Support& support)
{
  return support.displacement != Vec3{} || support.rotation != Vec3{};
}

/// Whether a support holds motions along the axes of the scene, without moving them.
inline bool is_plain(const Support& support)
{
  return !moves(support) && !support.frame.cylinder && support.frame.axis_1 == Frame{}.axis_1 &&
         support.frame.axis_2 == Frame{}.axis_2;
}

/// A force on a node, a body or a group.
struct Force
{
  std::string on; // point, rigid body, or node group whose nodes share the force equally
  Vec3 vector{};  // [N] total force
  Vec3 moment{};  // [N m] total moment, on nodes that rotate
};

/// A pressure on a surface.
struct Pressure
{
  std::string on;   // named surface
  double value = 0; // [Pa] positive towards the solid
};

/// A factor along time or speed: straight lines between the given values, constant before the first and after the
/// last. Without values it is 1.
struct FactorTable
{
  std::vector<double> at;    // [s] or [m/s], rising
  std::vector<double> value; // [-] one a place
};

/// The factor at a place.
double factor_at(const FactorTable& factor, double place);

/// The slope of the line that the factor is on; 0 where it is constant.
double slope_at(const FactorTable& factor, double place);

/// A bolt: a section through its shank, across which it is shortened until it has its tension. It keeps that length.
struct Bolt
{
  std::string name;
  std::string section; // named surface across the shank; empty: of a beam
  std::string beam;    // its name
  Vec3 axis{};         // [-] unit, of a section
  double tension = 0;  // [N]
};

/// Coulomb's law with mu(s) = coefficient + (static_coefficient - coefficient) exp(-s/decay_speed) at the sliding speed
/// s, or coefficient times a factor of s. Without a decay_speed a static_coefficient is a level of rest alone, which
/// any sliding leaves.
struct FrictionLaw
{
  double coefficient = 0;          // [-]
  bool direction_damping = true;   // keep mu r_n/|v_d| (I - e e') in the modes (src/README.md, section 3.3)
  double static_coefficient = 0;   // [-] mu at rest; 0 without a decay_speed: as in sliding
  double decay_speed = 0;          // [m/s] 0: no such decay
  FactorTable factor_at_speed{};   // [m/s] on the coefficient
  bool slipped_pairs_stick = true; // in modes, of pairs without a drive that slipped on the load path
};

/// Whether mu has a level of rest and one of sliding, without a law between.
inline bool has_two_levels(const FrictionLaw& law)
{
  return law.decay_speed == 0 && law.static_coefficient > 0;
}

/// Whether mu changes with the sliding speed.
inline bool depends_on_speed(const FrictionLaw& law)
{
  return law.decay_speed > 0 || has_two_levels(law) || !law.factor_at_speed.at.empty();
}

/// The side of a contact whose nodes have the pairs.
enum class SlaveSide
{
  stator,
  rotor,
};

template <> inline constexpr std::array words_of<SlaveSide> = {"stator", "rotor"};

/// Contact of two named surfaces, whose meshes need not match, or of two named points. Without a reach the surfaces
/// coincide; with one their distance along the normal is added to the gap. The sliding velocity of a pair is s = B_t v
/// - v_d (src/README.md, section 1.2).
struct Contact
{
  std::string rotor;                // surface or point that the drive moves
  std::string stator;               // surface or point that slides on it
  double gap = 0;                   // [m] initial gap, positive if open
  std::optional<Vec3> normal;       // [-] unit, out of the rotor; required for points, else the slave surface's
  std::vector<Vec3> tangents;       // [-] one: plane friction along it; two; empty: two chosen from the normal
  std::optional<Rotation> rotation; // of the rotor: v_d is the tangential part of rate axis x (x - centre)
  Vec3 velocity{};                  // [m/s] of the rotor's surface if there is no rotation
  double reach = 0;                 // [m] largest distance of the surfaces along the normal
  SlaveSide slave{};                // has one pair a node
  double compliance = 0;            // [m3/N] approach over pressure, in series with the pairs; [m/N] of points
  double slip_compliance = 0;       // [m3/N] elastic slip over shear stress, in series with friction without a drive
  std::optional<FrictionLaw> friction{}; // if absent, the scene's
  std::filesystem::path gap_file{};      // of gaps by the places of slave nodes, that add to `gap`; empty: none
  int driven_by = -1;                    // place in the scene's rotors; -1: none, or not known before the mesh
};

/// Whether nothing drives the rotor of a contact: its pairs stick or slip by what acts on them alone.
inline bool is_undriven(const Contact& contact)
{
  return !contact.rotation && contact.velocity == Vec3{};
}

/// A part that moves past others. Contacts whose rotor is a surface of it, or a point of its name, have its drive.
struct Rotor
{
  std::string part;    // or a point
  Rotation rotation{}; // the axis is zero where there is none
  Vec3 velocity{};     // [m/s] of its surface instead
};

/// Two surfaces of parts meshed apart that move as one; nodes of the slave follow the master.
struct Tie
{
  std::string slave;  // named surface, the finer or softer one
  std::string master; // named surface
  double reach = 0;   // [m] largest distance of the surfaces along the normal
};

/// Rights of the statements in a geometry.
enum class Statements
{
  listed, // geometry and mesh: gmsh is shut in, starts no program and writes nothing
  any,    // whatever gmsh runs: commands of the shell among them
};

/// Where the mesh comes from.
struct MeshSource
{
  std::filesystem::path file;               // mesh or geometry that libgmsh reads; absolute
  std::map<std::string, double> parameters; // values for the DefineConstant of a .geo, in its own units
  double scale = 1;                         // [m] length unit of the file
  std::filesystem::path size_field{};       // gmsh views of the sizes of a geometry's elements, absolute; empty: none
  int refine = 0;                           // [-] number of times that every element is divided
  Statements statements{};                  // not of the scene file, but of the command line
};

} // namespace squeal
