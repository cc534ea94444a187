/// Solids:   K = int B' D B dV,   M = int rho U' U dV,
/// with B the strains (xx yy zz xy yz zx) and U the displacements of unit nodal displacements.
///
/// hex8 and wedge6 have incompatible modes, without which they lock in bending (Wilson, Taylor, Doherty, Ghaboussi
/// 1973):
///     u = sum N_i u_i + sum m_k(xi) a_k,
///     m = 1 - xi_k^2 for hex8,   m = xi^2 - xi, eta^2 - eta, xi eta, 1 - zeta^2 for wedge6.
/// Their gradients are corrected (Taylor, Beresford, Wilson 1976) to  det(J0)/det(J) J0^-1 dm,  with J0 the Jacobian at
/// the centre and dm less its mean. They then integrate to zero over any shape, so that the patch test holds. The
/// parameters a_k are condensed statically, in the stiffness and in the mass. Without the share of the modes in the
/// motion the frequency of a bent element is wrong by (k L)^2 / 12.
///
/// Caveats: wedge6 is stiff in bending within the plane of its triangles, as the constant-strain triangle is; it is for
/// filling, not for beams. With constant strains tet4 is stiff in all bending; pyramid5 is nearly so. As a
/// parallelepiped hex8 is exact in bending, and stiffer when tapered (MacNeal 1987), as all 8-node bricks are.
#include "kernels.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <Eigen/LU>

