/// Flat shells: membrane with drilling rotation (shell_membrane.cpp) and plate (shell_plate.cpp) in the element's
/// plane,
///     D = diag(h C, G h, h^3/12 C, kappa G h I),
/// with C of plane stress, h the thickness, G the shear modulus and kappa = 5/6 the shear correction.
///
/// Axes: z is normal to both diagonals (to two sides of a triangle). The nodes of a warped quadrilateral are at +-d
/// from its plane and connected to it by rigid links: u_plane = u + r x (-d z). Rigid motions stay exact. Mass: rho h
/// of the displacements, with sides curved by the rotations of their ends, and rho h^3/12 N_i N_j on all three
/// rotations. The drilling rotation is included, so that M is positive definite and the same in all axes. Caveat: flat
/// elements do not couple membrane and bending, so that curved shells converge with the mesh only.
#include "shell_kernel.hpp"

#include "condensation.hpp"
#include "jacobian.hpp"
#include "shell_membrane.hpp"
#include "shell_plate.hpp"
#include "squeal/mesh/quadrature.hpp"

#include <stdexcept>

namespace squeal
{

namespace
{

using Matrix9 = Eigen::Matrix<double, 9, 9>;
template <int n> using Square = Eigen::Matrix<double, 6 * n, 6 * n>; // on u v w rx ry rz of each node
constexpr double shear_correction = 5. / 6;

/// The plane of an element with n nodes.
template <int n> struct Facet
{
  Eigen::Matrix3d axes;            // [-] rows: unit vectors x, y, z
  PlanePositions<n> plane;         // [m] nodes in x and y about their centre
  Eigen::Vector<double, n> offset; // [m] nodes along z from the plane
};

/// Returns the plane of an element; its x is the projection of `direction` (of any length) on the plane.
template <int n> Facet<n> make_facet(const NodePositions& X, const Eigen::Vector3d& direction)
{
  const Eigen::Vector3d a = n == 3 ? X.col(1) - X.col(0) : X.col(2) - X.col(0);
  const Eigen::Vector3d b = n == 3 ? X.col(2) - X.col(0) : X.col(3) - X.col(1);
  const Eigen::Vector3d area = a.cross(b), z = area / positive_jacobian(area.norm(), 0);
  const Eigen::Vector3d x = direction - direction.dot(z) * z;
  if (!(x.norm() > 1e-6 * direction.norm()))
    throw std::runtime_error("the axis of the shell's resultants is normal to the element; give one along the surface");
  Facet<n> facet;
  facet.axes << x.normalized().transpose(), z.cross(x).normalized().transpose(), z.transpose();
  const Eigen::Matrix<double, 3, n> local = facet.axes * (X.colwise() - X.rowwise().mean().eval());
  facet.plane = local.template topRows<2>();
  facet.offset = local.row(2).transpose();
  return facet;
}

/// Returns T of u_local = T u: displacements at the plane in local axes, from those of the nodes in global axes.
template <int n> Square<n> local_transformation(const Facet<n>& facet)
{
  Square<n> T = Square<n>::Zero();
  for (Eigen::Index i = 0; i < n; ++i)
  {
    T.template block<3, 3>(6 * i, 6 * i) = facet.axes;
    T.template block<3, 3>(6 * i + 3, 6 * i + 3) = facet.axes;
    T.template block<1, 3>(6 * i, 6 * i + 3) = -facet.offset(i) * facet.axes.row(1);
    T.template block<1, 3>(6 * i + 1, 6 * i + 3) = facet.offset(i) * facet.axes.row(0);
  }
  return T;
}

Matrix9 elasticity(const Material& material, double h)
{
  const double nu = material.poisson, G = material.young / (2 * (1 + nu));
  Eigen::Matrix3d C;
  C << 1, nu, 0, nu, 1, 0, 0, 0, 0.5 * (1 - nu);
  C *= material.young / (1 - nu * nu);
  Matrix9 D = Matrix9::Zero();
  D.topLeftCorner<3, 3>() = h * C;
  D(3, 3) = G * h;
  D.block<3, 3>(4, 4) = h * h * h / 12 * C;
  D(7, 7) = D(8, 8) = shear_correction * G * h;
  return D;
}

template <int n> constexpr Shape shell_shape = n == 3 ? Shape::shell3 : Shape::shell4;

template <int n> Eigen::Matrix2d jacobian(const ShapeFunctions& at, const PlanePositions<n>& X)
{
  return at.dN.topRows<2>() * X.transpose();
}

/// Returns the strain operators at the points of the stiffness rule.
template <int n>
std::vector<StrainPoint<ShellStrains<n>>> strain_points(const PlanePositions<n>& X, const Material& material, double h)
{
  const double slenderness = 2 * h * h / (shear_correction * (1 - material.poisson));
  const Eigen::Matrix2d J0 = jacobian<n>(shape_functions(shell_shape<n>, Eigen::Vector3d::Zero()), X);
  std::vector<StrainPoint<ShellStrains<n>>> points;
  std::vector<ShellModeStrains> modes;
  for (const auto& [xi, weight, at] : stiffness_rule(shell_shape<n>))
  {
    const int p = static_cast<int>(points.size());
    const Eigen::Matrix2d J = jacobian<n>(at, X);
    const double determinant = positive_jacobian(J.determinant(), p);
    ShellStrains<n>& B =
        points.emplace_back(StrainPoint<ShellStrains<n>>{ShellStrains<n>::Zero(), determinant * weight}).B;
    add_plate<n>(B, X, xi, slenderness);
    if constexpr (n == 3)
      add_triangle_membrane(B, X, material.poisson, p);
    else
    {
      add_quad_membrane(B, at.N, J.inverse() * at.dN.template topRows<2>());
      modes.push_back(quad_membrane_modes(xi, J0.determinant() / determinant * J0.inverse()));
    }
  }
  if constexpr (n == 4) condense_parameters(points, modes, elasticity(material, h));
  return points;
}

/// Returns the displacements of the plane's points of unit nodal displacements. The rotations r of its ends curve a
/// side along t by u' = r x t. With the linear field alone the frequency of a bent element is wrong by (k L)^2 / 12.
template <int n>
Eigen::Matrix<double, 3, 6 * n> plane_displacements(const PlanePositions<n>& X, const Eigen::Vector3d& xi)
{
  const NodeValues N = shape_functions(shell_shape<n>, xi).N;
  const NodeValues bubble = shape_functions(n == 3 ? FaceShape::triangle6 : FaceShape::quad8, xi).N.tail(n) / 8;
  Eigen::Matrix<double, 3, 6 * n> U = Eigen::Matrix<double, 3, 6 * n>::Zero();
  for (Eigen::Index i = 0; i < n; ++i)
  {
    const auto j = (i + 1) % n;
    const double x = X(0, j) - X(0, i), y = X(1, j) - X(1, i);
    Eigen::Matrix3d side; // cross product of the side with a rotation
    side << 0, 0, y, /**/ 0, 0, -x, /**/ -y, x, 0;
    U.template block<3, 3>(0, 6 * i).diagonal().array() += N(i);
    U.template block<3, 3>(0, 6 * i + 3) -= bubble(i) * side;
    U.template block<3, 3>(0, 6 * j + 3) += bubble(i) * side;
  }
  return U;
}

template <int n> Square<n> plane_mass(const PlanePositions<n>& X, double density, double h)
{
  Square<n> M = Square<n>::Zero();
  for (const auto& [xi, weight, at] : mass_rule(shell_shape<n>))
  {
    const double mass = density * h * weight * jacobian<n>(at, X).determinant();
    const auto U = plane_displacements<n>(X, xi);
    M += mass * U.transpose() * U;
    for (Eigen::Index i = 0; i < n; ++i)
      for (Eigen::Index j = 0; j < n; ++j)
        M.template block<3, 3>(6 * i + 3, 6 * j + 3).diagonal().array() += mass * h * h / 12 * at.N(i) * at.N(j);
  }
  return M;
}

template <int n> ElementMatrices matrices(const NodePositions& X, const Material& material, double h)
{
  const Facet<n> facet = make_facet<n>(X, X.col(1) - X.col(0));
  const Square<n> T = local_transformation(facet);
  const auto in_global_axes = [&](const Square<n>& A) -> Eigen::MatrixXd
  {
    const Square<n> B = T.transpose() * A * T;
    return 0.5 * (B + B.transpose());
  };
  const auto points = strain_points<n>(facet.plane, material, h);
  return {in_global_axes(stiffness_matrix(points, elasticity(material, h))),
          in_global_axes(plane_mass<n>(facet.plane, material.density, h))};
}

template <int n> std::vector<std::array<double, 6>> resultants(const Facet<n>& facet, const Material& material,
                                                               double h, std::span<const double> u)
{
  const Eigen::Map<const Eigen::Vector<double, 6 * n>> displacement(u.data());
  const Eigen::Vector<double, 6 * n> local = local_transformation(facet) * displacement;
  std::vector<std::array<double, 6>> result;
  for (const auto& [B, area] : strain_points<n>(facet.plane, material, h))
  {
    const Eigen::Vector<double, 9> r = elasticity(material, h) * (B * local);
    result.push_back({r(0), r(1), r(2), r(4), r(5), r(6)});
  }
  return result;
}

} // namespace

ElementMatrices shell_matrices(Shape shape, const NodePositions& X, const Material& material, double thickness)
{
  return shape == Shape::shell3 ? matrices<3>(X, material, thickness) : matrices<4>(X, material, thickness);
}

std::vector<std::array<double, 6>> shell_resultants(Shape shape, std::span<const Vec3> x, const Material& material,
                                                    double thickness, const Vec3& axis1, std::span<const double> u)
{
  const NodePositions X = position_matrix(x);
  const Eigen::Vector3d direction(axis1.data());
  return shape == Shape::shell3 ? resultants<3>(make_facet<3>(X, direction), material, thickness, u)
                                : resultants<4>(make_facet<4>(X, direction), material, thickness, u);
}

} // namespace squeal
