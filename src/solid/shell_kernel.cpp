/// Flat shells: membrane with drilling (shell_membrane.cpp) and plate (shell_plate.cpp), side by side in the element's
/// plane, D = diag(h C, G h, h^3/12 C, kappa G h I), kappa = 5/6, C plane stress.
///
/// Frame: z along the product of the diagonals (of two sides of a triangle). The nodes of a warped quadrilateral stand
/// off its plane by +-d and carry it on rigid arms: u_plane = u + r x (-d z); rigid motions stay exact.
/// Mass: rho h of the displacements, sides bowed by the rotations of their ends, and rho h^3/12 N_i N_j on all three
/// rotations, the drilling one too, so that M is positive definite and the same in every frame.
/// Caveat: facets carry no coupling of membrane and bending within an element: curved shells converge with the mesh.
#include "condensation.hpp"
#include "kernels.hpp"
#include "shell_strains.hpp"
#include "squeal/mesh/quadrature.hpp"

#include <stdexcept>

namespace squeal
{

namespace
{

using Matrix9 = Eigen::Matrix<double, 9, 9>;
constexpr double shear_correction = 5. / 6;

/// Where the element lies: rows of `axes` are its x, y, z; nodes at `plane` + `offset` z about their centre.
struct Facet
{
  Eigen::Matrix3d axes;
  PlanePositions plane;   // [m]
  Eigen::Vector4d offset; // [m]
};

/// `along` [any length], projected on the element, gives its x.
Facet facet(const NodePositions& X, const Eigen::Vector3d& along)
{
  const auto nodes = X.cols();
  const Eigen::Vector3d one = nodes == 3 ? X.col(1) - X.col(0) : X.col(2) - X.col(0);
  const Eigen::Vector3d other = nodes == 3 ? X.col(2) - X.col(0) : X.col(3) - X.col(1);
  const Eigen::Vector3d area = one.cross(other), z = area / positive(area.norm(), 0);
  const Eigen::Vector3d x = along - along.dot(z) * z;
  if (!(x.norm() > 1e-6 * along.norm()))
    throw std::runtime_error("the axis of the shell's resultants is normal to the element; give one along the surface");
  Facet f;
  f.axes << x.normalized().transpose(), z.cross(x).normalized().transpose(), z.transpose();
  const NodePositions local = f.axes * (X.colwise() - X.rowwise().mean().eval());
  f.plane = local.topRows<2>();
  f.offset.head(nodes) = local.row(2).transpose();
  return f;
}

/// Local displacements (six a node, at the plane) of global ones (at the nodes).
Eigen::MatrixXd to_plane(const Facet& f)
{
  const auto nodes = f.plane.cols();
  Eigen::MatrixXd T = Eigen::MatrixXd::Zero(6 * nodes, 6 * nodes);
  for (Eigen::Index i = 0; i < nodes; ++i)
  {
    T.block<3, 3>(6 * i, 6 * i) = f.axes;
    T.block<3, 3>(6 * i + 3, 6 * i + 3) = f.axes;
    T.block<1, 3>(6 * i, 6 * i + 3) = -f.offset(i) * f.axes.row(1);
    T.block<1, 3>(6 * i + 1, 6 * i + 3) = f.offset(i) * f.axes.row(0);
  }
  return T;
}

Matrix9 elasticity(const Material& material, double h)
{
  const double nu = material.poisson, G = material.young / (2 * (1 + nu));
  Eigen::Matrix3d C;
  C << 1, nu, 0, nu, 1, 0, 0, 0, .5 * (1 - nu);
  C *= material.young / (1 - nu * nu);
  Matrix9 D = Matrix9::Zero();
  D.topLeftCorner<3, 3>() = h * C;
  D(3, 3) = G * h;
  D.block<3, 3>(4, 4) = h * h * h / 12 * C;
  D(7, 7) = D(8, 8) = shear_correction * G * h;
  return D;
}

std::vector<StrainPoint<ShellStrains>> strain_points(Shape shape, const PlanePositions& X, const Material& material,
                                                     double h)
{
  const Quadrature& rule = stiffness_rule(shape);
  const bool quad = shape == Shape::shell4;
  const double slenderness = 2 * h * h / (shear_correction * (1 - material.poisson));
  const auto jacobian = [&](const ShapeFunctions& at) { return Eigen::Matrix2d(at.dN.topRows<2>() * X.transpose()); };
  const Eigen::Matrix2d J0 = jacobian(shape_functions(shape, Eigen::Vector3d::Zero()));
  std::vector<StrainPoint<ShellStrains>> points(rule.size());
  std::vector<ShellStrains> modes(quad ? rule.size() : 0);
  for (std::size_t p = 0; p < rule.size(); ++p)
  {
    const ShapeFunctions& at = rule[p].at;
    const Eigen::Matrix2d J = jacobian(at);
    const double determinant = positive(J.determinant(), p);
    points[p] = {ShellStrains::Zero(9, 6 * X.cols()), determinant * rule[p].weight};
    add_plate(points[p].B, X, rule[p].xi, slenderness);
    if (quad)
    {
      add_quad_membrane(points[p].B, at.N, J.inverse() * at.dN.topRows<2>());
      modes[p] = quad_membrane_modes(rule[p].xi, J0.determinant() / determinant * J0.inverse());
    }
    else
      add_triangle_membrane(points[p].B, X, material.poisson, p);
  }
  if (quad) condense(points, modes, elasticity(material, h));
  return points;
}

/// Displacement of the plane's points: sides bow as the rotations of their ends ask, u' = r x t, so that a curved
/// element's mass is as accurate as its stiffness (the linear field alone is out by (k L)^2 / 12 in frequency).
BoundedMatrix<3, 24> displacement(Shape shape, const PlanePositions& X, const Eigen::Vector3d& xi)
{
  const auto nodes = X.cols();
  const NodeValues N = shape_functions(shape, xi).N;
  const NodeValues bow = shape_functions(nodes == 3 ? FaceShape::triangle6 : FaceShape::quad8, xi).N.tail(nodes) / 8;
  BoundedMatrix<3, 24> U = BoundedMatrix<3, 24>::Zero(3, 6 * nodes);
  for (Eigen::Index i = 0; i < nodes; ++i)
  {
    const auto j = (i + 1) % nodes;
    const double x = X(0, j) - X(0, i), y = X(1, j) - X(1, i);
    Eigen::Matrix3d side; // side x rotation
    side << 0, 0, y, /**/ 0, 0, -x, /**/ -y, x, 0;
    U.block<3, 3>(0, 6 * i).diagonal().array() += N(i);
    U.block<3, 3>(0, 6 * i + 3) -= bow(i) * side;
    U.block<3, 3>(0, 6 * j + 3) += bow(i) * side;
  }
  return U;
}

Eigen::MatrixXd plane_mass(Shape shape, const PlanePositions& X, double density, double h)
{
  const auto nodes = X.cols();
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(6 * nodes, 6 * nodes);
  for (const auto& [xi, weight, at] : mass_rule(shape))
  {
    const double mass = density * h * weight * Eigen::Matrix2d(at.dN.topRows<2>() * X.transpose()).determinant();
    const BoundedMatrix<3, 24> U = displacement(shape, X, xi);
    M += mass * U.transpose() * U;
    for (Eigen::Index i = 0; i < nodes; ++i)
      for (Eigen::Index j = 0; j < nodes; ++j)
        M.block<3, 3>(6 * i + 3, 6 * j + 3).diagonal().array() += mass * h * h / 12 * at.N(i) * at.N(j);
  }
  return M;
}

} // namespace

ElementMatrices shell_matrices(Shape shape, const NodePositions& X, const Material& material, double thickness)
{
  const Facet f = facet(X, X.col(1) - X.col(0));
  const Eigen::MatrixXd T = to_plane(f);
  const auto in_space = [&](const Eigen::MatrixXd& A) -> Eigen::MatrixXd
  {
    const Eigen::MatrixXd B = T.transpose() * A * T;
    return .5 * (B + B.transpose());
  };
  const auto points = strain_points(shape, f.plane, material, thickness);
  return {entries(in_space(stiffness_of(points, elasticity(material, thickness)))),
          entries(in_space(plane_mass(shape, f.plane, material.density, thickness)))};
}

std::vector<std::array<double, 6>> shell_resultants(Shape shape, std::span<const Vec3> x, const Material& material,
                                                    double thickness, const Vec3& axis1, std::span<const double> u)
{
  const Facet f = facet(position_matrix(x), Eigen::Vector3d(axis1[0], axis1[1], axis1[2]));
  const Matrix9 D = elasticity(material, thickness);
  const Eigen::Map<const Eigen::VectorXd> displacement(u.data(), static_cast<Eigen::Index>(u.size()));
  const Eigen::VectorXd local = to_plane(f) * displacement;
  std::vector<std::array<double, 6>> resultants;
  for (const auto& point : strain_points(shape, f.plane, material, thickness))
  {
    const Eigen::Matrix<double, 9, 1> r = D * (point.B * local);
    resultants.push_back({r(0), r(1), r(2), r(4), r(5), r(6)});
  }
  return resultants;
}

} // namespace squeal
