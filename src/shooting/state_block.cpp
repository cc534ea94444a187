#include "state_block.hpp"

#include "squeal/algebra/dense_eigenproblems.hpp"

namespace squeal
{

using Eigen::MatrixXd;

StateBlock block_of(std::span<const Owned<Vec>> states)
{
  std::vector<Vec> u, v;
  for (const Owned<Vec>& state : states)
  {
    u.push_back(displacement(state));
    v.push_back(velocity(state));
  }
  return {columns_of(u), columns_of(v)};
}

std::vector<Owned<Vec>> states_of(const StateBlock& X, Vec pattern)
{
  std::vector<Owned<Vec>> states;
  for (Eigen::Index k = 0; k < X.columns(); ++k)
  {
    states.push_back(zeros_like(pattern));
    copy_column(X.u, k, displacement(states.back()));
    copy_column(X.v, k, velocity(states.back()));
  }
  return states;
}

StateBlock combination(const StateBlock& X, const MatrixXd& a)
{
  return {combination(X.u, a), combination(X.v, a)};
}

void subtract(StateBlock& X, const StateBlock& Y, const MatrixXd& a)
{
  X.u.entries.noalias() -= Y.u.entries * a;
  X.v.entries.noalias() -= Y.v.entries * a;
}

void append(StateBlock& X, const StateBlock& Y)
{
  append(X.u, Y.u);
  append(X.v, Y.v);
}

StateBlock energy_images(const Flow& flow, const StateBlock& X)
{
  return {product(flow.K, X.u), product(flow.M, X.v)};
}

MatrixXd inner_products(const StateBlock& X, const StateBlock& Y)
{
  return inner_products(X.u, Y.u) + inner_products(X.v, Y.v);
}

StateBlock orthonormal(const Flow& flow, StateBlock X, double least)
{
  for (int pass = 0; pass < 2 && X.columns() > 0; ++pass) // the second removes what rounding left
  {
    const MatrixXd gram = inner_products(X, energy_images(flow, X));
    const Eigen::VectorXd scale = gram.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd scaled = scale.asDiagonal() * gram * scale.asDiagonal();
    const auto [values, vectors] = solve_dense_symmetric((scaled + scaled.transpose()) / 2);
    const auto kept = (values.array() > least * least * values.maxCoeff()).count();
    X = combination(X, scale.asDiagonal() * vectors.rightCols(kept) *
                           values.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal());
  }
  return X;
}

} // namespace squeal
