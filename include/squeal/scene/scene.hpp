#pragma once
/// A scene: everything physical that a run needs, as plain data in SI units. No PETSc, no MPI.
/// Algorithms are not here: they are PETSc options, one prefix per stage.
#include "squeal/base/words.hpp"

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace squeal
{

using Vec3 = std::array<double, 3>;
/// x y z rx ry rz: which motions of a node or body are meant.
using Motions = std::array<bool, 6>;

struct Material
{
  double young = 0;   // [Pa]
  double poisson = 0; // [-]
  double density = 0; // [kg/m3]
};

/// C = alpha M + beta K
struct RayleighDamping
{
  double alpha = 0; // [1/s]
  double beta = 0;  // [s]
};

/// A named volume of the mesh, or a named surface when it has a thickness (a shell).
struct Part
{
  std::string name;
  Material material;
  double thickness = 0;                   // [m]; 0: a solid
  std::optional<RayleighDamping> damping; // the scene's own when absent
};

/// A node of its own: a point mass, or where springs meet.
struct Point
{
  std::string name;
  Vec3 at{};       // [m]
  double mass = 0; // [kg]
  Motions free{};
};

/// A named surface (or several) that moves as one rigid body: u(x) = u_ref + theta x (x - at). An exact constraint.
struct RigidBody
{
  std::string name;
  std::vector<std::string> surfaces;
  Vec3 at{};                       // [m] reference point
  double mass = 0;                 // [kg], at the reference point
  std::array<double, 6> inertia{}; // [kg m2] xx yy zz xy yz zx about the reference point
  Motions free{};
};

/// Spring and dashpot in parallel along one direction, between two points or rigid bodies, or from one to "ground".
struct Spring
{
  std::string from, to = "ground";
  Vec3 direction{};     // unit
  double stiffness = 0; // [N/m]
  double damping = 0;   // [N s/m]
};

/// Nodes of a named group held still in the given motions.
struct Support
{
  std::string on;
  Motions fixed{};
};

struct Force
{
  std::string on; // point or rigid body, or a named node group (the whole force shared equally by its nodes)
  Vec3 vector{};  // [N]
};

struct Pressure
{
  std::string on;   // named surface
  double value = 0; // [Pa], positive presses onto the solid
};

struct Rotation
{
  Vec3 axis{};     // unit
  Vec3 centre{};   // [m]
  double rate = 0; // [rad/s]
};

/// Pairs of coincident nodes of two named surfaces of matching meshes, or one pair of two named points. With a reach,
/// partners may stand apart along the normal, as on a curved face: their distance adds to the gap.
/// Normal: out of the rotor into the stator. Sliding velocity: s = B_t v - v_d.
struct Contact
{
  std::string rotor, stator;
  double gap = 0;                   // [m] initial, positive open
  std::optional<Vec3> normal;       // unit; needed for points and a reach, else from the rotor's surface
  std::vector<Vec3> tangents;       // one: plane friction along it; two; empty: two, chosen from the normal
  std::optional<Rotation> rotation; // of the rotor: v_d = rate axis x (x - centre), its tangential part
  Vec3 velocity{};                  // [m/s] of the rotor's surface when there is no rotation
  double reach = 0;                 // [m] how far apart along the normal partners may stand
};

struct FrictionLaw
{
  double coefficient = 0;        // [-]
  bool direction_damping = true; // keep mu r_n/|v_d| (I - e e') in the modes (src/README.md, section 3)
};

struct MeshSource
{
  std::filesystem::path file;               // .geo .msh .unv … ; absolute once read
  std::map<std::string, double> parameters; // DefineConstant overrides of a .geo
  double scale = 1;                         // [m] per length unit of the file
};

/// By which route the complex modes are found.
enum class ModesMethod
{
  projection, // on real modes (the paper's)
  full,       // the full sparse quadratic problem
  both,       // the full problem, and the projection beside it
};

inline constexpr std::array modes_method_words = {"projection", "full", "both"};

inline Words words_of(ModesMethod)
{
  return modes_method_words;
}

/// The model that the limit cycle is computed on.
enum class CycleModel
{
  full,
  reduced,
  automatic, // reduced as far as the accuracy asked for allows
};

inline constexpr std::array cycle_model_words = {"full", "reduced", "auto"};

inline Words words_of(CycleModel)
{
  return cycle_model_words;
}

/// What a motion starts from.
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
  std::filesystem::path file; // of kind file; absolute
};

/// What one stage needs to know. A stage runs when enabled, or when a later enabled stage needs it.
struct ModesSettings
{
  bool enabled = true;
  ModesMethod method = ModesMethod::both;
  int real_modes = 0;      // of the projection; 0: those below the band
  int residual_passes = 3; // of the projection
  double band = 20000;     // [Hz] report every mode below
};

struct EstimateSettings
{
  bool enabled = true;
};

struct TransientSettings
{
  bool enabled = false;
  Start start;
  double amplitude = 0; // largest displacement of the mode at "mode" [m]; 0: a tenth of first lift-off
  double periods = 20;  // of the followed mode, with steps_per_period; or:
  double steps_per_period = 100;
  long steps = 0;       // with step_size, when > 0 overrides periods
  double step_size = 0; // [s]
  double theta = 0.5;
  std::filesystem::path save_state; // written at the end when not empty
};

struct CycleSettings
{
  bool enabled = false;
  int steps_per_period = 100;
  double tolerance = 1e-5; // on the full-space residual
  int free_periods = 10;
  double theta = 0.5;
  std::filesystem::path save_state;
};

/// What is watched in time: a node of a named point, rigid body or group nearest to `at`, and a direction; or "dof:N".
struct Probe
{
  std::string name;
  std::string on; // "dof:N" on a matrix scene
  std::optional<Vec3> at;
  Vec3 direction{}; // unit
};

struct Scene
{
  std::string title;
  CycleModel fidelity = CycleModel::full;
  double accuracy = 1e-3;     // [-] wished, of the cycle's frequency and energy
  std::filesystem::path file; // absolute
  std::optional<MeshSource> mesh;
  std::optional<std::filesystem::path> matrices; // folder; absolute
  std::vector<Part> parts;
  std::vector<Point> points;
  std::vector<RigidBody> rigid_bodies;
  std::vector<Spring> springs;
  std::vector<Support> supports;
  std::vector<Force> forces;
  std::vector<Pressure> pressures;
  std::vector<Contact> contacts;
  FrictionLaw friction;
  RayleighDamping damping;
  ModesSettings modes;
  EstimateSettings estimate;
  TransientSettings transient;
  CycleSettings cycle;
  std::vector<Probe> probes;
};

/// Reads a scene file (TOML) and applies `overrides` ("table.key=value", TOML values; a bare word is a string;
/// "part.NAME.key" and the like reach the entry of that name in a list, "contact.0.key" the entry of that index).
/// Checks every key, type, sign and range: Error names file, line, key, value, remedy, and the nearest known key.
/// Paths become absolute, relative to the scene file.
Scene read_scene(const std::filesystem::path& file, const std::vector<std::string>& overrides);

/// The scene as TOML with every default written out; read_scene of it gives the same scene.
std::string resolved_scene(const Scene& scene);

/// Every key of a scene file with its unit, default and meaning.
std::string scene_reference();

} // namespace squeal
