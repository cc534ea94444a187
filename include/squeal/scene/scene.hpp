#pragma once
/// A scene: everything physical that a run needs, as plain data in SI units. This room includes neither PETSc nor MPI.
/// Algorithms are chosen by PETSc options, with one prefix for each stage.
#include "squeal/base/vec3.hpp"
#include "squeal/base/words.hpp"

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace squeal
{

/// A choice among the motions x y z rx ry rz of a node or body.
using Motions = std::array<bool, 6>;

inline constexpr std::array motion_words = {"x", "y", "z", "rx", "ry", "rz"};

/// Nine constants of orthotropic elasticity along the axes 1, 2 and 3 = 1 x 2. A stress along i alone strains i by
/// stress/E_i and j by -nu_ij stress/E_i; nu_ij/E_i = nu_ji/E_j.
struct Orthotropy
{
  Vec3 young{};            // [Pa] E1 E2 E3
  Vec3 poisson{};          // [-] nu12 nu13 nu23: contraction along the second axis under tension along the first
  Vec3 shear{};            // [Pa] G12 G13 G23
  Vec3 axis_1 = {1, 0, 0}; // [-] unit
  Vec3 axis_2 = {0, 1, 0}; // [-] unit, square to axis_1
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

/// A named volume of the mesh, or a named surface if it has a thickness (shell).
struct Part
{
  std::string name;
  Material material;
  double thickness = 0;                   // [m] of a shell; 0 for a solid
  std::optional<RayleighDamping> damping; // if absent, the scene's
  double loss_factor = 0;                 // [-] eta of the stiffness K (1 + i eta)
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
};

/// A spring and a dashpot in parallel, between two points or rigid bodies, or from one of them to "ground".
struct Spring
{
  std::string from;          // point or rigid body
  std::string to = "ground"; // point, rigid body or "ground"
  Vec3 direction{};          // [-] unit vector of the line of action
  double stiffness = 0;      // [N/m]
  double damping = 0;        // [N s/m]
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
  std::string on; // named group or point; rows of a matrix scene (squeal/scene/row_names.hpp), also below
  Motions fixed{};
};

struct Force
{
  std::string on; // point, rigid body, or node group whose nodes share the force equally
  Vec3 vector{};  // [N] total force
};

struct Pressure
{
  std::string on;   // named surface
  double value = 0; // [Pa] positive towards the solid
};

struct Rotation
{
  Vec3 axis{};     // [-] unit vector
  Vec3 centre{};   // [m] a point of the axis
  double rate = 0; // [rad/s]
};

/// The side of a contact whose nodes have the pairs.
enum class SlaveSide
{
  stator,
  rotor,
};

inline constexpr std::array slave_side_words = {"stator", "rotor"};

inline Words words_of(SlaveSide)
{
  return slave_side_words;
}

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
};

/// Two surfaces of parts meshed apart that move as one; nodes of the slave follow the master.
struct Tie
{
  std::string slave;  // named surface, the finer or softer one
  std::string master; // named surface
  double reach = 0;   // [m] largest distance of the surfaces along the normal
};

/// Coulomb's law with mu(s) = coefficient + (static_coefficient - coefficient) exp(-s/decay_speed) at the sliding speed
/// s.
struct FrictionLaw
{
  double coefficient = 0;        // [-]
  bool direction_damping = true; // keep mu r_n/|v_d| (I - e e') in the modes (src/README.md, section 3)
  double static_coefficient = 0; // [-] mu at rest; of no meaning without a decay_speed
  double decay_speed = 0;        // [m/s] 0: mu is `coefficient` at every speed
};

/// The statements that a geometry may hold.
enum class Statements
{
  listed, // geometry, sizes, physical groups, constants, loops
  any,    // whatever gmsh runs: commands of the shell among them
};

struct MeshSource
{
  std::filesystem::path file;               // mesh or geometry that libgmsh reads; absolute
  std::map<std::string, double> parameters; // values for the DefineConstant of a .geo, in its own units
  double scale = 1;                         // [m] length unit of the file
  Statements statements{};                  // not of the scene file, but of the command line
};

/// Route by which the complex modes are computed.
enum class ModesMethod
{
  projection, // projection on real modes
  full,       // full sparse quadratic problem
  both,       // the full problem, and the projection beside it
};

inline constexpr std::array modes_method_words = {"projection", "full", "both"};

inline Words words_of(ModesMethod)
{
  return modes_method_words;
}

/// The model on which the limit cycle is computed.
enum class CycleModel
{
  full,
  reduced,
  automatic, // reduced as far as the required accuracy allows
};

inline constexpr std::array cycle_model_words = {"full", "reduced", "auto"};

inline Words words_of(CycleModel)
{
  return cycle_model_words;
}

/// Origin of the initial state of a motion.
enum class StartKind
{
  mode,     // the unstable mode at a given amplitude
  estimate, // the unstable modes at their estimated amplitudes
  file,     // a state file
};

inline constexpr std::array start_kind_words = {"mode", "estimate", "file"};

inline Words words_of(StartKind)
{
  return start_kind_words;
}

struct Start
{
  StartKind kind = StartKind::estimate;
  std::filesystem::path file; // of StartKind::file; absolute
};

/// Where the search for the cycle starts.
enum class CycleStartKind
{
  estimate,  // the unstable modes at their estimated amplitudes
  mode,      // the unstable mode at a given amplitude
  transient, // the end of the run's own transient
  file,      // a state file
};

inline constexpr std::array cycle_start_kind_words = {"estimate", "mode", "transient", "file"};

inline Words words_of(CycleStartKind)
{
  return cycle_start_kind_words;
}

struct CycleStart
{
  CycleStartKind kind = CycleStartKind::estimate;
  std::filesystem::path file; // of CycleStartKind::file; absolute
};

/// Settings of a stage. A stage runs if it is enabled, or if a later enabled stage needs it.
struct ModesSettings
{
  bool enabled = true;
  ModesMethod method = ModesMethod::both;
  int real_modes = 0;      // [-] number of real modes of the projection; 0: those below the band
  int residual_passes = 3; // [-] number of corrections of the projection
  double band = 20000;     // [Hz] modes below this frequency are reported
};

struct EstimateSettings
{
  bool enabled = true;
};

struct TransientSettings
{
  bool enabled = false;
  Start start;
  double amplitude = 0;             // [m] largest displacement of the mode at StartKind::mode; 0: a tenth of lift-off
  double periods = 20;              // [-] length, in periods of the followed mode
  double steps_per_period = 100;    // [-]
  long steps = 0;                   // [-] number of steps; if > 0, with step_size instead of the two above
  double step_size = 0;             // [s]
  double theta = 0.5;               // [-] of the theta method
  std::filesystem::path save_state; // state file written at the end; none if empty
};

struct CycleSettings
{
  bool enabled = false;
  CycleStart start;
  double amplitude = 0;             // [m] largest displacement of the mode at CycleStartKind::mode; 0: twice lift-off
  int steps_per_period = 0;         // [-] 0: chosen
  double tolerance = 0;             // [-] on the residual of the full state; 0: chosen
  int free_periods = 10;            // [-] number of periods integrated before the first Newton step
  int starts = 0;                   // [-] number of starts whose motions are listed; 0: none
  double theta = 0.5;               // [-] of the theta method
  std::filesystem::path save_state; // state file of the start of the cycle; none if empty
};

/// The branch of the limit cycle along a number of the scene.
struct BranchSettings
{
  std::string key;         // of the number, as overrides name it
  double from = 0, to = 0; // in the key's unit
  int points = 30;         // [-] number of points if the number alone changed along the branch
  double own = 0;          // the scene's own value of the number, which the branch starts from; no key of its own
};

/// The directions of rotation that a sweep examines.
enum class SweepDirections
{
  one,  // that of the scene
  both, // that of the scene, then the other
};

inline constexpr std::array sweep_directions_words = {"one", "both"};

inline Words words_of(SweepDirections)
{
  return sweep_directions_words;
}

/// How far the chain of stages goes at each point of a sweep.
enum class SweepStages
{
  equilibrium,
  modes,
};

inline constexpr std::array sweep_stages_words = {"equilibrium", "modes"};

inline Words words_of(SweepStages)
{
  return sweep_stages_words;
}

/// Stability at many values of one number of the scene, or of two.
struct SweepSettings
{
  std::vector<std::string> key; // of the numbers, as overrides name them
  std::vector<double> from, to; // in the keys' units, one a key
  std::vector<int> points{11};  // [-] of the grid, one a key
  std::vector<double> values;   // of a single key, instead of a grid
  int samples = 0;              // [-] number of random points of the ranges, instead of a grid; 0: none
  int seed = 1;                 // [-] of the random points
  SweepDirections directions{}; // of rotation
  SweepStages stages = SweepStages::modes;
};

/// Why modes are unstable: derivatives of their eigenvalues, and where their energy comes from and goes to.
struct SensitivitySettings
{
  std::vector<std::string> numbers; // derivatives with respect to these, as overrides name them; empty: to all
};

/// A change that is proposed at a probe, along its direction. It is relaxed at the sliding equilibrium.
struct Change
{
  std::string probe;
  double mass = 0;      // [kg]
  double damping = 0;   // [N s/m] to the ground
  double stiffness = 0; // [N/m] to the ground
};

/// How likely modes are unstable where numbers of the scene are random.
struct RobustnessSettings
{
  int samples = 1000;       // [-] number of random scenes
  int checks = 20;          // [-] number of them that are computed by the full problem as well
  int seed = 1;             // [-] of the random numbers
  double confidence = 0.95; // [-] of the intervals of the probabilities
};

enum class Distribution
{
  normal,    // cut off at four deviations
  lognormal, // likewise, of the logarithm
  uniform,
};

inline constexpr std::array distribution_words = {"normal", "lognormal", "uniform"};

inline Words words_of(Distribution)
{
  return distribution_words;
}

/// A random number of the scene, independent of the others.
struct UncertainNumber
{
  std::string key; // as overrides name it
  Distribution distribution = Distribution::normal;
  double mean = 0;         // of the number itself, in its unit; 0: the scene's value
  double deviation = 0;    // standard deviation of the number itself
  double from = 0, to = 0; // of the uniform distribution
};

/// The value below which a part of the distribution lies, 0 <= part <= 1.
double quantile(const UncertainNumber& number, double part);

/// A displacement that is recorded in time: of the node of a point, body or group, along a direction.
struct Probe
{
  std::string name;
  std::string on;         // point, rigid body or group; a row or node of a matrix scene
  std::optional<Vec3> at; // [m] the group's node nearest to this position is meant
  Vec3 direction{};       // [-] unit vector
};

struct Scene
{
  std::string title;
  CycleModel fidelity = CycleModel::automatic;
  double accuracy = 1e-3;                        // [-] required relative accuracy of the cycle's frequency and energy
  std::filesystem::path file;                    // scene file; absolute
  std::optional<MeshSource> mesh;                // either a mesh
  std::optional<std::filesystem::path> matrices; // or a folder of matrices, absolute; or points alone
  std::vector<Part> parts;
  std::vector<Point> points;
  std::vector<RigidBody> rigid_bodies;
  std::vector<Spring> springs;
  std::vector<Superelement> superelements;
  std::vector<Support> supports;
  std::vector<Force> forces;
  std::vector<Pressure> pressures;
  std::vector<Contact> contacts;
  std::vector<Tie> ties;
  FrictionLaw friction;
  RayleighDamping damping; // of parts without their own
  ModesSettings modes;
  EstimateSettings estimate;
  TransientSettings transient;
  CycleSettings cycle;
  std::optional<BranchSettings> branch;
  std::optional<SweepSettings> sweep;
  std::optional<SensitivitySettings> sensitivity;
  std::vector<Change> changes;
  std::vector<Probe> probes;
  std::optional<RobustnessSettings> robustness;
  std::vector<UncertainNumber> uncertain;
};

/// Returns the scene in a TOML file after the overrides "table.key=value", whose values are TOML or bare words.
/// "part.NAME.key" reaches the entry with that name in a list, "contact.0.key" the entry with that index. Paths become
/// absolute; they are relative to the scene file.
/// Throws Error for every wrong key, type, sign and range, with file, line, key, value, remedy and the nearest known
/// key.
Scene read_scene(const std::filesystem::path& file, const std::vector<std::string>& overrides);

/// Returns the scene as TOML with all defaults; read_scene of it gives the same scene.
std::string resolved_scene(const Scene& scene);

/// A number of a scene, as overrides name it, and a value of it.
struct SceneNumber
{
  std::string key;
  double value = 0;
};

/// Returns the scene with other values of numbers that it has. Throws Error if that is no scene.
Scene scene_with(const Scene& scene, std::span<const SceneNumber> numbers);

/// The numbers with respect to which eigenvalues are derived, with the scene's values. They are those that it names,
/// else friction and what is not zero of parts, points, bodies, springs, damping and rates of rotation.
std::vector<SceneNumber> sensitive_numbers(const Scene& scene);

/// Returns a list of all keys of a scene file with their meanings, units and defaults.
std::string scene_reference();

} // namespace squeal
