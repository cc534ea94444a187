/// Membranes with a rotation about the normal at the nodes (drilling).
///
/// shell4: bilinear with Wilson's incompatible modes 1 - xi^2, 1 - eta^2 in Taylor's corrected form (as hex8), and the
/// drilling rotation tied to the membrane's own, energy  G h int ((v,x - u,y)/2 - rz)^2 dA  (Hughes and Brezzi 1989).
/// The modes count in the rotation too, so that in-plane bending of a rectangle stays exact; full integration leaves no
/// mechanism, and a constant strain or rotation costs nothing.
///
/// shell3: the optimal triangle OPT (Felippa, Comput. Methods Appl. Mech. Eng. 192, 2003, 2125), beta = (1, 2, 1, 0, 1,
/// -1, -1, -1, -2), alpha_b = 3/2, beta_0 = (1 - 4 nu^2)/2: exact in-plane bending of a rectangle at any aspect ratio.
///     strain = mean + 3/2 sqrt(beta_0) T_e Q theta~,   theta~_i = rz_i - rotation of the linear triangle
/// At the middle of side ij Q is the mean of the two corners' Q; the three deviations sum to zero.
#include "shell_strains.hpp"

#include <cmath>

namespace squeal
{

void add_quad_membrane(ShellStrains& B, const NodeValues& N, const PlaneGradients& g)
{
  for (Eigen::Index i = 0; i < N.size(); ++i)
  {
    B.block<4, 1>(0, 6 * i) << g(0, i), 0, g(1, i), -.5 * g(1, i);
    B.block<4, 1>(0, 6 * i + 1) << 0, g(1, i), g(0, i), .5 * g(0, i);
    B(3, 6 * i + 5) = -N(i);
  }
}

ShellStrains quad_membrane_modes(const Eigen::Vector3d& xi, const Eigen::Matrix2d& mean_inverse)
{
  ShellStrains Ba = ShellStrains::Zero(9, 4);
  for (int k = 0; k < 2; ++k)
  {
    const Eigen::Vector2d g = -2 * xi(k) * mean_inverse.col(k);
    Ba.block<4, 1>(0, 2 * k) << g(0), 0, g(1), -.5 * g(1);
    Ba.block<4, 1>(0, 2 * k + 1) << 0, g(1), g(0), .5 * g(0);
  }
  return Ba;
}

namespace
{

constexpr double bending_weight = 1.5; // alpha_b

/// Mean strain: the linear triangle's, plus what the drilling rotations bend the sides by (Allman's parabolas).
void add_mean_strain(ShellStrains& B, const PlanePositions& X, double area)
{
  for (int i = 0; i < 3; ++i)
  {
    const Eigen::Vector2d xi = X.col(i), xj = X.col((i + 1) % 3), xk = X.col((i + 2) % 3);
    const Eigen::Vector2d ij = xi - xj, ki = xk - xi, jk = xj - xk;
    const double scale = .5 / area, a = bending_weight * scale;
    B.block<3, 1>(0, 6 * i) += scale * Eigen::Vector3d(jk(1), 0, -jk(0));
    B.block<3, 1>(0, 6 * i + 1) += scale * Eigen::Vector3d(0, -jk(0), jk(1));
    B.block<3, 1>(0, 6 * i + 5) += a * Eigen::Vector3d(jk(1) * (ij(1) - ki(1)) / 6, -jk(0) * (ki(0) - ij(0)) / 6,
                                                       (ij(0) * ij(1) - ki(0) * ki(1)) / 3);
  }
}

/// Natural strains along the sides 01, 12, 20 at corner `c`, of unit hierarchical rotations of the nodes.
Eigen::Matrix3d corner_strains(int c, double area, const Eigen::Vector3d& squared_length)
{
  constexpr double beta[3][3] = {{1, 2, 1}, {0, 1, -1}, {-1, -1, -2}};
  Eigen::Matrix3d Q;
  for (int side = 0; side < 3; ++side)
    for (int node = 0; node < 3; ++node)
      Q(side, node) = 2 * area / 3 * beta[(side + 3 - c) % 3][(node + 3 - c) % 3] / squared_length(side);
  return Q;
}

} // namespace

void add_triangle_membrane(ShellStrains& B, const PlanePositions& X, double poisson, std::size_t side)
{
  Eigen::Matrix2d frame;
  frame << X.col(1) - X.col(0), X.col(2) - X.col(0);
  const double area = .5 * frame.determinant();
  add_mean_strain(B, X, area);

  Eigen::Matrix3d along; // strain along each side of the Cartesian strain
  Eigen::Vector3d squared_length;
  ShellStrains hierarchical = ShellStrains::Zero(9, 18); // rows 0-2 used: rz_i less the linear triangle's rotation
  for (int i = 0; i < 3; ++i)
  {
    const Eigen::Vector2d s = X.col((i + 1) % 3) - X.col(i), jk = X.col((i + 1) % 3) - X.col((i + 2) % 3);
    squared_length(i) = s.squaredNorm();
    along.row(i) << s(0) * s(0), s(1) * s(1), s(0) * s(1);
    along.row(i) /= squared_length(i);
    hierarchical.block<3, 1>(0, 6 * i).setConstant(-jk(0) / (4 * area));
    hierarchical.block<3, 1>(0, 6 * i + 1).setConstant(-jk(1) / (4 * area));
    hierarchical(i, 6 * i + 5) = 1;
  }
  const int a = static_cast<int>(side), b = (a + 1) % 3;
  const Eigen::Matrix3d Q = .5 * (corner_strains(a, area, squared_length) + corner_strains(b, area, squared_length));
  const double beta_0 = std::max(.5 * (1 - 4 * poisson * poisson), .01); // the floor keeps full rank near nu = 1/2
  B.topRows<3>() += 1.5 * std::sqrt(beta_0) * along.inverse() * Q * hierarchical.topRows<3>();
}

} // namespace squeal
