#pragma once
/// Complex modes of the structure linearised about steady sliding (src/README.md, section 3.4):
///     (lambda^2 Y'M Z + lambda Y'(C + C_f) Z + Y'K Z) phi = 0,   u(t) ~ phi exp(lambda t),   Re(lambda) > 0:
///     squeal may start.
/// Z keeps closed pairs closed, Y removes their normal reactions; all three matrices are unsymmetric.
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/modes/quadratic.hpp"

#include <complex>
#include <span>

namespace squeal
{

/// Errors are backward errors in the full problem:
///     eta = |Q(lambda) y| / ((|lambda|^2 |M| + |lambda| |C| + |K|) |y|), phi = Z y, Q and 1-norms of the matrices
///     Y'.Z, 2-norms of the vectors.
struct ComplexMode
{
  std::complex<double> lambda;                 // [1/s]
  Owned<Vec> real, imaginary;                  // in the structure's dofs; largest entry of |phi| is 1
  std::vector<std::complex<double>> reactions; // normal reaction per pair [N per m of the mode]; 0 on open pairs
  double backward_error = 0;

  double frequency_hz() const; // |Im(lambda)| / 2 pi
  double growth_rate() const { return lambda.real(); }
  double damping_ratio() const; // -Re/|lambda|
};

/// |Im(lambda)|/2 pi [Hz].
double frequency_hz_of(std::complex<double> lambda);

/// -Re(lambda)/|lambda| [-].
double damping_ratio_of(std::complex<double> lambda);

/// Frictionless undamped modes with closed pairs kept closed, M-normalised, ascending.
/// outcome: "converged", or "not converged": fewer than asked, or fewer than the inertia of K - omega^2 M counts.
struct RealModes
{
  Outcome outcome;                // residual: largest |K x - omega^2 M x| / (|K| |x|)
  std::vector<double> omega;      // [rad/s]
  std::vector<Owned<Vec>> shapes; // in the structure's dofs
};

/// The count that certifies that no mode is missing.
enum class Certificate
{
  none,
  inertia,   // of the frictionless structure
  all_pairs, // the whole problem was solved
};

template <> inline constexpr std::array words_of<Certificate> = {"none", "inertia", "all pairs"};

/// The count that shows whether a mode is missing.
struct ModeCount
{
  Certificate certified_by{};
  double frequency = 0;        // [Hz] the end of the band or near it, where friction moved no pair across
  int expected = 0, found = 0; // pairs below it
};

/// Modes whose shapes the fields file holds.
enum class ModeShapes
{
  unstable,
  all,
};

template <> inline constexpr std::array words_of<ModeShapes> = {"unstable", "all"};

/// outcome: "converged", "not converged" (fewer than expected, or backward errors above 1e-8), "skipped".
/// residual: the largest backward error reported. Where none is unstable, the mode that a given start of the cycle's
/// search has most of is put first.
struct Modes
{
  Outcome outcome;
  ModesMethod method = ModesMethod::full;
  ModeShapes shapes = ModeShapes::unstable;
  double band = 0;                 // [Hz] covered: every mode below is here
  std::vector<ComplexMode> modes;  // Im(lambda) >= 0, by falling growth; of unstable ones those that oscillate first
  std::vector<double> decays;      // [1/s] real negative eigenvalues in the band, where all are found
  std::vector<double> beyond_band; // [Hz] pairs between the band and count.frequency
  int unstable_count = 0;          // of is_unstable, the first ones
  bool beyond_inertia = false;     // gyroscopic, circulatory or indefinite parts: the inertia does not count the pairs
  ModeCount count;
  std::string count_check; // one sentence: pairs found, and expected by inertia

  std::span<const ComplexMode> unstable() const
  {
    return std::span(modes).first(static_cast<std::size_t>(unstable_count));
  }
};

/// Options -modes_...: how the eigenproblems are solved.
struct ModesOptions
{
  PetscInt dense_limit = rows_solved_whole; // up to this size eigenproblems are solved whole by LAPACK
  ModeShapes shapes = ModeShapes::unstable;
  PencilOptions pencil{}; // listed by themselves
};

/// Real part less 1e-8 |lambda|, which is what rounding shows on a mode without damping: positive where a mode counts
/// as unstable, here and everywhere.
double instability_of(std::complex<double> lambda);
bool is_unstable(std::complex<double> lambda);

/// Frictionless undamped modes in the structure's dofs with frequency below `band` [Hz], as many as there are.
/// Collective. Error: memory runs out.
RealModes find_real_modes_below(const LinearisedSliding& linearised, double band, const ModesOptions& options);

/// Those from `low` to `high` [Hz], for a basis: a mode may be missed. Small systems, and low = 0: all below `high`.
/// Collective. Error: memory runs out.
RealModes find_real_modes_between(const LinearisedSliding& linearised, double low, double high,
                                  const ModesOptions& options);

/// Finds all modes below the band of the settings by the method that they name, counts them, and marks unstable ones.
/// Collective. A search that misses modes has the outcome "not converged". Error: a factorisation runs out of memory.
Modes find_modes(const SlidingEquilibrium& sliding, const LinearisedSliding& linearised, const ModesSettings& settings,
                 const ModesOptions& options);

// The modes of a run as a checkpoint: a run that goes on need not find them again, and goes on with the same ones.

/// Leaves the modes as they are. Collective.
void keep_modes(Modes& modes, const Structure& structure);

/// Modes of the run that is gone on with; nothing where there are none. Collective.
std::optional<Modes> kept_modes(const Structure& structure);

// All pairs of a band of the quadratic problem with friction, and their count (src/README.md, sections 3.8 and 3.9).
//
// A slice of |lambda| starts from the undamped problem with friction, K y = theta M y, real and unsymmetric. One
// factor of K - tau M at the slice's middle gives the invariant subspace about it (shift_invert.hpp), which then holds
// all pairs where C = alpha M + beta K. Other damping is corrected by residuals with the same factor (passes.hpp).
// Problems up to ModesOptions::dense_limit are solved whole. Functions are collective. Error: memory runs out.

/// The problem with friction and the symmetric one without. All are borrowed, of one layout.
struct PairProblem
{
  const QuadraticProblem& sliding; // Y'.Z
  Mat K_loss = nullptr;            // of loss factors, Y'.Z; null: none
  Mat M_z = nullptr, K_z = nullptr;
  bool is_indefinite = false; // K_z has negative eigenvalues: pairs are not found by slices
};

/// Pairs, and what counts them.
struct PairSearch
{
  QuadraticSolution solution;   // of the problem with losses
  double top = 0;               // [rad/s] everything below is here
  std::vector<double> decays{}; // real negative lambda [1/s], of problems solved whole and by SLEPc
  std::vector<double> moduli{}; // |lambda| of the pairs without losses [rad/s]
  std::vector<double>
      omega{};      // of the real modes [rad/s], ascending; empty where the inertia agrees or K_z is indefinite
  int expected = 0; // real modes below the top by that inertia
};

/// All pairs below the band [Hz] and, for the count, a little beyond. By SLEPc where `method` says so.
PairSearch search_pairs(const PairProblem& problem, ModesMethod method, double band, const ModesOptions& options);

/// Pairs remain pairs when friction and damping move them. As mu grows from zero, their number in a disc |lambda| <
/// omega changes only where one crosses its edge. So the pairs below an edge are as many as the real modes. The edge is
/// the top or, where they disagree, the highest one between neighbouring pairs from `least` [rad/s] on below which they
/// agree. Real modes below `floor` [rad/s] are motions of a free body. Not collective.
ModeCount count_pairs(const PairSearch& search, double floor, double least);

} // namespace squeal