namespace squeal
{

namespace
{

using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// SolidStrains xx yy zz xy yz zx along the axes of R's rows, of unit strains along x, y and z.
Matrix6 strain_rotation(const Eigen::Matrix3d& R)
{
  constexpr std::array<std::array<Eigen::Index, 2>, 6> at = {{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {1, 2}, {2, 0}}};
  Matrix6 T;
  for (std::size_t k = 0; k < 6; ++k)
  {
    Eigen::Matrix3d strain = Eigen::Matrix3d::Zero();
    strain(at[k][0], at[k][1]) += 0.5;
    strain(at[k][1], at[k][0]) += 0.5; // a unit of a shear strain is half a unit of the tensor
    strain = (R * strain * R.transpose()).eval();
    for (std::size_t i = 0; i < 6; ++i)
      T(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = (i < 3 ? 1 : 2) * strain(at[i][0], at[i][1]);
  }
  return T;
}

/// D = T' S^-1 T, S the compliance along the axes of the material.
Matrix6 elasticity(const Orthotropy& material)
{
  const auto& [E, nu, G, axis_1, axis_2, cylinder] = material; // these axes are those at the element
  Matrix6 S = Matrix6::Zero();
  S.diagonal() << 1 / E[0], 1 / E[1], 1 / E[2], 1 / G[0], 1 / G[2], 1 / G[1];
  S(0, 1) = S(1, 0) = -nu[0] / E[0];
  S(0, 2) = S(2, 0) = -nu[1] / E[0];
  S(1, 2) = S(2, 1) = -nu[2] / E[1];
  const Vec3 axis_3 = cross(axis_1, axis_2);
  Eigen::Matrix3d R;
  R << axis_1[0], axis_1[1], axis_1[2], axis_2[0], axis_2[1], axis_2[2], axis_3[0], axis_3[1], axis_3[2];
  const Matrix6 T = strain_rotation(R);
  return T.transpose() * S.inverse() * T;
}

Matrix6 elasticity(const Material& material)
{
  if (material.orthotropy) return elasticity(*material.orthotropy);
  const double nu = material.poisson, mu = material.young / (2 * (1 + nu)), lambda = 2 * mu * nu / (1 - 2 * nu);
  Matrix6 D = Matrix6::Zero();
  D.topLeftCorner<3, 3>().setConstant(lambda);
  D.diagonal() << lambda + 2 * mu, lambda + 2 * mu, lambda + 2 * mu, mu, mu, mu;
  return D;
}

using SolidGradients = Eigen::Matrix3Xd;                       // one function a column
using SolidStrains = Eigen::Matrix<double, 6, Eigen::Dynamic>; // of unit displacements, one a column

/// Returns the strains of displacements whose gradients in x, y, z are the columns of g.
SolidStrains strains_of(const SolidGradients& g)
{
  SolidStrains B(6, 3 * g.cols());
  for (Eigen::Index i = 0; i < g.cols(); ++i)
  {
    const double x = g(0, i), y = g(1, i), z = g(2, i);
    B.middleCols<3>(3 * i) << x, 0, 0, /**/ 0, y, 0, /**/ 0, 0, z, /**/ y, x, 0, /**/ 0, z, y, /**/ z, 0, x;
  }
  return B;
}

/// The number of incompatible modes.
Eigen::Index modes_of(Shape shape)
{
  return shape == Shape::hex8 ? 3 : shape == Shape::wedge6 ? 4 : 0;
}

/// Returns the natural gradients of the incompatible modes, one a column.
SolidGradients mode_gradients(Shape shape, const Eigen::Vector3d& xi)
{
  SolidGradients g = SolidGradients::Zero(3, modes_of(shape));
  if (shape == Shape::hex8) g.diagonal() = -2 * xi;
  if (shape == Shape::wedge6)
    g << 2 * xi(0) - 1, 0, xi(1), 0, /**/ 0, 2 * xi(1) - 1, xi(0), 0, /**/ 0, 0, 0, -2 * xi(2);
  return g;
}

/// Less their mean over the reference element, which is their value at its centre.
SolidGradients mode_gradients_without_mean(Shape shape, const Eigen::Vector3d& xi)
{
  return mode_gradients(shape, xi) - mode_gradients(shape, middle_of(shape));
}

/// Returns the values of the same modes, which vanish at the nodes.
VectorXd mode_values(Shape shape, const Eigen::Vector3d& xi)
{
  if (shape == Shape::hex8) return 1 - xi.array().square();
  if (shape == Shape::wedge6)
    return Eigen::Vector4d(xi(0) * xi(0) - xi(0), xi(1) * xi(1) - xi(1), xi(0) * xi(1), 1 - xi(2) * xi(2));
  return {};
}

/// Strain operators of an element.
struct Kinematics
{
  std::vector<StrainPoint<SolidStrains>> points; // of the stiffness rule
  MatrixXd amplitudes;                           // of unit nodal displacements: row 3 k + component of mode k
};

Kinematics kinematics(Shape shape, const NodePositions& X, const Matrix6& D)
{
  Kinematics result{{}, MatrixXd(0, 3 * X.cols())};
  std::vector<SolidStrains> mode_strains;
  const Eigen::Matrix3d J0 = shape_functions(shape, middle_of(shape)).dN * X.transpose();
  for (const auto& [xi, weight, at] : stiffness_rule(shape))
  {
    const Eigen::Matrix3d J = at.dN * X.transpose(); // J(k, l) = dx_l / dxi_k
    const double determinant = positive_jacobian(J.determinant(), result.points.size());
    result.points.push_back({strains_of(J.inverse() * at.dN), determinant * weight});
    mode_strains.push_back(
        strains_of(J0.determinant() / determinant * J0.inverse() * mode_gradients_without_mean(shape, xi)));
  }
  if (modes_of(shape) > 0) result.amplitudes = condense_parameters(result.points, mode_strains, D);
  return result;
}

/// Returns the matrix with S_ij times the 3 x 3 identity as its blocks.
MatrixXd in_three_directions(const MatrixXd& S)
{
  MatrixXd result = MatrixXd::Zero(3 * S.rows(), 3 * S.cols());
  for (Eigen::Index i = 0; i < S.rows(); ++i)
    for (Eigen::Index j = 0; j < S.cols(); ++j) result.block<3, 3>(3 * i, 3 * j).diagonal().setConstant(S(i, j));
  return result;
}

/// Returns what a form S on shape functions and modes, f = (N, m), is in three directions on the nodal displacements,
/// of which the modes have these amplitudes.
MatrixXd on_nodes(const MatrixXd& S, const MatrixXd& amplitudes)
{
  const Eigen::Index dofs = amplitudes.cols();
  MatrixXd motion(dofs + amplitudes.rows(), dofs); // of f, of unit nodal displacements
  motion << MatrixXd::Identity(dofs, dofs), amplitudes;
  return motion.transpose() * in_three_directions(S) * motion;
}

/// Returns M from the scalar mass S = int rho f f' dV and the amplitudes A of the modes.
MatrixXd mass_matrix(Shape shape, const NodePositions& X, const MatrixXd& A, double density)
{
  const Eigen::Index n = X.cols(), modes = modes_of(shape);
  MatrixXd S = MatrixXd::Zero(n + modes, n + modes);
  std::size_t point = 0;
  for (const auto& [xi, weight, at] : mass_rule(shape))
  {
    const double volume = weight * positive_jacobian((at.dN * X.transpose()).determinant(), point++);
    VectorXd f(n + modes);
    f << at.N, mode_values(shape, xi);
    S += density * volume * f * f.transpose();
  }
  if (modes == 0) return in_three_directions(S);
  const MatrixXd M = on_nodes(S, A);
  return (M + M.transpose()) / 2;
}

/// Returns G, K_c and the force of src/README.md, section 1.10. The incompatible modes take part in G, as in the mass.
/// K_c and the force leave them out, as the stiffness of the stress does: rigid motions then keep no stiffness.
SpinMatrices spin(Shape shape, const NodePositions& X, const MatrixXd& amplitudes, double density,
                  const Rotation& rotation)
{
  const Eigen::Index n = X.cols(), modes = modes_of(shape);
  const Eigen::Vector3d axis(rotation.axis.data()), centre(rotation.centre.data());
  MatrixXd S = MatrixXd::Zero(n + modes, n + modes), centrifugal = MatrixXd::Zero(n, n);
  SpinMatrices result{{}, {}, VectorXd::Zero(3 * n)};
  std::size_t point = 0;
  for (const auto& [xi, weight, at] : mass_rule(shape))
  {
    const Eigen::Matrix3d J = at.dN * X.transpose();
    const double mass = density * weight * positive_jacobian(J.determinant(), point++);
    const Eigen::Vector3d velocity = rotation.rate * axis.cross(X * at.N - centre);
    const VectorXd along = (J.inverse() * at.dN).transpose() * velocity;
    VectorXd f(n + modes), df(n + modes); // values, and derivatives along the velocity
    f << at.N, mode_values(shape, xi);
    df << along, (J.inverse() * mode_gradients(shape, xi)).transpose() * velocity;
    S += mass * (f * df.transpose() - df * f.transpose());
    centrifugal -= mass * along * along.transpose();
    for (Eigen::Index i = 0; i < n; ++i) result.force.segment<3>(3 * i) += mass * along(i) * velocity;
  }
  result.gyroscopic = on_nodes(S, amplitudes);
  result.centrifugal = in_three_directions(centrifugal);
  return result;
}

} // namespace

ElementMatrices solid_matrices(Shape shape, const NodePositions& X, const Material& material)
{
  const Matrix6 D = elasticity(material);
  const auto [points, amplitudes] = kinematics(shape, X, D);
  return {stiffness_matrix(points, D), mass_matrix(shape, X, amplitudes, material.density)};
}

SpinMatrices spin_matrices(Shape shape, std::span<const Vec3> x, const Material& material, const Rotation& rotation)
{
  const NodePositions X = position_matrix(x);
  const Kinematics motion = kinematics(shape, X, elasticity(material));
  return spin(shape, X, motion.amplitudes, material.density, rotation);
}

Eigen::MatrixXd stress_stiffness(Shape shape, std::span<const Vec3> x, const Material& material,
                                 std::span<const double> u)
{
  const NodePositions X = position_matrix(x);
  const std::vector<std::array<double, 6>> stress = solid_stress(shape, x, material, u);
  MatrixXd S = MatrixXd::Zero(X.cols(), X.cols());
  std::size_t point = 0;
  for (const auto& [xi, weight, at] : stiffness_rule(shape))
  {
    const Eigen::Matrix3d J = at.dN * X.transpose();
    const SolidGradients g = J.inverse() * at.dN;
    const auto& [xx, yy, zz, xy, yz, zx] = stress[point];
    Eigen::Matrix3d sigma;
    sigma << xx, xy, zx, xy, yy, yz, zx, yz, zz;
    S += weight * positive_jacobian(J.determinant(), point++) * g.transpose() * sigma * g;
  }
  return in_three_directions(S);
}

std::vector<std::array<double, 6>> solid_stress(Shape shape, std::span<const Vec3> x, const Material& material,
                                                std::span<const double> u)
{
  const Matrix6 D = elasticity(material);
  const Eigen::Map<const VectorXd> displacement(u.data(), static_cast<Eigen::Index>(3 * x.size()));
  std::vector<std::array<double, 6>> stress;
  for (const auto& [B, measure] : kinematics(shape, position_matrix(x), D).points)
    Eigen::Map<Eigen::Vector<double, 6>>(stress.emplace_back().data()) = D * (B * displacement);
  return stress;
}

int dofs_per_node(Shape shape)
{
  return is_shell(shape) ? 6 : 3;
}

ElementMatrices element_matrices(Shape shape, std::span<const Vec3> x, const Material& material, double thickness,
                                 std::span<const Vec3> arms)
{
  const NodePositions X = position_matrix(x), A = arms.empty() ? NodePositions(0 * X) : position_matrix(arms);
  return is_shell(shape) ? shell_matrices(shape, X, A, material, thickness) : solid_matrices(shape, X, material);
}

} // namespace squeal
