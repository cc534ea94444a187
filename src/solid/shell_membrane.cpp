/// Membranes with a rotation about the normal at each node (drilling rotation).
///
/// shell4: bilinear with Wilson's incompatible modes 1 - xi^2, 1 - eta^2 in Taylor's corrected form, as hex8. The
/// drilling rotation is coupled to the rotation of the membrane by the energy  G h int ((v,x - u,y)/2 - rz)^2 dA
/// (Hughes and Brezzi 1989). The modes enter the membrane's rotation too, so that in-plane bending of a rectangle stays
/// exact. With full integration there is no zero-energy mode beside the rigid motions.
///
/// shell3: the optimal triangle OPT (Felippa, Comput. Methods Appl. Mech. Eng. 192, 2003, 2125), with
/// beta = (1, 2, 1, 0, 1, -1, -1, -1, -2), alpha_b = 3/2, beta_0 = (1 - 4 nu^2)/2. In-plane bending of a rectangle is
/// exact at any aspect ratio.
///     strain = mean + 3/2 sqrt(beta_0) T_e Q theta~,   theta~_i = rz_i - rotation of the linear triangle
/// At the middle of side ij, Q is the mean of its values at the corners i and j. The deviations from the mean strain at
/// the three points sum to zero.
#include "shell_membrane.hpp"

#include <cmath>

namespace squeal
{

void add_quad_membrane(ShellStrains<4>& B, const NodeValues& N, const Eigen::Matrix<double, 2, 4>& gradients)
{
  for (Eigen::Index i = 0; i < 4; ++i)
  {
    const double x = gradients(0, i), y = gradients(1, i);
    B.block<4, 1>(0, 6 * i) << x, 0, y, -0.5 * y;
    B.block<4, 1>(0, 6 * i + 1) << 0, y, x, 0.5 * x;
    B(3, 6 * i + 5) = -N(i);
  }
}

ShellModeStrains quad_membrane_modes(const Eigen::Vector3d& xi, const Eigen::Matrix2d& mean_inverse)
{
  ShellModeStrains Ba = ShellModeStrains::Zero();
  for (int k = 0; k < 2; ++k)
  {
    const Eigen::Vector2d g = -2 * xi(k) * mean_inverse.col(k);
    Ba.block<4, 1>(0, 2 * k) << g(0), 0, g(1), -0.5 * g(1);
    Ba.block<4, 1>(0, 2 * k + 1) << 0, g(1), g(0), 0.5 * g(0);
  }
  return Ba;
}

namespace
{

constexpr double alpha_b = 1.5;

/// Adds the mean strain: that of the linear triangle, and that of sides curved by the drilling rotations (Allman).
void add_mean_strain(ShellStrains<3>& B, const PlanePositions<3>& X, double area)
{
  for (int i = 0; i < 3; ++i)
  {
    const Eigen::Vector2d xi = X.col(i), xj = X.col((i + 1) % 3), xk = X.col((i + 2) % 3);
    const Eigen::Vector2d ij = xi - xj, ki = xk - xi, jk = xj - xk;
    const double scale = 0.5 / area, a = alpha_b * scale;
    B.block<3, 1>(0, 6 * i) += scale * Eigen::Vector3d(jk(1), 0, -jk(0));
    B.block<3, 1>(0, 6 * i + 1) += scale * Eigen::Vector3d(0, -jk(0), jk(1));
    B.block<3, 1>(0, 6 * i + 5) += a * Eigen::Vector3d(jk(1) * (ij(1) - ki(1)) / 6, -jk(0) * (ki(0) - ij(0)) / 6,
                                                       (ij(0) * ij(1) - ki(0) * ki(1)) / 3);
  }
}

/// Returns Q at a corner: strains along the sides 01, 12, 20 of unit deviatoric rotations theta~ of the nodes.
Eigen::Matrix3d corner_strains(int corner, double area, const Eigen::Vector3d& squared_length)
{
  constexpr double beta[3][3] = {{1, 2, 1}, {0, 1, -1}, {-1, -1, -2}};
  Eigen::Matrix3d Q;
  for (int side = 0; side < 3; ++side)
    for (int node = 0; node < 3; ++node)
      Q(side, node) = 2 * area / 3 * beta[(side + 3 - corner) % 3][(node + 3 - corner) % 3] / squared_length(side);
  return Q;
}

} // namespace

void add_triangle_membrane(ShellStrains<3>& B, const PlanePositions<3>& X, double poisson, int side)
{
  Eigen::Matrix2d frame;
  frame << X.col(1) - X.col(0), X.col(2) - X.col(0);
  const double area = 0.5 * frame.determinant();
  add_mean_strain(B, X, area);

  Eigen::Matrix3d along; // maps exx eyy gxy to the strains along the sides
  Eigen::Vector3d squared_length;
  using Rotations = Eigen::Matrix<double, 3, 18>;
  Rotations theta = Rotations::Zero(); // theta~ of unit nodal displacements
  for (int i = 0; i < 3; ++i)
  {
    const Eigen::Vector2d s = X.col((i + 1) % 3) - X.col(i), jk = X.col((i + 1) % 3) - X.col((i + 2) % 3);
    squared_length(i) = s.squaredNorm();
    along.row(i) << s(0) * s(0), s(1) * s(1), s(0) * s(1);
    along.row(i) /= squared_length(i);
    theta.col(6 * i).setConstant(-jk(0) / (4 * area));
    theta.col(6 * i + 1).setConstant(-jk(1) / (4 * area));
    theta(i, 6 * i + 5) = 1;
  }
  const Eigen::Matrix3d Q =
      0.5 * (corner_strains(side, area, squared_length) + corner_strains((side + 1) % 3, area, squared_length));
  const double beta_0 = std::max(0.5 * (1 - 4 * poisson * poisson), 0.01); // the bound keeps full rank near nu = 1/2
  const Eigen::Matrix3d strains = 1.5 * std::sqrt(beta_0) * along.inverse() * Q;
  B.topRows<3>() += strains * theta;
}

} // namespace squeal
