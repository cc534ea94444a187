// ranks: 1
// Orthotropic solids: constant strain, a bar pulled off its axes, and a simply supported plate, against exact answers.
#include "small_fem.hpp"

#include <numbers>
#include <string>

using namespace squeal;
using namespace small_fem;

namespace
{

constexpr double pi = std::numbers::pi;

const std::vector<std::pair<std::string, Shape>> solids = {{"hex8", Shape::hex8},
                                                           {"wedge6", Shape::wedge6},
                                                           {"hex20", Shape::hex20},
                                                           {"tet10", Shape::tet10},
                                                           {"tet4", Shape::tet4}};

/// A lining: stiff in its plane, soft through its thickness. The axes are turned by an angle about z.
Material lining(double angle)
{
  Orthotropy o{{12e9, 8e9, 2e9}, {0.25, 0.3, 0.35}, {3e9, 1.5e9, 1e9}, {}, {}};
  o.axis_1 = {std::cos(angle), std::sin(angle), 0};
  o.axis_2 = {-std::sin(angle), std::cos(angle), 0};
  return {0, 0, 2000, o};
}

using Matrix3 = Eigen::Matrix3d;

/// The stress of a strain by the tensor law sum of R_pi R_qj R_rk R_sl c_pqrs e_kl, with c along the axes of R's rows.
Matrix3 stress_of(const Orthotropy& o, const Matrix3& strain)
{
  Matrix3 R;
  const Vec3 third = cross(o.axis_1, o.axis_2);
  for (int k = 0; k < 3; ++k) R(0, k) = o.axis_1[k], R(1, k) = o.axis_2[k], R(2, k) = third[k];
  const Matrix3 e = R * strain * R.transpose();
  Matrix3 compliance; // of direct stresses
  const auto &E = o.young, &nu = o.poisson;
  compliance << 1 / E[0], -nu[0] / E[0], -nu[1] / E[0], -nu[0] / E[0], 1 / E[1], -nu[2] / E[1], -nu[1] / E[0],
      -nu[2] / E[1], 1 / E[2];
  const Eigen::Vector3d direct = compliance.inverse() * e.diagonal();
  Matrix3 s = direct.asDiagonal();
  s(0, 1) = s(1, 0) = 2 * o.shear[0] * e(0, 1);
  s(0, 2) = s(2, 0) = 2 * o.shear[1] * e(0, 2);
  s(1, 2) = s(2, 1) = 2 * o.shear[2] * e(1, 2);
  return R.transpose() * s * R;
}

bool on_face(const Vec3& x)
{
  return std::any_of(x.begin(), x.end(), [](double s) { return std::abs(s) < 1e-12 || std::abs(s - 1) < 1e-12; });
}

small_fem::Mesh cube(Shape shape)
{
  const auto bend = [](double s, double by) { return s + by * s * (1 - s); };
  const small_fem::Mesh skew =
      bricks({2, 2, 2},
             [&](double x, double y, double z) {
               return Vec3{bend(x, 0.3 * y - 0.2 * z), bend(y, 0.25 * z + 0.2 * x), bend(z, 0.3 * x)};
             });
  return in_shape(skew, shape);
}

} // namespace

TEST_CASE("a constant strain gives the stress of the tensor law in every solid shape, whatever the axes")
{
  Material material = lining(0);
  const Eigen::Vector3d a = Eigen::Vector3d(1, 2, -0.5).normalized(), b = a.unitOrthogonal();
  material.orthotropy->axis_1 = {a(0), a(1), a(2)};
  material.orthotropy->axis_2 = {b(0), b(1), b(2)};
  Matrix3 gradient;
  gradient << 3e-4, 1e-4, -2e-4, 0.5e-4, -1e-4, 4e-4, 2e-4, -3e-4, 2e-4;
  const Matrix3 stress = stress_of(*material.orthotropy, (gradient + gradient.transpose()) / 2);
  for (const auto& [name, shape] : solids)
  {
    CAPTURE(name);
    const small_fem::Mesh mesh = cube(shape);
    Prescribed prescribed;
    const auto exact = [&](int node) { return Eigen::Vector3d(gradient * Eigen::Vector3d(mesh.x[node].data())); };
    for (int node = 0; node < static_cast<int>(mesh.x.size()); ++node)
      for (int k = 0; k < 3; ++k)
        if (on_face(mesh.x[node])) prescribed[3 * node + k] = exact(node)(k);
    const auto K = assemble({mesh, material, 0}).K;
    const Eigen::VectorXd u = solve(K, Eigen::VectorXd::Zero(K.rows()), prescribed);
    for (const auto& element : mesh.elements)
    {
      std::vector<double> ue;
      for (int node : element)
        for (int k = 0; k < 3; ++k) ue.push_back(u(3 * node + k));
      for (const auto& s : solid_stress(shape, positions(mesh, element), material, ue))
      {
        const std::array<double, 6> expected = {stress(0, 0), stress(1, 1), stress(2, 2),
                                                stress(0, 1), stress(1, 2), stress(2, 0)};
        for (int k = 0; k < 6; ++k) CHECK(std::abs(s[k] - expected[k]) < 1e-10 * stress.norm()); // a small solve
      }
    }
  }
}

