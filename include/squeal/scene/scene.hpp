#pragma once
/// A scene: everything physical that a run needs, as plain data in SI units. Sources of this header are scene.cpp (from
/// a file), write.cpp (to text), check.cpp (contradictions) and doubts.cpp (possible values that are hardly meant).
/// Algorithms are chosen by PETSc options, with one prefix for each stage.
#include "squeal/scene/model_parts.hpp"

#include <span>

namespace squeal
{

/// How the complex modes are found.
enum class ModesMethod
{
  full, // by slices, corrected by residuals
  toar, // SLEPc's two-level Arnoldi around zero
};

template <> inline constexpr std::array words_of<ModesMethod> = {"full", "toar"};

/// The model on which the limit cycle is computed.
enum class CycleModel
{
  full,
  reduced,
  automatic, // reduced as far as the required accuracy allows
};

template <> inline constexpr std::array words_of<CycleModel> = {"full", "reduced", "auto"};

/// Origin of the initial state of a motion.
enum class StartKind
{
  mode,        // the unstable mode at a given amplitude
  estimate,    // the unstable modes at their estimated amplitudes
  equilibrium, // sliding, without vibration
  rest,        // no displacement and no velocity
  file,        // a state file
};

template <> inline constexpr std::array words_of<StartKind> = {"mode", "estimate", "equilibrium", "rest", "file"};

/// A displacement and velocity that a transient starts with, of all nodes of a group, beside its start.
struct InitialMotion
{
  std::string on;      // point, rigid body or group
  Vec3 displacement{}; // [m]
  Vec3 velocity{};     // [m/s]
};

/// A step of the load path, by what acts at its end. Structures whose contacts all have a drive depend on no path.
struct LoadStep
{
  std::string name;
  double load = 1;                  // [-] on all forces and pressures
  std::vector<double> forces;       // [-] beside it, one a force; empty: 1
  std::vector<double> pressures;    // [-] one a pressure; empty: 1
  double friction = 1;              // [-] on the coefficients of driven contacts
  std::vector<std::string> bolts{}; // that have their tension at its end; the others keep their length
};

/// Where a transient starts.
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

template <> inline constexpr std::array words_of<CycleStartKind> = {"estimate", "mode", "transient", "file"};

/// Where the search for the cycle starts, with its file.
struct CycleStart
{
  CycleStartKind kind = CycleStartKind::estimate;
  std::filesystem::path file; // of CycleStartKind::file; absolute
};

/// How the error that the mesh leaves on modes is estimated.
enum class MeshErrorMethod
{
  off,
  refinement, // by a model with every element divided
};

template <> inline constexpr std::array words_of<MeshErrorMethod> = {"off", "refinement"};

/// Settings of a stage. A stage runs if it is enabled, or if a later enabled stage needs it.
struct ModesSettings
{
  bool enabled = true;
  ModesMethod method = ModesMethod::full;
  double band = 20000; // [Hz] modes below this frequency are reported
  MeshErrorMethod mesh_error = MeshErrorMethod::off;
};

/// Settings of the energy estimate.
struct EstimateSettings
{
  bool enabled = true;
};

/// Factors on what acts on the structure, over the time of a transient.
struct Ramps
{
  FactorTable load;     // on all forces and pressures
  FactorTable speed;    // on all drive velocities
  FactorTable friction; // on the coefficients of friction
};

/// Whether any of them is given.
bool are_given(const Ramps& ramps);

/// Settings of the transient.
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
  Ramps ramps;                      // of load, speed and friction
  std::filesystem::path save_state; // state file written at the end; none if empty
};

