#pragma once
/// The contact interface: pairs, the gap and sliding operators, and the drive (src/README.md, section 1.2).
///     g = gap + B_n u >= 0,   s = B_t v - v_d,   r_n >= 0 pushes the pair apart,   |r_t| <= mu r_n.
///
/// A pair is a block of rows of B, its normal row first, with any number of nodes. Contact vectors (reactions, gaps,
/// velocities) live whole on every rank as std::vector<double>, read and written through PairView. They are small; the
/// structure is not.
#include "squeal/contact/pair_law.hpp"
#include "squeal/solid/structure.hpp"

namespace squeal
{

/// Contact of a structure: its pairs with their operator, gaps, drive and friction.
struct Interface
{
  int pairs = 0;
  int directions = 2;                        // tangential rows a pair: 1 or 2
  Owned<Mat> B;                              // a row for every entry of a contact vector, by columns of u; AIJ
  std::vector<double> gap;                   // [m] per pair
  std::vector<double> drive;                 // [m/s] per pair and direction, as TangentView reads it: v_d
  std::vector<ContactPair> geometry;         // per pair; empty on a matrix scene
  std::vector<std::array<Vec3, 2>> tangents; // [-] t1 and t2 per pair; t2 is zero where there is one direction
  std::vector<double> compliance;            // [m/N] per pair, in series with it; empty: all pairs are rigid
  std::vector<double> slip_compliance;       // [m/N] per pair, in series with its friction; empty: stick is rigid
  PairFriction friction;

