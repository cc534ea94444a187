/// Plate bending with transverse shear: the discrete Kirchhoff-Mindlin triangle DKMT and quadrilateral DKMQ (Katili,
/// Int. J. Numer. Methods Eng. 36, 1993, 1859 and 1885). They do not lock when thin, converge to discrete Kirchhoff
/// elements, and pass the patch test.
///
///     beta_x = ry, beta_y = -rx: rotation of the fibre, u = z beta;   beta = sum N_i beta_i + sum_k P_k t_k a_k,
/// with P_k the quadratic bubble of side k, which goes from i to j, has the length L and the direction t. The amplitude
/// a_k follows from equilibrium, gamma_k = -2/3 phi_k a_k with phi_k = 12 D_b / (D_s L^2), and from the mean of
/// w,s + beta_s = gamma_k on the side:
///     a_k = -3 / (2 L (1 + phi_k)) (w_j - w_i + L/2 t . (beta_i + beta_j)).
/// The shear strain is the field with the constant tangential value gamma_k on each side (edge functions).
#include "shell_plate.hpp"

namespace squeal
{

namespace
{

template <int n> using PlaneGradients = Eigen::Matrix<double, 2, n>;

/// Returns the edge function of side k: its tangential component is 1/L on this side and zero on the others.
template <int n> Eigen::Vector2d edge_function(Eigen::Index k, const NodeValues& N, const PlaneGradients<n>& g)
{
  const auto j = (k + 1) % n;
  if constexpr (n == 3) return N(k) * g.col(j) - N(j) * g.col(k);
  // (N_i + N_j)/2 times the gradient of the natural coordinate that increases from i to j.
  const auto before = (k + 3) % 4, after = (k + 2) % 4;
  return 0.5 * (N(k) + N(j)) * (g.col(j) + g.col(after) - g.col(k) - g.col(before));
}

} // namespace

template <int n>
void add_plate(ShellStrains<n>& B, const PlanePositions<n>& X, const Eigen::Vector3d& xi, double slenderness)
{
  const ShapeFunctions at = shape_functions(n == 3 ? FaceShape::triangle3 : FaceShape::quad4, xi);
  const ShapeFunctions quadratic = shape_functions(n == 3 ? FaceShape::triangle6 : FaceShape::quad8, xi);
  const Eigen::Matrix2d inverse = (at.dN.topRows<2>() * X.transpose()).inverse();
  const PlaneGradients<n> g = inverse * at.dN.topRows<2>();
  const PlaneGradients<n> P = inverse * quadratic.dN.topRows<2>().rightCols(n);
  for (Eigen::Index i = 0; i < n; ++i)
  {
    B.template block<3, 1>(4, 6 * i + 4) << g(0, i), 0, g(1, i);   // beta_x = ry
    B.template block<3, 1>(4, 6 * i + 3) << 0, -g(1, i), -g(0, i); // beta_y = -rx
  }
  for (Eigen::Index k = 0; k < n; ++k)
  {
    const auto j = (k + 1) % n;
    const Eigen::Vector2d side = X.col(j) - X.col(k);
    const double L = side.norm(), phi = slenderness / (L * L);
    const Eigen::Vector2d t = side / L;
    Eigen::RowVector<double, 6 * n> a = Eigen::RowVector<double, 6 * n>::Zero(); // a_k of unit nodal displacements
    a(6 * k + 2) = -1;
    a(6 * j + 2) = 1;
    for (const auto node : {k, j}) a.template segment<2>(6 * node + 3) << -0.5 * L * t(1), 0.5 * L * t(0);
    a *= -1.5 / (L * (1 + phi));
    B.row(4) += P(0, k) * t(0) * a;
    B.row(5) += P(1, k) * t(1) * a;
    B.row(6) += (P(1, k) * t(0) + P(0, k) * t(1)) * a;
    B.template bottomRows<2>() += edge_function<n>(k, at.N, g) * (-2. / 3 * phi * L) * a;
  }
}

template void add_plate<3>(ShellStrains<3>&, const PlanePositions<3>&, const Eigen::Vector3d&, double);
template void add_plate<4>(ShellStrains<4>&, const PlanePositions<4>&, const Eigen::Vector3d&, double);

} // namespace squeal