/// Settings of the search for the cycle.
struct CycleSettings
{
  bool enabled = false;
  CycleStart start;
  double amplitude = 0;             // [m] largest displacement of the mode at CycleStartKind::mode; 0: twice lift-off
  int steps_per_period = 0;         // [-] 0: chosen
  double tolerance = 0;             // [-] on the residual of the full state; 0: chosen
  int free_periods = 10;            // [-] number of periods integrated before the first Newton step
  int starts = 0;                   // [-] number of starts whose motions are listed; 0: chosen
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

template <> inline constexpr std::array words_of<SweepDirections> = {"one", "both"};

/// How far the chain of stages goes at each point of a sweep.
enum class SweepStages
{
  equilibrium,
  modes,
};

template <> inline constexpr std::array words_of<SweepStages> = {"equilibrium", "modes"};

/// Stability at many values of one number of the scene, or at design points.
struct SweepSettings
{
  std::vector<std::string> key;              // of the number, as overrides name it; of a table all of them
  double from = 0, to = 0;                   // in the key's unit
  int points = 11;                           // [-] of the grid
  std::vector<double> values;                // instead of a grid
  std::filesystem::path table{};             // CSV file of design points instead, a column a key; absolute
  std::vector<std::vector<double>> design{}; // its points; no key of its own
  SweepDirections directions{};              // of rotation
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
  int seed = 1;             // [-] of the random numbers
  double confidence = 0.95; // [-] of the intervals of the probabilities
};

/// The distribution of a random number.
enum class Distribution
{
  normal,    // cut off at four deviations
  lognormal, // likewise, of the logarithm
  uniform,
};

template <> inline constexpr std::array words_of<Distribution> = {"normal", "lognormal", "uniform"};

/// A random number of the scene, independent of the others.
struct UncertainNumber
{
  std::string key; // as overrides name it
  Distribution distribution = Distribution::normal;
  double mean = 0;         // of the number itself, in its unit; 0: the scene's value
  double deviation = 0;    // standard deviation of the number itself
  double from = 0, to = 0; // of the uniform distribution
};

/// The value that a part of the distribution is below, 0 <= part <= 1.
double quantile(const UncertainNumber& number, double part);

/// Frequency responses about steady sliding, of every probe to a unit force at others.
struct ResponseSettings
{
  std::vector<std::string> excitation; // names of the probes that are driven, along their directions; empty: all
  double from = 0, to = 0;             // [Hz]
  int count = 1000;                    // [-] number of frequencies, evenly spread
};

/// The frequencies of a response [Hz].
std::vector<double> frequencies_of(const ResponseSettings& response);

/// A displacement that is recorded in time: of the node of a point, body or group, along a direction.
struct Probe
{
  std::string name;
  std::string on;         // point, rigid body or group; a row or node of a matrix scene
  std::optional<Vec3> at; // [m] the group's node nearest to this position is meant
  Vec3 direction{};       // [-] unit vector
};

/// A place of the scene where a named number stands.
struct NumberUse
{
  std::string key; // of that place, as overrides name it
  std::string name;
  double sign = 1; // -1: the number stands there with a minus
};

/// All tables of a scene file.
struct Scene
{
  std::map<std::string, double> numbers; // by the names that other keys have for values
  std::vector<NumberUse> number_uses;    // no key of its own
  std::string title;
  CycleModel fidelity = CycleModel::automatic;
  double accuracy = 1e-3;                        // [-] required relative accuracy of the cycle's frequency and energy
  std::filesystem::path file;                    // scene file; absolute
  std::optional<MeshSource> mesh;                // either a mesh
  std::optional<std::filesystem::path> matrices; // or a folder of matrices, absolute; or points alone
  std::vector<Part> parts;
  std::vector<Point> points;
  std::vector<RigidBody> rigid_bodies;
  std::vector<Coupling> couplings;
  std::vector<Spring> springs;
  std::vector<Connector> connectors;
  std::vector<Beam> beams;
  std::vector<AddedMass> masses;
  std::vector<Superelement> superelements;
  std::vector<Support> supports;
  std::vector<Force> forces;
  std::vector<Pressure> pressures;
  std::vector<Bolt> bolts;
  Vec3 gravity{}; // [m/s2]
  std::vector<Rotor> rotors;
  std::vector<Contact> contacts;
  std::vector<LoadStep> steps; // to the scene's loads and friction, in order; empty: at once
  std::vector<InitialMotion> initial;
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
  std::optional<ResponseSettings> response;
  std::vector<Probe> probes;
  std::optional<RobustnessSettings> robustness;
  std::vector<UncertainNumber> uncertain;
};

/// Returns the scene in a TOML file after the overrides "table.key=value", whose values are TOML or bare words. The key
/// "part.NAME.key" reaches the entry with that name in a list, "contact.0.key" the entry with that index. Paths become
/// absolute; they are relative to the scene file.
/// Throws Error for every wrong key, type, sign and range, with file, line, key, value, remedy and the nearest known
/// key.
Scene read_scene(const std::filesystem::path& file, const std::vector<std::string>& overrides);

/// Gives every contact the drive of a rotor of the scene, by the rotor's place; -1: it has none. Throws Error for a
/// contact that has a drive of its own too, and for a rotor that drives nothing.
void drive_contacts(Scene& scene, std::span<const int> rotors);

/// A sentence for each material that no solid has and each mass that none has, which a slip of units explains. So for
/// each load that does nothing or turns round, and each setting that nothing uses. Of gaps and compliances beside the
/// model's length [m], and of its mass [kg], unless that is 0.
std::vector<std::string> doubts_about(const Scene& scene, double length, double mass);

/// Returns the scene as TOML with all defaults; read_scene of it gives the same scene.
std::string resolved_scene(const Scene& scene);

/// Returns a list of all keys of a scene file with their meanings, units and defaults.
std::string scene_reference();

/// Returns "key" for the keys before all tables, and "table.key" for those of tables that stand once in a scene.
std::vector<std::string> scene_key_names();

/// Whether part of the load is of bolts, gravity or moved supports, which no load factor scales.
bool has_preload(const Scene& scene);

/// How a matrix scene names degrees of freedom: by the rows of its matrices, or by the nodes of the code they are from.
/// Thus "dof:7" is a row of the matrices, "node:1017" all rows of a node; lists and ranges are "node:3,8,20-40".
struct RowNames
{
  struct Range
  {
    long first = 0, last = 0;
  };
  bool nodes = false; // nodes, not rows
  std::vector<Range> ranges;

  bool is_single() const { return ranges.size() == 1 && ranges[0].first == ranges[0].last; }
};

/// Returns what the text names; nothing if it is of another form.
std::optional<RowNames> row_names(const std::string& text);

} // namespace squeal