  /// The length of a contact vector.
  std::size_t size() const { return PairRows<std::size_t>(directions).rows_of(static_cast<std::size_t>(pairs)); }
};

/// The model of a scene, which every stage works on. That of a scene with other numbers has structure and contact
/// alone.
struct Model
{
  // On rank 0; empty on a matrix scene. Scenes with stages that make models on groups of ranks, [sweep] and
  // [robustness], have the mesh on every rank.
  Mesh mesh;
  DofMap dofs; // rank 0's; elsewhere its size alone
  Structure structure;
  Interface interface;
  std::vector<Coverage> coverage; // one a contact; empty on a matrix scene
  Owned<Mat> probes;              // a row per probe of the scene
};

/// Velocity of the rotor's surface, by its rotation or as given [m/s]; zero on the axis itself, round-off aside.
Vec3 drive_velocity(const Contact& contact, const Vec3& at);

/// Rows n, t1, t2 of every pair: n.w and t.w, with w the weighted sum of its nodes' displacements. Tangents: the
/// scene's, else t1 along the drive. Pairs are whole on every rank, T on rank 0. Collective.
Interface make_interface(const std::vector<ContactPair>& pairs, const Scene& scene, const DofMap& dofs, MPI_Comm comm);

/// B.petsc gap.petsc drive.petsc of a folder; directions = (rows of B) / pairs - 1. No pairs where none is there.
/// Collective. Error: a file that is damaged, or whose sizes disagree with the others or with the structure.
Interface read_interface(const std::filesystem::path& folder, const Structure& structure, const FrictionLaw& friction,
                         MPI_Comm comm);

/// A pair in messages: its number, contact and place. Not collective.
std::string place_of_pair(const Interface& interface, std::size_t pair);

/// A contact that shares B with this one.
Interface sharing(const Interface& interface);

/// Throws Error for a pair that cannot move along its normal. Collective.
void check_interface(const Interface& interface, const std::string& source, MPI_Comm comm);

/// B x, whole on every rank. Collective.
std::vector<double> relative(const Interface& interface, Vec x);

/// B x of several vectors, in one message: latency counts on small models. Collective.
std::vector<std::vector<double>> relative(const Interface& interface, std::span<const Vec> x);

/// y += B^T r. Collective; r the same on every rank.
void add_reactions(const Interface& interface, const std::vector<double>& r, Vec y);

/// c of a pair [m/N]; 0: it is rigid. Not collective.
inline double compliance_of(const Interface& interface, std::size_t pair)
{
  return interface.compliance.empty() ? 0 : interface.compliance[pair];
}

/// Elastic slip of a pair without a drive over its friction [m/N]; 0: it sticks rigidly, or slides. Not collective.
double slip_compliance_of(const Interface& interface, std::size_t pair);

/// Whether any of the pairs has some. Not collective.
bool has_elastic_slip(const Interface& interface);

/// Compliances in series with every row [m/N], normal and of elastic slip; empty: none has any. Not collective.
std::vector<double> compliance_of_rows(const Interface& interface);

/// Where friction holds pairs with elastic slip: B_t u + c_t r_t [m], in the tangential rows of a contact vector.
/// Collective.
std::vector<double> slip_positions(const Interface& interface, Vec u, const std::vector<double>& reactions);

/// |v_d| of a pair [m/s]. Not collective.
double drive_speed(const Interface& interface, std::size_t pair);

/// Whether no drive makes a pair slide, and friction may hold it. Not collective.
bool is_undriven(const Interface& interface, std::size_t pair);

/// Whether any of the pairs is. Not collective.
bool has_undriven_pairs(const Interface& interface);

/// Unit drive direction e = v_d/|v_d| of every pair, as TangentView reads it: reactions of steady sliding are
/// r_t = mu(|v_d|) r_n e.
std::vector<double> drive_directions(const Interface& interface);

/// mu(|v_d|) of every pair.
std::vector<double> drive_friction(const Interface& interface);

/// Which rows of a pair are taken.
enum class RowsTaken
{
  all,
  normal,
};

/// The rows of these pairs (ascending), all of each or the normal ones alone, in the same distribution. Collective.
Owned<Mat> rows_of(const Interface& interface, const std::vector<int>& pairs, RowsTaken taken);

/// B v - v_d: the contact velocity at v, whole on every rank. Collective.
std::vector<double> contact_velocity(const Interface& interface, Vec v);

/// Status of every pair at the end of a step, from its reactions and contact velocities (contact_status of
/// pair_law.hpp).
inline std::vector<ContactStatus> contact_status(const Interface& interface, const std::vector<double>& reactions,
                                                 const std::vector<double>& velocity)
{
  return contact_status(PairView(reactions, interface.directions), PairView(velocity, interface.directions),
                        interface.friction);
}

/// The statuses from the velocities v at the end of the step. Collective.
std::vector<ContactStatus> contact_status(const Interface& interface, const std::vector<double>& reactions, Vec v);

// Which sliding velocity friction opposes in a step of the theta method (src/README.md, section 4.3):
//     w_t = s+ + past,   past = (1-theta)/theta s,   so that w_t = s_theta/theta,
// s the sliding velocity at the step's start and s+ at its end. The past sliding is left out where friction opposes
// s+. These pairs stuck in the step before, so that s is rounding, or are closed and have s+.s < 0 at the solution.
// Those would stop or turn back, which friction does not do by itself, and s_theta = 0 is not rest. Arithmetic on
// contact vectors of one rank.

/// A contact vector with `weight` s on the tangential rows of the pairs that did not stick, and zeros elsewhere.
/// `velocity`: B v of the step's start; `weight`: (1-theta)/theta.
std::vector<double> past_sliding(PairView<const double> velocity, TangentView<const double> drive,
                                 const std::vector<ContactStatus>& status, double weight);

/// Sets `past` to zero on closed pairs of the solution r whose s+ = w_t - past points against it. Returns whether there
/// were any: contact is then to be solved again.
bool leave_out_where_turned(PairView<const double> r, PairView<const double> w, PairView<double> past);

/// The laws of a step before which the reactions were `last`, and `before` a step earlier; no pairs: unknown. Of two
/// levels of mu a pair that stuck has that of rest until the line through both uses of its friction comes to 1.
PairFriction at_release(PairFriction friction, PairView<const double> last, PairView<const double> before);

/// The laws of a solution with this past. Pairs that slide on have no level of rest: the step of slower ones ends with
/// s+ = -s where friction could hold them.
PairFriction sliding_on(const PairFriction& friction, PairView<const double> past);

/// Whether friction of the pair opposes s+.
bool opposes_end(PairView<const double> past, std::size_t pair);

// Resultants of a contact's reactions (src/README.md, section 2.7).

/// Sums over the pairs of one contact.
struct ContactResultant
{
  double normal_force = 0; // [N] sum of r_n
  double closed_share = 0; // [-] of its pairs, those with a normal reaction
  double torque = 0;       // [N m] with which it brakes its rotation: sum of r_t.v_d over the rate; 0 without rotation
};

/// One for each contact of the scene; none on a matrix scene. Not collective: reactions are whole on every rank.
std::vector<ContactResultant> contact_resultants(const Interface& interface, const std::vector<double>& reactions,
                                                 const std::vector<Contact>& contacts);

} // namespace squeal