TEST_CASE("equal constants in all directions are those of the isotropic law")
{
  Material same = lining(0.7);
  same.orthotropy->young = {5e9, 5e9, 5e9};
  same.orthotropy->poisson = {0.3, 0.3, 0.3};
  same.orthotropy->shear = {5e9 / 2.6, 5e9 / 2.6, 5e9 / 2.6};
  for (const auto& [name, shape] : solids)
  {
    const small_fem::Mesh mesh = cube(shape);
    const auto x = positions(mesh, mesh.elements[0]);
    const auto a = element_matrices(shape, x, same, 0), b = element_matrices(shape, x, {5e9, 0.3, 2000}, 0);
    CHECK((a.stiffness - b.stiffness).norm() < 1e-13 * b.stiffness.norm());
    CHECK((a.mass - b.mass).norm() < 1e-13 * b.mass.norm());
  }
}

TEST_CASE("a bar pulled at an angle to its axes has the off-axis modulus")
{
  // 1/E_x = c^4/E1 + s^4/E2 + s^2 c^2 (1/G12 - 2 nu12/E1), and it shears too
  for (const double angle : {0., 0.4, 1.1, pi / 2})
    for (const Shape shape : {Shape::hex8, Shape::hex20})
    {
      CAPTURE(angle);
      const double length = 3, pull = 1e6;
      const small_fem::Mesh mesh = in_shape(bricks({3, 2, 2},
                                                   [&](double x, double y, double z) {
                                                     return Vec3{length * x, y, z};
                                                   }),
                                            shape);
      const Material material = lining(angle);
      const auto K = assemble({mesh, material, 0}).K;
      Eigen::VectorXd load = Eigen::VectorXd::Zero(K.rows());
      const bool quadratic = shape == Shape::hex20;
      const std::vector<int> right = {1, 2, 6, 5, 11, 14, 18, 12}, left = {0, 4, 7, 3, 10, 17, 15, 9};
      for (const auto& element : mesh.elements)
        for (const auto& [nodes, at] : {std::pair{right, length}, {left, 0.}})
        {
          std::vector<Vec3> face;
          for (std::size_t i = 0; i < (quadratic ? 8u : 4u); ++i)
            face.push_back(mesh.x[element[static_cast<std::size_t>(nodes[i])]]);
          if (std::abs(face[0][0] - at) > 1e-9 || std::abs(face[2][0] - at) > 1e-9) continue;
          const auto weights = face_weights(quadratic ? Shape::quad8 : Shape::quad4, face);
          const double out = at > 0 ? 1 : -1, sense = (weights[0][0] + weights[1][0] + weights[2][0] + weights[3][0] +
                                                       (quadratic ? 4 * weights[4][0] : 0)) > 0
                                                          ? 1
                                                          : -1;
          for (std::size_t i = 0; i < face.size(); ++i)
            load(3 * element[static_cast<std::size_t>(nodes[i])]) += pull * out * sense * weights[i][0];
        }
      Prescribed held;
      for (int node = 0; node < static_cast<int>(mesh.x.size()); ++node)
      {
        const Vec3& x = mesh.x[node];
        if (x == Vec3{0, 0, 0}) held[3 * node] = held[3 * node + 1] = held[3 * node + 2] = 0;
        if (x == Vec3{length, 0, 0}) held[3 * node + 1] = held[3 * node + 2] = 0;
        if (x == Vec3{0, 1, 0}) held[3 * node + 2] = 0;
      }
      const Eigen::VectorXd u = solve(K, load, held);
      const double c = std::cos(angle), s = std::sin(angle);
      const auto& o = *material.orthotropy;
      const double flexibility = std::pow(c, 4) / o.young[0] + std::pow(s, 4) / o.young[1] +
                                 s * s * c * c * (1 / o.shear[0] - 2 * o.poisson[0] / o.young[0]);
      for (int node = 0; node < static_cast<int>(mesh.x.size()); ++node)
        if (mesh.x[node] == Vec3{length, 0, 0})
          CHECK(u(3 * node) == approx(pull * length * flexibility, 1e-10)); // rounding of a small solve
    }
}

TEST_CASE("a simply supported plate tends to Kirchhoff's orthotropic frequency with the square of its thickness")
{
  // (2 pi f)^2 rho h = (pi/a)^4 [D1 + 2 (D12 + 2 D66) + D2]; shear and rotary inertia are of the order of (h/a)^2
  const Material material = lining(0);
  const auto& o = *material.orthotropy;
  const double a = 1, nu21 = o.poisson[0] * o.young[1] / o.young[0], part = 1 / (1 - o.poisson[0] * nu21);
  std::vector<double> errors;
  for (const double h : {0.08, 0.04})
  {
    const small_fem::Mesh mesh = in_shape(bricks({10, 10, 1},
                                                 [&](double x, double y, double z) {
                                                   return Vec3{a * x, a * y, h * z};
                                                 }),
                                          Shape::hex20);
    Prescribed held;
    for (int node = 0; node < static_cast<int>(mesh.x.size()); ++node)
      for (int k = 0; k < 2; ++k)
        if (const double at = mesh.x[node][k]; std::abs(at) < 1e-12 || std::abs(at - a) < 1e-12)
          held[3 * node + 1 - k] = held[3 * node + 2] = 0;
    const double f = frequencies(assemble({mesh, material, 0}), held, 1, 1e6)[0];
    const double cube = h * h * h / 12,
                 D = (o.young[0] + o.young[1] + 2 * o.poisson[0] * o.young[1]) * part + 4 * o.shear[0];
    const double exact = std::sqrt(std::pow(pi / a, 4) * D * cube / (material.density * h)) / (2 * pi);
    errors.push_back(1 - f / exact);
  }
  CHECK(errors[0] > 0); // shear lowers it
  CHECK(errors[1] < 0.03);
  CHECK(errors[0] / errors[1] == approx(4, 0.1)); // what is of the fourth order, and the mesh, below a tenth
}
