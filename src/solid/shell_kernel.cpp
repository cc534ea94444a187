/// Flat shells: membrane with drilling rotation, and plate,
///     D = diag(h C, G h, h^3/12 C, kappa G h I),
/// with C of plane stress, h the thickness, G the shear modulus and kappa = 5/6 the shear correction.
///
/// Axes: z is normal to both diagonals (to two sides of a triangle). The middle surface is at arms a from the nodes,
/// and a warped quadrilateral's is at +-d from its plane. Rigid links connect them: u_plane = u + r x (a - d z). Rigid
/// motions stay exact. Mass: rho h of the displacements, with sides curved by the rotations of their ends, and rho
/// h^3/12 N_i N_j on all three rotations. The drilling rotation is included, so that M is positive definite and the
/// same in all axes. Caveat: flat elements do not couple membrane and bending, so that curved shells converge with the
/// mesh only.
///
/// The membrane has a rotation about the normal at each node (drilling rotation).
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
///
/// Plate bending with transverse shear is that of the discrete Kirchhoff-Mindlin triangle DKMT and quadrilateral DKMQ
/// (Katili, Int. J. Numer. Methods Eng. 36, 1993, 1859 and 1885). They do not lock when thin, converge to discrete
/// Kirchhoff elements, and pass the patch test.
///
///     beta_x = ry, beta_y = -rx: rotation of the fibre, u = z beta;   beta = sum N_i beta_i + sum_k P_k t_k a_k,
/// with P_k the quadratic bubble of side k, which goes from i to j, has the length L and the direction t. The amplitude
/// a_k follows from equilibrium, gamma_k = -2/3 phi_k a_k with phi_k = 12 D_b / (D_s L^2), and from the mean of
/// w,s + beta_s = gamma_k on the side:
///     a_k = -3 / (2 L (1 + phi_k)) (w_j - w_i + L/2 t . (beta_i + beta_j)).
/// The shear strain is the field with the constant tangential value gamma_k on each side (edge functions).
///
/// Shells with mid-side nodes consist of these two, so that they are as sound when thin. Caveat: their error falls with
/// the square of the length, as that of their facets does.
#include "kernels.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <cmath>

