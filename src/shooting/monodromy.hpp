#pragma once
/// The monodromy matrix dPhi_T/dx at an orbit, applied to states, and what is said of its eigenvalues.
#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/shooting/multipliers.hpp"

namespace squeal
{

/// dPhi_T/dx along the period that the flow recorded last.
struct Monodromy
{
  const Flow& flow;
  const Orbit& orbit;
  std::function<void(std::size_t columns)> after_product{}; // called after each product; may be empty
};

/// x_k = dPhi_T/dx x_k
void multiply(const Monodromy& monodromy, std::span<const Owned<Vec>> states);

/// `state`: of the coordinates that the pair's vector has.
FastestMotion fastest_motion(const Flow& flow, const DenseEigenpair& pair,
                             const std::function<Owned<Vec>(const Eigen::VectorXd&)>& state);

/// The place of the shift in time among the pairs: near 1, with the vector that is closest to the flow.
std::size_t find_shift(const std::vector<DenseEigenpair>& pairs, const Eigen::VectorXd& flow);

/// A grid of time beside the orbit's own, and the part of what multipliers change by on it that is taken for an error.
struct OtherGrid
{
  TimeGrid grid;
  double part = 1;
};

/// Moved by half a step, and of twice as many: the change on this one is 3/4 of the error of a step of order 2.
inline constexpr std::array other_grids = {OtherGrid{{0.5, 1}, 1}, OtherGrid{{0, 2}, 4. / 3}};

/// What grids of time change: of each of the values the distance to its partner, and the rise of its modulus.
struct GridErrors
{
  explicit GridErrors(std::size_t values) : errors(values, 0.), rises(values, 0.) {}

  std::vector<double> errors, rises;
};

/// Adds the parts of the changes to the nearest of `others`, at least as many. Returns the places of these.
std::vector<std::size_t> add_changes(const std::vector<std::complex<double>>& values,
                                     const std::vector<std::complex<double>>& others, double part, GridErrors& grid);

/// Whether larger multipliers than those found are to be expected, and how to find out.
struct Completeness
{
  bool complete = false;
  std::string would_decide; // of one that is not
};

/// How an orbit lost its stability by this multiplier.
Crossing crossing_of(std::complex<double> multiplier);

/// The move of this multiplier by a grid of time, as the shift's own misses 1: a grid moves any motion that nothing
/// else moves, as the phase between parts that do not know of each other. 0 of one that turns.
double moved_by_grid(const Multipliers& multipliers, std::complex<double> value);

/// Says what the bars allow.
void decide(Multipliers& multipliers, const Completeness& coverage);

/// By oblique projection on approximate right and left vectors (src/README.md, section 6.9). `columns`: at most for the
/// search beside them. Undecided without values, with the reason, where these vectors do not serve.
FloquetAnalysis multipliers_by_projection(const Monodromy& monodromy, PetscInt columns);

} // namespace squeal
