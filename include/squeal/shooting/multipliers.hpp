#pragma once
/// Options of the shooting solver, prefix -cycle_.
#include "squeal/base/petsc.hpp"
#include "squeal/base/words.hpp"
#include "squeal/shooting/orbit.hpp"

#include <array>
#include <complex>
#include <string>

namespace squeal
{

/// The solver of the full-space equations that ends a shooting.
enum class Finish
{
  multisecant,
  none, // the orbit of the subspace is the result
};

template <> inline constexpr std::array words_of<Finish> = {"multisecant", "none"};

/// How Floquet multipliers are found (src/README.md, section 6.9).
enum class MultiplierMethod
{
  automatic, // by the columns that each takes
  whole,     // from the whole monodromy matrix
  oblique,   // by projection on approximate right and left vectors
};

template <> inline constexpr std::array words_of<MultiplierMethod> = {"auto", "whole", "oblique"};

/// Options -cycle_... of the solver.
struct ShootingOptions
{
  Finish finish = Finish::multisecant;
  PetscInt subspace_newtons = 0; // iterations on the subspace; 0: it is not tried
  double rank_tolerance = 1e-7;  // of the subspace's base
  PetscInt secants = 60;         // kept
  double secant_drop = 1e-4;     // a secant is dropped when less than this part of it is new
  double clamp = 0.3;            // longest multisecant step over the fluctuation
  PetscInt stall = 12;           // iterations without progress before the multisecant stage gives up
  PetscInt max_periods = 400;    // integrated in all
  PetscInt free_periods = 320;   // integrated freely in all, where shooting finds no cycle that attracts
  PetscInt multipliers = -1;     // columns sought; 0: none; below 0: as many as find_multipliers says
  PetscInt watched_periods = -1; // integrated beside the orbit found, to see its stability in time; below 0: chosen
  MultiplierMethod multiplier_method = MultiplierMethod::automatic;
};

// Floquet multipliers: eigenvalues of the monodromy matrix dPhi_T/dx at a periodic orbit (src/README.md, section 6.9).
//
// The matrix is formed whole where that takes no more columns than a projection. Else it is projected obliquely on
// approximate right and left vectors that the flow knows. Both use the flow's exact tangent. The shift in time, whose
// multiplier is 1, is the value near 1 whose vector is closest to d.
//
// Each multiplier has an error bar of its own. The shift's own multiplier misses 1 by a distance. In a whole matrix no
// bar of a real positive one is smaller; a projection's bars do not hold that.
//
// Caveat: a projection may lack a motion that grows. What is done about that makes it unlikely.

/// Whether small motions beside a periodic orbit decay.
enum class Stability
{
  not_examined,
  stable,
  unstable,
  undecided, // a bar reaches across 1, the result is not complete, or a motion beside the orbit does not grow
};

template <> inline constexpr std::array words_of<Stability> = {"", "stable", "unstable", "undecided"};

/// How the largest multiplier of an unstable orbit crossed the circle |m| = 1.
enum class Crossing
{
  none,
  fold,            // at 1
  period_doubling, // at -1
  neimark_sacker,  // as a complex pair
};

template <> inline constexpr std::array words_of<Crossing> = {"", "fold", "period doubling", "Neimark-Sacker"};

/// The growth seen in time of a motion that began beside an orbit, along its fastest growing direction.
struct SeenGrowth
{
  long periods = 0; // integrated until the distance became large or vanished; 0: too few for a line
  double growth = std::numeric_limits<double>::quiet_NaN(), error = growth; // of the distance, a period
  double part = 0; // of the orbit's fluctuation, where the motion began
};

/// The multipliers of an orbit, their bars, and what they say of its stability.
struct Multipliers
{
  std::vector<std::complex<double>> values; // without that of a shift in time, largest first; empty: not examined
  std::vector<double> errors;               // error bar of each
  std::vector<double> upper;                // bounds of the moduli, where a grid of time only lowers some; or empty
  Stability stability = Stability::not_examined;
  bool complete = true;                                  // larger ones than these are unlikely
  Crossing crossing = Crossing::none;                    // of an unstable orbit
  std::string would_decide;                              // of an undecided one, in a sentence
  double trivial_error = 0;                              // distance of the shift's own multiplier from 1
  long periods = 0;                                      // columns of the tangent over one period each
  MultiplierMethod method = MultiplierMethod::automatic; // that was used
  std::string refusal;                                   // why the oblique projection did not serve, or did not decide
  int offsets = 0;                                       // held, each with a multiplier 1 that is left out
  std::vector<SeenGrowth> seen{};                        // from smaller and smaller parts; the last is the smallest

  /// The upper bound of a value's modulus.
  double upper_bound(std::size_t i) const { return upper.empty() ? std::abs(values[i]) + errors[i] : upper[i]; }
};

/// The place of the value whose upper bound is largest: it decides. 0 where none was examined.
std::size_t deciding_place(const Multipliers& multipliers);

/// The largest upper bound of all moduli; NaN where none was examined. An orbit is stable where it is below 1, though
/// the bar of a value that the grid of time lowers may reach across.
double largest_upper_bound(const Multipliers& multipliers);

/// Whether the bar of the deciding one holds 1.
bool largest_reaches_across(const Multipliers& multipliers);

/// The motion of the largest multiplier: Re(z (real + i imaginary)), z multiplied by it in every period. No other phase
/// makes the real part longer. Its energy norm is 1.
struct FastestMotion
{
  Owned<Vec> real, imaginary; // null: none was examined; the imaginary part alone: the multiplier is real
};

/// The multipliers and the motion of the one that decides.
struct FloquetAnalysis
{
  Multipliers multipliers;
  FastestMotion fastest;
};

/// All multipliers of a system whose whole matrix has at most 200 columns. Of a larger one those of the slow motions;
/// where these leave the verdict open and the whole matrix is affordable, all again. ShootingOptions may force a
/// method. Collective. Error: as of the flow.
FloquetAnalysis find_multipliers(const OrbitProblem& problem, const ShootingOptions& options, const Orbit& orbit);

} // namespace squeal
