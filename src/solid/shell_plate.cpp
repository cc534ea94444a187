/// Plate bending with transverse shear, triangle and quadrilateral alike: the discrete Kirchhoff-Mindlin elements DKMT
/// and DKMQ (Katili, Int. J. Numer. Methods Eng. 36, 1993, 1859 and 1885). They do not lock when thin, tend to
/// discrete Kirchhoff elements, and pass the patch test.
///
///     beta_x = ry, beta_y = -rx: rotation of the fibre, u = z beta;   beta = sum N_i beta_i + sum_k P_k t_k a_k,
/// P_k: quadratic bubble of side k (from i to j, length L, direction t); a_k from the mean of w,s + beta_s = gamma_k on
/// the side and from equilibrium, gamma_k = -2/3 phi_k a_k, phi_k = 12 D_b / (D_s L^2):
///     a_k = -3 / (2 L (1 + phi_k)) (w_j - w_i + L/2 t . (beta_i + beta_j)).
/// Shear: the field with the constant tangential value gamma_k on each side (edge functions).
#include "shell_strains.hpp"

namespace squeal
{

namespace
{

/// W of side k: tangential component 1/L on its own side, none on the others.
Eigen::Vector2d edge_function(Eigen::Index k, const NodeValues& N, const PlaneGradients& g)
{
  const auto nodes = N.size(), j = (k + 1) % nodes;
  if (nodes == 3) return N(k) * g.col(j) - N(j) * g.col(k);
  // half (N_i + N_j) times the gradient of the natural coordinate that runs from i to j
  const auto before = (k + 3) % 4, after = (k + 2) % 4;
  return .5 * (N(k) + N(j)) * (g.col(j) + g.col(after) - g.col(k) - g.col(before));
}

} // namespace

void add_plate(ShellStrains& B, const PlanePositions& X, const Eigen::Vector3d& xi, double slenderness)
{
  const auto nodes = X.cols();
  const ShapeFunctions at = shape_functions(nodes == 3 ? FaceShape::triangle3 : FaceShape::quad4, xi);
  const ShapeFunctions quadratic = shape_functions(nodes == 3 ? FaceShape::triangle6 : FaceShape::quad8, xi);
  const Eigen::Matrix2d inverse = (at.dN.topRows<2>() * X.transpose()).inverse();
  const PlaneGradients g = inverse * at.dN.topRows<2>();
  const PlaneGradients P = inverse * quadratic.dN.topRows<2>().rightCols(nodes);
  for (Eigen::Index i = 0; i < nodes; ++i)
  {
    B.block<3, 1>(4, 6 * i + 4) << g(0, i), 0, g(1, i);   // beta_x = ry
    B.block<3, 1>(4, 6 * i + 3) << 0, -g(1, i), -g(0, i); // beta_y = -rx
  }
  for (Eigen::Index k = 0; k < nodes; ++k)
  {
    const auto j = (k + 1) % nodes;
    const Eigen::Vector2d side = X.col(j) - X.col(k);
    const double L = side.norm(), phi = slenderness / (L * L);
    const Eigen::Vector2d t = side / L;
    Eigen::Matrix<double, 1, 24> a = Eigen::Matrix<double, 1, 24>::Zero();
    a(6 * k + 2) = -1;
    a(6 * j + 2) = 1;
    for (const auto node : {k, j}) a.segment<2>(6 * node + 3) << -.5 * L * t(1), .5 * L * t(0);
    a *= -1.5 / (L * (1 + phi));
    const auto row = a.head(6 * nodes);
    B.row(4) += P(0, k) * t(0) * row;
    B.row(5) += P(1, k) * t(1) * row;
    B.row(6) += (P(1, k) * t(0) + P(0, k) * t(1)) * row;
    B.bottomRows<2>() += edge_function(k, at.N, g) * (-2. / 3 * phi * L) * row;
  }
}

} // namespace squeal