namespace squeal
{

namespace
{

using Matrix9 = Eigen::Matrix<double, 9, 9>;
template <int n> using Square = Eigen::Matrix<double, 6 * n, 6 * n>; // on u v w rx ry rz of each node
constexpr double shear_correction = 5. / 6;

/// Strains of unit nodal displacements of an element with n nodes, in its own axes. Columns: u v w rx ry rz of each
/// node. Rows: membrane exx eyy gxy; drilling strain; curvatures kxx kyy kxy; transverse shear gxz gyz.
template <int n> using ShellStrains = Eigen::Matrix<double, 9, 6 * n>;
template <int n> using PlanePositions = Eigen::Matrix<double, 2, n>; // [m] one node a column
template <int n> using Gradients = Eigen::Matrix<double, 2, n>;

/// Adds the membrane and drilling strains of shell4; `gradients` holds dN/dx, dN/dy [1/m] in its rows.
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

/// Strains of unit amplitudes of the incompatible modes 1 - xi^2 and 1 - eta^2, each in u and v.
using ShellModeStrains = Eigen::Matrix<double, 9, 4>;

/// Returns the strains of the incompatible modes. `mean_inverse` is det(J0)/det(J) J0^-1 [1/m], J0 at the centre.
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

/// Adds the membrane strains of shell3 at the middle of a side: side 0 between nodes 0 and 1, and so on.
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

/// Returns the edge function of side k: its tangential component is 1/L on this side and zero on the others.
template <int n> Eigen::Vector2d edge_function(Eigen::Index k, const NodeValues& N, const Gradients<n>& g)
{
  const auto j = (k + 1) % n;
  if constexpr (n == 3) return N(k) * g.col(j) - N(j) * g.col(k);
  // (N_i + N_j)/2 times the gradient of the natural coordinate that increases from i to j.
  const auto before = (k + 3) % 4, after = (k + 2) % 4;
  return 0.5 * (N(k) + N(j)) * (g.col(j) + g.col(after) - g.col(k) - g.col(before));
}

/// Adds curvatures and transverse shear at xi, n = 3 or 4.
/// `slenderness` is 12 D_b / D_s = 2 h^2 / (kappa (1 - nu)) [m2], h the thickness and kappa the shear correction.
template <int n>
void add_plate(ShellStrains<n>& B, const PlanePositions<n>& X, const Eigen::Vector3d& xi, double slenderness)
{
  const ShapeFunctions at = shape_functions(n == 3 ? Shape::triangle3 : Shape::quad4, xi);
  const ShapeFunctions quadratic = shape_functions(n == 3 ? Shape::triangle6 : Shape::quad8, xi);
  const Eigen::Matrix2d inverse = (at.dN.topRows<2>() * X.transpose()).inverse();
  const Gradients<n> g = inverse * at.dN.topRows<2>();
  const Gradients<n> P = inverse * quadratic.dN.topRows<2>().rightCols(n);
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

/// The plane of an element with n nodes.
template <int n> struct Facet
{
  Eigen::Matrix3d axes;             // [-] rows: unit vectors x, y, z
  PlanePositions<n> plane;          // [m] nodes in x and y about their centre
  Eigen::Matrix<double, 3, n> arms; // [m] from the nodes to their places in the plane, in global axes
};

/// Returns the plane of an element whose middle surface is at these arms from its nodes. Its x is the first side's
/// projection on the plane.
template <int n> Facet<n> make_facet(const NodePositions& nodes, const NodePositions& arms)
{
  const NodePositions X = nodes + arms;
  const Eigen::Vector3d side = X.col(1) - X.col(0);
  const Eigen::Vector3d a = n == 3 ? side : X.col(2) - X.col(0);
  const Eigen::Vector3d b = n == 3 ? X.col(2) - X.col(0) : X.col(3) - X.col(1);
  const Eigen::Vector3d area = a.cross(b), z = area / positive_jacobian(area.norm(), 0);
  const Eigen::Vector3d x = side - side.dot(z) * z;
  Facet<n> facet;
  facet.axes << x.normalized().transpose(), z.cross(x).normalized().transpose(), z.transpose();
  const Eigen::Matrix<double, 3, n> local = facet.axes * (X.colwise() - X.rowwise().mean().eval());
  facet.plane = local.template topRows<2>();
  facet.arms = arms - z * local.row(2);
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
    T.template block<3, 3>(6 * i, 6 * i + 3) = facet.axes.rowwise().cross(-facet.arms.col(i).transpose());
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

template <int n> constexpr Shape shell_shape = n == 3 ? Shape::triangle3 : Shape::quad4;

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
  const NodeValues bubble = shape_functions(n == 3 ? Shape::triangle6 : Shape::quad8, xi).N.tail(n) / 8;
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

/// Nodes of the flat shells that a shape consists of.
std::vector<std::vector<int>> facets_of(Shape shape)
{
  if (shape == Shape::triangle3) return {{0, 1, 2}};
  if (shape == Shape::quad4) return {{0, 1, 2, 3}};
  if (shape == Shape::triangle6) return {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}, {3, 4, 5}};
  if (shape == Shape::quad8) return {{0, 4, 7}, {4, 1, 5}, {5, 2, 6}, {6, 3, 7}, {4, 5, 6}, {4, 6, 7}};
  return {{0, 4, 8, 7}, {4, 1, 5, 8}, {8, 5, 2, 6}, {7, 8, 6, 3}}; // quad9
}

template <int n>
ElementMatrices matrices(const NodePositions& X, const NodePositions& arms, const Material& material, double h)
{
  const Facet<n> facet = make_facet<n>(X, arms);
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

} // namespace

ElementMatrices shell_matrices(Shape shape, const NodePositions& X, const NodePositions& arms, const Material& material,
                               double thickness)
{
  const Eigen::Index dofs = 6 * X.cols();
  ElementMatrices sum{Eigen::MatrixXd::Zero(dofs, dofs), Eigen::MatrixXd::Zero(dofs, dofs)};
  for (const std::vector<int>& nodes : facets_of(shape))
  {
    const auto of = nodes.size() == 3 ? matrices<3> : matrices<4>;
    const auto [K, M] = of(X(Eigen::all, nodes), arms(Eigen::all, nodes), material, thickness);
    std::vector<int> rows;
    for (const int node : nodes)
      for (int c = 0; c < 6; ++c) rows.push_back(6 * node + c);
    sum.stiffness(rows, rows) += K;
    sum.mass(rows, rows) += M;
  }
  return sum;
}

} // namespace squeal
