/// Solids:   K = int B' D B dV,   M = int rho N' N dV,   B: strains (xx yy zz xy yz zx) of nodal displacements.
///
/// hex8 and wedge6 carry incompatible modes, or they would lock in bending (Wilson, Taylor, Doherty, Ghaboussi 1973):
///     u = sum N_i u_i + sum (1 - xi_k^2) a_k,   k = xi, eta, zeta for hex8, zeta alone for wedge6,
/// with Taylor's correction (Taylor, Beresford, Wilson 1976): their gradient is  det(J0)/det(J) J0^-1 dM, J0 at the
/// centre, so that it integrates to zero over any shape and the patch test holds. The parameters a are condensed out
/// and carry no mass. Caveat: wedge6 bends well along zeta only; across its triangles it is the stiff linear triangle.
/// Caveat: hex8 is exact in bending as a parallelepiped and stiffens when tapered (MacNeal 1987), as all 8-node bricks.
#include "condensation.hpp"
#include "kernels.hpp"

namespace squeal
{

namespace
{

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Strains = Columns<6, 60>;
Matrix6 elasticity(const Material& material)
{
  const double nu = material.poisson, mu = material.young / (2 * (1 + nu)), lambda = 2 * mu * nu / (1 - 2 * nu);
  Matrix6 D = Matrix6::Zero();
  D.topLeftCorner<3, 3>().setConstant(lambda);
  D.diagonal() << lambda + 2 * mu, lambda + 2 * mu, lambda + 2 * mu, mu, mu, mu;
  return D;
}

/// Strains of displacements whose gradients in x, y, z are the columns of `g`.
Strains strains_of(const Columns<3, 20>& g)
{
  Strains B = Strains::Zero(6, 3 * g.cols());
  for (Eigen::Index i = 0; i < g.cols(); ++i)
  {
    const double x = g(0, i), y = g(1, i), z = g(2, i);
    B.middleCols<3>(3 * i) << x, 0, 0, /**/ 0, y, 0, /**/ 0, 0, z, /**/ y, x, 0, /**/ 0, z, y, /**/ z, 0, x;
  }
  return B;
}

/// Natural gradients of the modes 1 - xi_k^2 of this shape, one a column.
Columns<3, 20> incompatible_gradients(Shape shape, const Eigen::Vector3d& xi)
{
  const int first = shape == Shape::hex8 ? 0 : 2, count = shape == Shape::hex8 ? 3 : 1;
  Columns<3, 20> g = Columns<3, 20>::Zero(3, count);
  for (int k = 0; k < count; ++k) g(first + k, k) = -2 * xi(first + k);
  return g;
}

std::vector<StrainPoint<Strains>> strain_points(Shape shape, const NodePositions& X, const Matrix6& D)
{
  const Quadrature& rule = stiffness_rule(shape);
  const bool enriched = shape == Shape::hex8 || shape == Shape::wedge6;
  const Eigen::Vector3d centre = shape == Shape::wedge6 ? Eigen::Vector3d(1. / 3, 1. / 3, 0) : Eigen::Vector3d(0, 0, 0);
  const Eigen::Matrix3d J0 = interpolate(shape, centre).dN * X.transpose();
  std::vector<StrainPoint<Strains>> points(rule.size());
  std::vector<Strains> incompatible(enriched ? rule.size() : 0);
  for (std::size_t p = 0; p < rule.size(); ++p)
  {
    const Interpolation at = interpolate(shape, rule[p].xi);
    const Eigen::Matrix3d J = at.dN * X.transpose(); // J(k, l) = dx_l / dxi_k
    const double determinant = positive(J.determinant(), p);
    points[p] = {strains_of(J.inverse() * at.dN), determinant * rule[p].weight};
    if (enriched)
    {
      const Eigen::Matrix3d mean = J0.determinant() / determinant * J0.inverse();
      incompatible[p] = strains_of(mean * incompatible_gradients(shape, rule[p].xi));
    }
  }
  if (enriched) condense(points, incompatible, D);
  return points;
}

Eigen::MatrixXd solid_mass(Shape shape, const NodePositions& X, double density)
{
  const Quadrature& rule = mass_rule(shape);
  const auto nodes = X.cols();
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 20, 20> m =
      Eigen::MatrixXd::Zero(nodes, nodes);
  for (std::size_t p = 0; p < rule.size(); ++p)
  {
    const Interpolation at = interpolate(shape, rule[p].xi);
    const double determinant = positive((at.dN * X.transpose()).determinant(), p);
    m += density * determinant * rule[p].weight * at.N * at.N.transpose();
  }
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(3 * nodes, 3 * nodes);
  for (Eigen::Index i = 0; i < nodes; ++i)
    for (Eigen::Index j = 0; j < nodes; ++j) M.block<3, 3>(3 * i, 3 * j).diagonal().setConstant(m(i, j));
  return M;
}

} // namespace

ElementMatrices solid_matrices(Shape shape, const NodePositions& X, const Material& material)
{
  const Matrix6 D = elasticity(material);
  const Eigen::MatrixXd K = stiffness_of(strain_points(shape, X, D), D);
  return {entries(K), entries(solid_mass(shape, X, material.density))};
}

std::vector<std::array<double, 6>> solid_stress(Shape shape, std::span<const Vec3> x, const Material& material,
                                                std::span<const double> u)
{
  const Matrix6 D = elasticity(material);
  const Eigen::Map<const Eigen::VectorXd> displacement(u.data(), static_cast<Eigen::Index>(u.size()));
  std::vector<std::array<double, 6>> stress;
  for (const auto& point : strain_points(shape, columns_of(x), D))
  {
    std::array<double, 6>& s = stress.emplace_back();
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(s.data()) = D * (point.B * displacement);
  }
  return stress;
}

} // namespace squeal
