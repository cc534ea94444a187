#include "oblique_projector.hpp"

#include <algorithm>
#include <Eigen/SVD>

namespace squeal
{

double fit(Projector& projector)
{
  const Eigen::MatrixXd gram = inner_products(projector.W, projector.V);
  const Eigen::VectorXd sizes = Eigen::JacobiSVD<Eigen::MatrixXd>(gram).singularValues();
  projector.gram.compute(gram);
  return sizes.size() == 0 ? 1 : sizes(0) / std::max(sizes(sizes.size() - 1), 1e-300);
}

Eigen::MatrixXd coefficients(const Projector& projector, const StateBlock& X)
{
  return projector.gram.solve(inner_products(projector.W, X));
}

void deflate(const Projector& projector, StateBlock& X)
{
  if (projector.V.columns() > 0) subtract(X, projector.V, coefficients(projector, X));
}

StateBlock image_of(const Monodromy& monodromy, const StateBlock& X)
{
  const std::vector<Owned<Vec>> states = states_of(X, monodromy.orbit.state);
  multiply(monodromy, states);
  return block_of(states);
}

} // namespace squeal
