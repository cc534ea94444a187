#pragma once
/// Floquet multipliers (src/README.md, section 6.9): eigenvalues of the monodromy matrix dPhi_T/dx at a periodic orbit,
/// by Arnoldi in the energy product on difference quotients of the flow.
///
/// With as many steps as the state has entries it is the whole matrix. With fewer it starts from the motions that may
/// grow: a change of amplitude and the other unstable modes, which the orbit may leave unexcited. The flow's own
/// direction d is then taken out along itself, so that the shift in time, whose multiplier is 1, is not found.
///
/// Caveat: how far from 1 the shift in time itself comes out is the error bar of the verdict.
#include "squeal/shooting/options.hpp"
#include "squeal/shooting/orbit.hpp"

#include <complex>

namespace squeal
{

/// Whether small motions beside a periodic orbit decay.
enum class Stability
{
  not_examined,
  stable,
  unstable,
  undecided, // the largest multiplier is 1 to within its error
};

inline constexpr std::array stability_words = {"", "stable", "unstable", "undecided"};

inline Words words_of(Stability)
{
  return stability_words;
}

struct Multipliers
{
  std::vector<std::complex<double>> values; // without that of a shift in time, largest first; empty: not examined
  Stability stability = Stability::not_examined;
  double trivial_error = 0; // distance of the shift's own multiplier from 1
  long periods = 0;         // integrated for them
};

struct FloquetAnalysis
{
  Multipliers multipliers;
  Owned<Vec> fastest; // the motion of the largest multiplier, of energy norm 1; null if none was examined
};

/// All multipliers of a system of up to 25 degrees of freedom, else 8 and 2 for each of the `other_unstable` motions,
/// unless -cycle_multipliers says how many.
FloquetAnalysis find_multipliers(const OrbitProblem& problem, const ShootingOptions& options, const Orbit& orbit,
                                 const std::vector<Owned<Vec>>& other_unstable);

} // namespace squeal
