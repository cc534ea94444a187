#pragma once
/// States side by side: products among them are dense matrix products, and M and K are read once for all.
#include "squeal/algebra/multivector.hpp"
#include "squeal/shooting/flow.hpp"

namespace squeal
{

struct StateBlock
{
  MultiVector u, v;

  Eigen::Index columns() const { return u.columns(); }
};

/// Of at least one state.
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

} // namespace squeal
