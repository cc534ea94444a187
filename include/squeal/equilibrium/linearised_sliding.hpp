#pragma once
/// The closed pairs taken out of the equations without multipliers (src/README.md, sections 3.1 to 3.5).
///
/// While the pairs that are closed at equilibrium stay closed, B_n du = 0 on them. The normal reaction lambda_n of a
/// sliding pair enters as R' lambda_n, R = B_n + mu e.B_t, with e the direction of the drive:
///     du = Z y,  B_n Z = 0,      Y'(equations),  R Y = 0.
/// A closed pair without a drive sticks: B_n du = 0 and B_t du = 0 in both bases (section 3.14).
/// Both bases follow from one sparse Gauss-Jordan elimination of one degree of freedom a pair, its pivot. They are the
/// identity on the degrees of freedom that remain, so y is du there.
#include "squeal/equilibrium/equilibrium.hpp"

#include <complex>

namespace squeal
{

/// Bases that keep the closed pairs closed.
struct ClosedContact
{
  Owned<Mat> Z, Y;            // dofs x (dofs - rows eliminated)
  Owned<Mat> reaction;        // pairs x dofs: lambda_n = reaction f of forces f = R' lambda_n + g, g = 0 on the pivots
  Owned<Mat> normal_reaction; // the same of forces f = B_n' lambda + g
  Owned<Mat> friction;        // tangential rows x dofs: of pairs that stick, likewise; null: no pair is without drive
  std::vector<int> pairs;     // the closed ones, ascending
  int dependent_rows = 0;     // of pairs that stick, which the other rows imply: left out
  std::vector<PetscInt> pivots; // the degrees of freedom that are eliminated, ascending
};

/// `closed`: by pairs; those with a compliance are not eliminated, contact_stiffness stands for them. Error: a closed
/// pair whose normal motion the other closed pairs already fix, or that the friction coefficient jams (which pair).
/// Collective.
ClosedContact eliminate_closed_pairs(const Structure& structure, const Interface& interface,
                                     const std::vector<char>& closed);

/// Y'A Z; of no A none. Collective.
Owned<Mat> project(Mat A, Mat Y, Mat Z);

/// Z'A Z, marked symmetric. Collective.
Owned<Mat> project_symmetric(Mat A, Mat Z);

/// The derivative of steady friction in the sliding velocity over the closed pairs [N s/m],
///     C_f = sum B_t'[mu r_n0/|v_d| (I - e e') + mu' r_n0 e e']B_t.
/// Null where it is zero: pairs with one tangential row cannot turn, and mu' is 0 where mu is constant. `part`: all of
/// it, or the term of mu' alone.
enum class FrictionDamping
{
  whole,
  of_speed,
};

/// D, the damping C_f on the rows of B: C_f = B'D B. Null if it is zero. Collective.
Owned<Mat> damping_of_pairs(const Interface& interface, const std::vector<char>& closed,
                            const std::vector<double>& reactions, FrictionDamping part);

/// C_f from the reactions of the closed pairs. Collective.
Owned<Mat> friction_damping(const Interface& interface, const std::vector<char>& closed,
                            const std::vector<double>& reactions, FrictionDamping part);

/// The stiffness of the closed pairs with a compliance c: sum B_n' B_n/c, or sum R' B_n/c with the friction of the
/// normal reactions. Those that stick with elastic slip add sum B_t' B_t/c_t. Null without such pairs.
enum class PairForces
{
  normal,
  with_friction,
};

Owned<Mat> contact_stiffness(const Interface& interface, const std::vector<char>& closed, PairForces part);

/// A + B of any symmetry.
Owned<Mat> sum_of(Mat A, Mat B);

/// C with G, and with C_f where the interface has it on. Collective.
Owned<Mat> sliding_damping(const SlidingEquilibrium& sliding);

/// The equations of small motions about sliding, made once for the modes, the estimate and the preconditioner.
struct LinearisedSliding
{
  ClosedContact contact;
  Owned<Mat> C;        // sliding_damping
  Owned<Mat> K;        // with H and with pairs that have a compliance; null: the structure's
  Owned<Mat> M_z, K_z; // Z'M Z, Z'K Z, symmetric: the frictionless bilateral problem
};

/// Linearises about the equilibrium. Collective. Error: as of eliminate_closed_pairs.
LinearisedSliding linearise(const SlidingEquilibrium& sliding);

/// The reactions that are asked for: of normal rows, or of tangential ones, by pairs and directions.
enum class ReactionRows
{
  normal,
  tangential, // where there are undriven pairs
};

/// Reactions [N per m] of a motion phi e^{s t}, whole on every rank. Rigid pairs have the lambda of (s^2 M + s C + K)
/// phi = R' lambda by the pivots' rows, rows with a compliance c have -B phi/c, open pairs 0. Every choice of rows
/// agrees if s and phi are an eigenpair. `real`, `imaginary`: of phi. Collective.
std::vector<std::complex<double>> reactions_of(const SlidingEquilibrium& sliding, const LinearisedSliding& linearised,
                                               ReactionRows rows, std::complex<double> s, Vec real, Vec imaginary);

// Pairs with a compliance in the linearised sliding problem (src/README.md, section 3.13).

/// S of the closed pairs with a compliance c, on the rows of B: contact_stiffness is B'S B. It has 1/c and, from normal
/// to tangential rows, mu e/c; of elastic slip 1/c_t in tangential rows. Null without such pairs. Collective.
Owned<Mat> stiffness_of_pairs(const Interface& interface, const std::vector<char>& closed, PairForces part);

} // namespace squeal
