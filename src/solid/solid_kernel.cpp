/// Solids:   K = int B' D B dV,   M = int rho N' N dV,   B: strains (xx yy zz xy yz zx) of nodal displacements.
///
/// hex8 and wedge6 carry incompatible modes, or they would lock in bending (Wilson, Taylor, Doherty, Ghaboussi 1973):
///     u = sum N_i u_i + sum m_k(xi) a_k,   m = 1 - xi_k^2 for hex8,   xi^2 - xi, eta^2 - eta, xi eta, 1 - zeta^2 for
/// wedge6, with Taylor's correction (Taylor, Beresford, Wilson 1976): their gradient is  det(J0)/det(J) J0^-1 dm, J0 at
/// the centre and dm less its mean, so that it integrates to zero over any shape and the patch test holds. The
/// parameters follow the nodes statically, in the stiffness and in the mass: without the modes' share of the motion
/// the mass of a bent element is too small, and its frequency out by (k L)^2 / 12.
///
/// Caveats: wedge6 stays stiff in bending, in the plane of its triangles as the constant-strain triangle is: for
/// filling, not for beams. hex8 is exact in bending as a parallelepiped and stiffens when tapered (MacNeal 1987), as
/// all 8-node bricks.
#include "condensation.hpp"
#include "kernels.hpp"
#include "squeal/mesh/quadrature.hpp"

namespace squeal
{

namespace
{

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Strains = BoundedMatrix<6, 60>;

Matrix6 elasticity(const Material& material)
{
  const double nu = material.poisson, mu = material.young / (2 * (1 + nu)), lambda = 2 * mu * nu / (1 - 2 * nu);
  Matrix6 D = Matrix6::Zero();
  D.topLeftCorner<3, 3>().setConstant(lambda);
  D.diagonal() << lambda + 2 * mu, lambda + 2 * mu, lambda + 2 * mu, mu, mu, mu;
  return D;
}

/// Strains of displacements whose gradients in x, y, z are the columns of `g`.
Strains strains_of(const BoundedMatrix<3, 20>& g)
{
  Strains B = Strains::Zero(6, 3 * g.cols());
  for (Eigen::Index i = 0; i < g.cols(); ++i)
  {
    const double x = g(0, i), y = g(1, i), z = g(2, i);
    B.middleCols<3>(3 * i) << x, 0, 0, /**/ 0, y, 0, /**/ 0, 0, z, /**/ y, x, 0, /**/ 0, z, y, /**/ z, 0, x;
  }
  return B;
}

/// Natural gradients of the incompatible modes, one a column, less their mean over the parent element.
BoundedMatrix<3, 20> incompatible_gradients(Shape shape, const Eigen::Vector3d& xi)
{
  if (shape == Shape::hex8) return Eigen::Matrix3d((-2 * xi).asDiagonal());
  const double r = xi(0) - 1. / 3, s = xi(1) - 1. / 3;
  BoundedMatrix<3, 20> g(3, 4);
  g << 2 * r, 0, s, 0, /**/ 0, 2 * s, r, 0, /**/ 0, 0, 0, -2 * xi(2);
  return g;
}

/// Values of the same modes, which vanish at the nodes.
Eigen::VectorXd incompatible_values(Shape shape, const Eigen::Vector3d& xi)
{
  if (shape == Shape::hex8) return 1 - xi.array().square();
  return Eigen::Vector4d(xi(0) * xi(0) - xi(0), xi(1) * xi(1) - xi(1), xi(0) * xi(1), 1 - xi(2) * xi(2));
}

bool is_enriched(Shape shape)
{
  return shape == Shape::hex8 || shape == Shape::wedge6;
}

struct Kinematics
{
  std::vector<StrainPoint<Strains>> points;
  Eigen::MatrixXd modes; // amplitudes of unit nodal displacements: row 3 k + component of mode k
};

Kinematics kinematics(Shape shape, const NodePositions& X, const Matrix6& D)
{
  const Quadrature& rule = stiffness_rule(shape);
  const Eigen::Vector3d centre = shape == Shape::wedge6 ? Eigen::Vector3d(1. / 3, 1. / 3, 0) : Eigen::Vector3d(0, 0, 0);
  const Eigen::Matrix3d J0 = shape_functions(shape, centre).dN * X.transpose();
  std::vector<StrainPoint<Strains>> points(rule.size());
  std::vector<Strains> incompatible(is_enriched(shape) ? rule.size() : 0);
  for (std::size_t p = 0; p < rule.size(); ++p)
  {
    const ShapeFunctions& at = rule[p].at;
    const Eigen::Matrix3d J = at.dN * X.transpose(); // J(k, l) = dx_l / dxi_k
    const double determinant = positive(J.determinant(), p);
    points[p] = {strains_of(J.inverse() * at.dN), determinant * rule[p].weight};
    if (!is_enriched(shape)) continue;
    const Eigen::Matrix3d mean = J0.determinant() / determinant * J0.inverse();
    incompatible[p] = strains_of(mean * incompatible_gradients(shape, rule[p].xi));
  }
  Eigen::MatrixXd modes;
  if (is_enriched(shape)) modes = condense(points, incompatible, D);
  return {std::move(points), std::move(modes)};
}

Eigen::MatrixXd solid_mass(Shape shape, const NodePositions& X, const Eigen::MatrixXd& modes, double density)
{
  const Quadrature& rule = mass_rule(shape);
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(3 * X.cols(), 3 * X.cols());
  for (std::size_t p = 0; p < rule.size(); ++p)
  {
    const ShapeFunctions& at = rule[p].at;
    const double volume = rule[p].weight * positive((at.dN * X.transpose()).determinant(), p);
    BoundedMatrix<3, 60> U = BoundedMatrix<3, 60>::Zero(3, 3 * X.cols()); // displacement at the point
    for (Eigen::Index i = 0; i < X.cols(); ++i) U.middleCols<3>(3 * i).diagonal().setConstant(at.N(i));
    if (is_enriched(shape))
    {
      const Eigen::VectorXd m = incompatible_values(shape, rule[p].xi);
      for (Eigen::Index k = 0; k < m.size(); ++k) U += m(k) * modes.middleRows<3>(3 * k);
    }
    M += density * volume * U.transpose() * U;
  }
  return .5 * (M + M.transpose());
}

} // namespace

ElementMatrices solid_matrices(Shape shape, const NodePositions& X, const Material& material)
{
  const Matrix6 D = elasticity(material);
  const auto [points, modes] = kinematics(shape, X, D);
  return {entries(stiffness_of(points, D)), entries(solid_mass(shape, X, modes, material.density))};
}

std::vector<std::array<double, 6>> solid_stress(Shape shape, std::span<const Vec3> x, const Material& material,
                                                std::span<const double> u)
{
  const Matrix6 D = elasticity(material);
  const Eigen::Map<const Eigen::VectorXd> displacement(u.data(), static_cast<Eigen::Index>(u.size()));
  std::vector<std::array<double, 6>> stress;
  for (const auto& point : kinematics(shape, position_matrix(x), D).points)
  {
    std::array<double, 6>& s = stress.emplace_back();
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(s.data()) = D * (point.B * displacement);
  }
  return stress;
}

} // namespace squeal
