#pragma once
/// The monodromy matrix dPhi_T/dx at an orbit, applied to states, and what is said of its eigenvalues.
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/algebra/multivector.hpp"
#include "squeal/shooting/flow.hpp"
#include "squeal/shooting/multipliers.hpp"

#include <Eigen/QR>

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

/// How an orbit lost its stability by this multiplier.
Crossing crossing_of(std::complex<double> multiplier);

/// The move of this multiplier by a grid of time, as the shift's own misses 1. A grid moves any motion that nothing
/// else holds, such as the phase between uncoupled parts. 0 of one that turns.
double moved_by_grid(const Multipliers& multipliers, std::complex<double> value);

/// Says what the bars allow. `missing`: why larger multipliers are to be expected, and how to find out; empty: none.
void decide(Multipliers& multipliers, const std::string& missing);

/// By oblique projection on approximate right and left vectors (src/README.md, section 6.9). `columns`: at most for the
/// search beside them. Undecided without values, with the reason, where these vectors do not serve.
FloquetAnalysis multipliers_by_projection(const Monodromy& monodromy, PetscInt columns);

// States side by side: products among them are dense matrix products, and M and K are read once for all.

struct StateBlock
{
  MultiVector u, v;

  Eigen::Index columns() const { return u.columns(); }
};

/// The states as columns; there is at least one.
StateBlock block_of(std::span<const Owned<Vec>> states);

/// The columns as states like `pattern`.
std::vector<Owned<Vec>> states_of(const StateBlock& X, Vec pattern);

/// X a
StateBlock combination(const StateBlock& X, const Eigen::MatrixXd& a);

/// X - Y a
void subtract(StateBlock& X, const StateBlock& Y, const Eigen::MatrixXd& a);

void append(StateBlock& X, const StateBlock& Y);

/// Y_k with <x, y_k> = x'Y_k
StateBlock energy_images(const Flow& flow, const StateBlock& X);

/// X'Y without weights, the same on every rank.
Eigen::MatrixXd inner_products(const StateBlock& X, const StateBlock& Y);

/// An energy-orthonormal basis of the span, without directions of which less than `least` of the largest is there.
/// Columns are scaled to an energy norm of 1 first.
StateBlock orthonormal(const Flow& flow, StateBlock X, double least);

// All motions of a small system side by side, for its whole monodromy matrix.

/// Orthonormal columns in coordinates of displacements and of velocities over 2 pi/T, which are of their size in a
/// vibration.
struct WholeSpace
{
  StateBlock right; // the states of the columns
  StateBlock left;  // a state x has the coordinates left'x
};

/// All motions but velocities without mass, on which none depends. A theta step carries those along as (v_theta - (1 -
/// theta) v)/theta. Their multipliers are [-(1 - theta)/theta]^N a period of N steps, 1 in modulus at theta = 1/2.
/// Motions along offsets that are held in the period recorded last are left out, too: each has
/// a multiplier 1. Collective.
WholeSpace whole_space(const Flow& flow, double period);

// The oblique projector V (W'V)^-1 W' on approximate right vectors V (src/README.md, section 6.9). W holds energy
// images of approximate left vectors. All functions are collective.

/// Parts of a direction below this are dropped: rounding of the energy product's squares.
inline constexpr double least_part = 1e-10;

/// V (W'V)^-1 W'
struct Projector
{
  StateBlock V, W; // W holds energy images of left vectors
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> gram{};
};

/// Makes the projector fit V, which is orthonormal. Returns the condition of W'V.
double fit(Projector& projector);

/// (W'V)^-1 W'X
Eigen::MatrixXd coefficients(const Projector& projector, const StateBlock& X);

/// X without its part in the span of V.
void deflate(const Projector& projector, StateBlock& X);

/// dPhi_T/dx X
StateBlock image_of(const Monodromy& monodromy, const StateBlock& X);

// The largest Ritz values of dPhi_T/dx beside known motions, in a block Arnoldi space (src/README.md, section 6.9).

/// The largest Ritz pair.
struct DeflatedSearch
{
  bool bounded = false;  // its value is below 1 by more than its residual
  DenseEigenpair pair{}; // its vector in the coordinates of Q; without entries: there is none
  double residual = 0;   // of that pair
  StateBlock Q{};        // energy-orthonormal
  long columns = 0;      // products with the monodromy matrix
};

/// Takes from each column what is known.
using Deflation = std::function<void(StateBlock&)>;

/// Searches from random velocities, with at most `columns` columns beyond the first block. It ends when the largest
/// value is bounded, or a projection can go on from it. Collective.
DeflatedSearch search_beside(const Monodromy& monodromy, const Deflation& deflation, Eigen::Index columns);

} // namespace squeal
