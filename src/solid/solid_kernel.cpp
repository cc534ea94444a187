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
/// filling, not for beams. tet4 has constant strains and is stiff in all bending. hex8 is exact in bending as a
/// parallelepiped and stiffer when tapered (MacNeal 1987), as all 8-node bricks are.
#include "kernels.hpp"
#include "squeal/mesh/quadrature.hpp"
#include "squeal/mesh/shapes.hpp"

#include <Eigen/LU>

namespace squeal
{

namespace
{

using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// Strains xx yy zz xy yz zx along the axes of R's rows, of unit strains along x, y and z.
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

template <int columns> using Gradients = Eigen::Matrix<double, 3, columns>;
template <int columns> using Strains = Eigen::Matrix<double, 6, 3 * columns>;

/// Returns the strains of displacements whose gradients in x, y, z are the columns of g.
template <int columns> Strains<columns> strains_of(const Gradients<columns>& g)
{
  Strains<columns> B;
  for (Eigen::Index i = 0; i < columns; ++i)
  {
    const double x = g(0, i), y = g(1, i), z = g(2, i);
    B.template middleCols<3>(3 * i) << x, 0, 0, /**/ 0, y, 0, /**/ 0, 0, z, /**/ y, x, 0, /**/ 0, z, y, /**/ z, 0, x;
  }
  return B;
}

/// Returns the natural gradients of the incompatible modes, one a column.
template <int modes> Gradients<modes> mode_gradients(const Eigen::Vector3d& xi)
{
  Gradients<modes> g;
  if constexpr (modes == 3)
    g = (-2 * xi).asDiagonal();
  else
    g << 2 * xi(0) - 1, 0, xi(1), 0, /**/ 0, 2 * xi(1) - 1, xi(0), 0, /**/ 0, 0, 0, -2 * xi(2);
  return g;
}

template <int modes> Eigen::Vector3d centre_of_reference()
{
  return modes == 4 ? Eigen::Vector3d(1. / 3, 1. / 3, 0) : Eigen::Vector3d(0, 0, 0);
}

/// Less their mean over the reference element, which is their value at its centre.
template <int modes> Gradients<modes> mode_gradients_without_mean(const Eigen::Vector3d& xi)
{
  return mode_gradients<modes>(xi) - mode_gradients<modes>(centre_of_reference<modes>());
}

/// Returns the values of the same modes, which vanish at the nodes.
template <int modes> Eigen::Vector<double, modes> mode_values(const Eigen::Vector3d& xi)
{
  if constexpr (modes == 3)
    return 1 - xi.array().square();
  else
    return {xi(0) * xi(0) - xi(0), xi(1) * xi(1) - xi(1), xi(0) * xi(1), 1 - xi(2) * xi(2)};
}

/// Strain operators of an element with n nodes and its number of incompatible modes: 3 for hex8, 4 for wedge6, else 0.
template <int n, int modes> struct Kinematics
{
  std::vector<StrainPoint<Strains<n>>> points;        // of the stiffness rule
  Eigen::Matrix<double, 3 * modes, 3 * n> amplitudes; // of unit nodal displacements: row 3 k + component of mode k
};

template <int n, int modes> Kinematics<n, modes> kinematics(Shape shape, const NodePositions& X, const Matrix6& D)
{
  const Quadrature& rule = stiffness_rule(shape);
  Kinematics<n, modes> result;
  std::vector<Strains<modes>> mode_strains;
  Eigen::Matrix3d J0;
  if constexpr (modes > 0)
  {
    J0 = shape_functions(shape, centre_of_reference<modes>()).dN * X.transpose();
  }
  for (const auto& [xi, weight, at] : rule)
  {
    const Eigen::Matrix3d J = at.dN * X.transpose(); // J(k, l) = dx_l / dxi_k
    const double determinant = positive_jacobian(J.determinant(), result.points.size());
    result.points.push_back({strains_of<n>(J.inverse() * at.dN), determinant * weight});
    if constexpr (modes > 0)
      mode_strains.push_back(
          strains_of<modes>(J0.determinant() / determinant * J0.inverse() * mode_gradients_without_mean<modes>(xi)));
  }
  if constexpr (modes > 0) result.amplitudes = condense_parameters(result.points, mode_strains, D);
  return result;
}

/// Returns the matrix with S_ij times the 3 x 3 identity as its blocks.
template <int rows, int columns>
Eigen::Matrix<double, 3 * rows, 3 * columns> in_three_directions(const Eigen::Matrix<double, rows, columns>& S)
{
  Eigen::Matrix<double, 3 * rows, 3 * columns> result = Eigen::Matrix<double, 3 * rows, 3 * columns>::Zero();
  for (Eigen::Index i = 0; i < rows; ++i)
    for (Eigen::Index j = 0; j < columns; ++j)
      result.template block<3, 3>(3 * i, 3 * j).diagonal().setConstant(S(i, j));
  return result;
}

/// Returns M from the scalar mass S = int rho f f' dV of the shape functions and modes, f = (N, m), and the amplitudes
/// A of the modes. With S partitioned like f, M = S_NN + A' S_mN + S_Nm A + A' S_mm A in three directions.
template <int n, int modes> Eigen::Matrix<double, 3 * n, 3 * n>
mass_matrix(Shape shape, const NodePositions& X, const Kinematics<n, modes>& kinematics, double density)
{
  Eigen::Matrix<double, n + modes, n + modes> S = Eigen::Matrix<double, n + modes, n + modes>::Zero();
  std::size_t point = 0;
  for (const auto& [xi, weight, at] : mass_rule(shape))
  {
    const double volume = weight * positive_jacobian((at.dN * X.transpose()).determinant(), point++);
    Eigen::Vector<double, n + modes> f;
    f.template head<n>() = at.N;
    if constexpr (modes > 0) f.template tail<modes>() = mode_values<modes>(xi);
    S += density * volume * f * f.transpose();
  }
  Eigen::Matrix<double, 3 * n, 3 * n> M = in_three_directions<n, n>(S.template topLeftCorner<n, n>());
  if constexpr (modes > 0)
  {
    const auto& A = kinematics.amplitudes;
    const Eigen::Matrix<double, 3 * n, 3 * n> half =
        A.transpose() * (in_three_directions<modes, n>(S.template bottomLeftCorner<modes, n>()) +
                         0.5 * in_three_directions<modes, modes>(S.template bottomRightCorner<modes, modes>()) * A);
    M += half + half.transpose();
  }
  return M;
}

/// Returns G, K_c and the force of src/README.md, section 1.10. The incompatible modes take part in G, as in the mass.
/// K_c and the force leave them out, as the stiffness of the stress does: rigid motions then keep no stiffness.
template <int n, int modes> SpinMatrices spin(Shape shape, const NodePositions& X,
                                              const Kinematics<n, modes>& kinematics, double density,
                                              const Rotation& rotation)
{
  const Eigen::Vector3d axis(rotation.axis.data()), centre(rotation.centre.data());
  Eigen::Matrix<double, n + modes, n + modes> S = Eigen::Matrix<double, n + modes, n + modes>::Zero();
  Eigen::Matrix<double, n, n> centrifugal = Eigen::Matrix<double, n, n>::Zero();
  SpinMatrices result{{}, {}, Eigen::VectorXd::Zero(3 * n)};
  std::size_t point = 0;
  for (const auto& [xi, weight, at] : mass_rule(shape))
  {
    const Eigen::Matrix3d J = at.dN * X.transpose();
    const double mass = density * weight * positive_jacobian(J.determinant(), point++);
    const Eigen::Vector3d velocity = rotation.rate * axis.cross(X * at.N - centre);
    Eigen::Vector<double, n + modes> f, df; // values, and derivatives along the velocity
    f.template head<n>() = at.N;
    df.template head<n>() = (J.inverse() * at.dN).transpose() * velocity;
    if constexpr (modes > 0)
    {
      f.template tail<modes>() = mode_values<modes>(xi);
      df.template tail<modes>() = (J.inverse() * mode_gradients<modes>(xi)).transpose() * velocity;
    }
    S += mass * (f * df.transpose() - df * f.transpose());
    const Eigen::Vector<double, n> along = df.template head<n>();
    centrifugal -= mass * along * along.transpose();
    for (Eigen::Index i = 0; i < n; ++i) result.force.template segment<3>(3 * i) += mass * along(i) * velocity;
  }
  Eigen::Matrix<double, 3 * (n + modes), 3 * n> motion; // of the functions f, of unit nodal displacements
  motion.template topRows<3 * n>().setIdentity();
  if constexpr (modes > 0) motion.template bottomRows<3 * modes>() = kinematics.amplitudes;
  result.gyroscopic = motion.transpose() * in_three_directions<n + modes, n + modes>(S) * motion;
  result.centrifugal = in_three_directions<n, n>(centrifugal);
  return result;
}

/// Calls visit.operator()<n, modes>() with the number of nodes and of incompatible modes of a solid.
template <class Visit> auto visit_solid(Shape shape, Visit visit)
{
  switch (shape)
  {
  case Shape::hex8:
    return visit.template operator()<8, 3>();
  case Shape::wedge6:
    return visit.template operator()<6, 4>();
  case Shape::hex20:
    return visit.template operator()<20, 0>();
  case Shape::tet4:
    return visit.template operator()<4, 0>();
  default:
    return visit.template operator()<10, 0>();
  }
}

} // namespace

ElementMatrices solid_matrices(Shape shape, const NodePositions& X, const Material& material)
{
  const Matrix6 D = elasticity(material);
  return visit_solid(shape,
                     [&]<int n, int modes>() -> ElementMatrices
                     {
                       const auto k = kinematics<n, modes>(shape, X, D);
                       return {stiffness_matrix(k.points, D), mass_matrix(shape, X, k, material.density)};
                     });
}

SpinMatrices spin_matrices(Shape shape, std::span<const Vec3> x, const Material& material, const Rotation& rotation)
{
  const Matrix6 D = elasticity(material);
  const NodePositions X = position_matrix(x);
  return visit_solid(shape,
                     [&]<int n, int modes>()
                     {
                       const auto k = kinematics<n, modes>(shape, X, D);
                       return spin<n, modes>(shape, X, k, material.density, rotation);
                     });
}

Eigen::MatrixXd stress_stiffness(Shape shape, std::span<const Vec3> x, const Material& material,
                                 std::span<const double> u)
{
  const NodePositions X = position_matrix(x);
  const std::vector<std::array<double, 6>> stress = solid_stress(shape, x, material, u);
  return visit_solid(shape,
                     [&]<int n, int modes>() -> Eigen::MatrixXd
                     {
                       Eigen::Matrix<double, n, n> S = Eigen::Matrix<double, n, n>::Zero();
                       std::size_t point = 0;
                       for (const auto& [xi, weight, at] : stiffness_rule(shape))
                       {
                         const Eigen::Matrix3d J = at.dN * X.transpose();
                         const Gradients<n> g = J.inverse() * at.dN;
                         const auto& [xx, yy, zz, xy, yz, zx] = stress[point];
                         Eigen::Matrix3d sigma;
                         sigma << xx, xy, zx, xy, yy, yz, zx, yz, zz;
                         S += weight * positive_jacobian(J.determinant(), point++) * g.transpose() * sigma * g;
                       }
                       return in_three_directions<n, n>(S);
                     });
}

std::vector<std::array<double, 6>> solid_stress(Shape shape, std::span<const Vec3> x, const Material& material,
                                                std::span<const double> u)
{
  const Matrix6 D = elasticity(material);
  return visit_solid(shape,
                     [&]<int n, int modes>()
                     {
                       const Eigen::Map<const Eigen::Vector<double, 3 * n>> displacement(u.data());
                       std::vector<std::array<double, 6>> stress;
                       for (const auto& [B, measure] : kinematics<n, modes>(shape, position_matrix(x), D).points)
                       {
                         std::array<double, 6>& s = stress.emplace_back();
                         Eigen::Map<Eigen::Vector<double, 6>>(s.data()) = D * (B * displacement);
                       }
                       return stress;
                     });
}

int dofs_per_node(Shape shape)
{
  return is_shell(shape) ? 6 : 3;
}

ElementMatrices element_matrices(Shape shape, std::span<const Vec3> x, const Material& material, double thickness)
{
  const NodePositions X = position_matrix(x);
  return is_shell(shape) ? shell_matrices(shape, X, material, thickness) : solid_matrices(shape, X, material);
}

} // namespace squeal
