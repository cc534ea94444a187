#pragma once
/// A model no larger than its cycle needs, about the sliding equilibrium (u0, r0) (src/README.md, sections 7.1 to 7.3).
///
/// Pairs that stay closed and sliding are eliminated as in the modes (paper, eq. 5): du = Z y, equations tested by Y.
/// The others, the active ones, keep unilateral contact and Coulomb friction. Then y = V q, V dense:
///     M q'' + C q' + K q = H r + f,   f = -H r0,   M = (Y V)'M (Z V) ...,  H = (Y V)'B_a',
///     g = g0 + G_n q >= 0,   s = G_t q' - v_d,   G = B_a Z V,
/// all three matrices unsymmetric. V holds the complex modes of the band, whose growth rates the reduced model has
/// exactly, and real modes above it. Of the active pairs' attachments (section 7.2) it holds the part that is new.
///
/// An active pair that slides along the drive e throughout has one row and one shape instead of three. They are of B_n'
/// + mu B_t'e, the normal force with its friction.
///
/// Caveats: friction of such pairs turns with the sliding direction to first order only, by C_f of the reaction at
/// equilibrium. An eliminated pair is taken never to part or stick. What all that is worth is measured: one period of
/// the full model from the reduced cycle.
///
/// Everything reduced is dense, small, and the same on every rank.
#include "squeal/algebra/multivector.hpp"
#include "squeal/contact/pair_law.hpp"
#include "squeal/modes/modes.hpp"

#include <Eigen/Dense>
#include <limits>
#include <span>

namespace squeal
{

/// Matrices on the shapes V, the active pairs and their law. [size]: number of shapes; [rows]: of the active pairs.
struct ReducedModel
{
  Eigen::MatrixXd M, C, K;                        // size x size [of kg, N s/m, N/m]
  Eigen::MatrixXd H, G;                           // size x rows, rows x size; rows by pairs as PairRows counts them
  Eigen::VectorXd force;                          // [N on the shapes] of the load at u0: -H r0 at an equilibrium
  Eigen::MatrixXd M_z, C_z, K_z;                  // symmetric: V'Z'M Z V ..., of the energies
  Eigen::LLT<Eigen::MatrixXd> E_factor, M_factor; // of K_z + omega^2 M_z, M_z
  std::vector<int> active;                        // pairs, ascending
  std::vector<char> sliding;                      // by pairs: closed throughout, eliminated; the others stay open
  int directions = 2;                             // tangential ones of an active pair; 0: friction follows
  PairFriction friction;                          // of the active pairs
  std::vector<double> gap;                        // [m] at equilibrium, per active pair
  std::vector<double> compliance;                 // [m/N] per active pair; 0: rigid
  std::vector<double> drive;                      // [m/s] as TangentView reads it
  std::vector<double> reactions;                  // [N] r0, a contact vector
  MultiVector shapes;                             // Z V, dofs x size: u = u0 + shapes q
  double omega = 0;                               // [rad/s] of the followed mode
  int modes = 0, attachments = 0;                 // columns that V came from
  int left_out = 0;                               // attachments that it has no room for
  double lost_compliance = 0;                     // [-] mean part of the active pairs' own compliance that is theirs
  Eigen::VectorXd of_left_out; // [m/N] per active pair: of its own compliance, what they have; empty: nothing
  Eigen::Index slow = 0;       // those that swing by less than four times omega, the first ones

  int size() const { return static_cast<int>(M.rows()); }
};

/// The highest of the modes' frequencies [Hz]; 0 without modes.
double highest_frequency(const std::vector<ComplexMode>& modes);

/// Pairs whose normal reaction in u0 + amplitude Re(phi e^{iwt}) falls below zero, or whose gap does. Ascending.
/// Collective.
std::vector<int> pairs_that_may_change(const Interface& interface, const Equilibrium& equilibrium,
                                       const ComplexMode& mode, double amplitude);

/// Undriven pairs that are closed, and whose friction may reach its limit in that motion. Ascending. Collective.
std::vector<int> pairs_that_may_slip(const SlidingEquilibrium& sliding, const LinearisedSliding& linearised,
                                     const ComplexMode& mode, double amplitude);

/// Driven pairs that may come to rest or turn round in that motion's velocity. Ascending. Collective.
std::vector<int> pairs_that_may_turn(const Interface& interface, const ComplexMode& mode, double amplitude);

inline constexpr PetscInt all_attachments = std::numeric_limits<PetscInt>::max();

/// The attachments that a model of recorded contact takes at most. It gives a preconditioner, and the vectors that a
/// cycle's multipliers begin with. Few do: more hardly lower the columns that lead to a verdict.
inline constexpr PetscInt attachments_on_recorded_contact = 300;

/// How a model is reduced.
struct Reduction
{
  PetscInt modes = 0;      // complex modes taken, nearest in frequency to the followed one, which is the first of all
  double threshold = 1e-5; // an attachment shape is dropped when less than this part of it is new
  PetscInt attachments = all_attachments; // the leading ones taken at most, as far as the free memory has room
  bool sliding = false;                   // the active pairs slide along the drive throughout
  const RealModes* real = nullptr;        // frictionless ones; those above the complex modes are taken, too. Null: none
  FactorOptions factor{};
};

/// The model whose other closed pairs slide throughout. Collective. Error: as of eliminate_closed_pairs; K + omega^2 M
/// is not positive definite with the active pairs open; a shape without mass or stiffness.
ReducedModel reduce(const SlidingEquilibrium& sliding, const std::vector<ComplexMode>& modes, std::vector<int> active,
                    const Reduction& reduction);

/// Memory of all ranks for a model's shapes [byte], which are held once, at its making, too.
inline double memory_of_reduction(double dofs, double shapes)
{
  return sizeof(double) * dofs * shapes;
}

/// The memory that a model's shapes may take [byte]: its matrices and the steps of the full model need the rest.
inline double memory_for_shapes(double free)
{
  return free / 2;
}

/// The roles of pairs in the motion that a model is made for. Pairs that are neither active nor sliding stay open.
struct PairRoles
{
  std::vector<int> active;       // ascending
  std::vector<char> sliding;     // by pairs: closed and sliding throughout, eliminated
  std::vector<double> reactions; // [N] a contact vector: means over the motion, which turn the friction of C_f
};

/// The reduced model with the roles of all pairs given.
ReducedModel reduce(const SlidingEquilibrium& sliding, const std::vector<ComplexMode>& modes, const PairRoles& roles,
                    const Reduction& reduction);

/// Position and velocity about the equilibrium.
struct ReducedState
{
  Eigen::VectorXd q, v;
};

/// Coordinates of du and v: of the nearest shape in the energy of K + omega^2 M, and in that of M. Collective.
ReducedState coordinates(const ReducedModel& model, const Structure& structure, Vec du, Vec v);

/// du += shapes q, v += shapes v. Each rank adds to its own entries.
void add_motion(const ReducedModel& model, const ReducedState& state, Vec du, Vec v);

} // namespace squeal
