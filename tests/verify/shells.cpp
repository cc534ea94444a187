// ranks: 1
/// Shell elements against exact and published answers. Sources: MacNeal and Harder 1985 (patch test, twisted beam);
/// Scordelis and Lo 1964; Lindberg, Olson, Cowper 1969 (pinched cylinder).
#include "small_fem.hpp"

#include <doctest/doctest.h>
#include <string>

using namespace squeal;
using namespace small_fem;

namespace
{

const std::vector<std::pair<std::string, Shape>> shapes = {{"shell4", Shape::quad4},
                                                           {"shell3", Shape::triangle3},
                                                           {"shell6", Shape::triangle6},
                                                           {"shell8", Shape::quad8},
                                                           {"shell9", Shape::quad9}};

Eigen::Matrix3d turn(double about_z, double about_x)
{
  return (Eigen::AngleAxisd(about_z, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(about_x, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

Eigen::Vector3d vector(const Vec3& x)
{
  return {x[0], x[1], x[2]};
}

using Motion = Eigen::Matrix<double, 6, 1>; // translations and rotations of a node, or resultants

/// MacNeal and Harder's plate of 5 skew quadrilaterals, z = 0.
small_fem::Mesh patch_of_quads()
{
  small_fem::Mesh mesh{Shape::quad4, {}, {}};
  mesh.x = {{0, 0, 0},       {0.24, 0, 0},    {0.24, 0.12, 0}, {0, 0.12, 0},
            {0.04, 0.02, 0}, {0.18, 0.03, 0}, {0.16, 0.08, 0}, {0.08, 0.08, 0}};
  mesh.elements = {{4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};
  return mesh;
}

/// The field is prescribed on the edges of the turned plate; inner nodes must follow it, with the energy of the
/// resultants.
void check_patch(Shape shape, const Eigen::Matrix3d& R, const std::function<Motion(double, double)>& field,
                 const Motion& resultants)
{
  small_fem::Mesh mesh = in_shape(patch_of_quads(), shape);
  Eigen::VectorXd exact(6 * Eigen::Index(mesh.x.size()));
  Prescribed prescribed;
  for (std::size_t node = 0; node < mesh.x.size(); ++node)
  {
    const bool on_edge = std::min(mesh.x[node][0], mesh.x[node][1]) < 1e-12 || mesh.x[node][0] > 0.24 - 1e-12 ||
                         mesh.x[node][1] > 0.12 - 1e-12;
    const Motion m = field(mesh.x[node][0], mesh.x[node][1]);
    exact.segment<6>(6 * Eigen::Index(node)) << R * m.head<3>(), R * m.tail<3>();
    Eigen::Map<Eigen::Vector3d>(mesh.x[node].data()) = R * vector(mesh.x[node]);
    for (int dof = 6 * int(node); on_edge && dof < 6 * int(node) + 6; ++dof) prescribed[dof] = exact(dof);
  }
  const Material material{1e6, 0.25, 1};
  const auto K = assemble({mesh, material, 0.001}).K;
  const Eigen::VectorXd u = solve(K, Eigen::VectorXd::Zero(K.rows()), prescribed);
  CHECK((u - exact).cwiseAbs().maxCoeff() < 1e-9 * exact.cwiseAbs().maxCoeff());
  Eigen::Matrix3d C; // of plane stress
  C << 1, 0.25, 0, 0.25, 1, 0, 0, 0, 0.375;
  C *= material.young / (1 - 0.25 * 0.25);
  const Eigen::Vector3d N = resultants.head<3>(), M = resultants.tail<3>();
  const double h = 0.001, area = 0.24 * 0.12;
  const double energy = area * (N.dot(C.inverse() * N) / h + 12 / (h * h * h) * M.dot(C.inverse() * M)); // twice
  CHECK(std::abs(u.dot(K * u) - energy) < 1e-9 * energy);
}

} // namespace

TEST_CASE("a constant membrane strain or curvature is reproduced on a skew mesh, turned any way in space")
{
  const std::vector<Eigen::Matrix3d> turns = {Eigen::Matrix3d::Identity(), turn(0.7, 1.1), turn(-2.5, 1.9)};
  for (const auto& [name, shape] : shapes)
    for (std::size_t t = 0; t < turns.size(); ++t)
    {
      CAPTURE(name);
      CAPTURE(t);
      Motion forces, moments;
      forces << 1.33333333333333, 1.33333333333333, 0.4, 0, 0, 0; // stress times thickness
      check_patch(
          shape, turns[t],
          [](double x, double y)
          {
            Motion m;
            m << 1e-3 * (x + y / 2), 1e-3 * (y + x / 2), 0, 0, 0, 0;
            return m;
          },
          forces);
      // moments are int z stress dz, so that w,xx > 0 presses the upper side: negative
      moments << 0, 0, 0, -1.11111111111111e-7, -1.11111111111111e-7, -3.33333333333333e-8;
      check_patch(
          shape, turns[t],
          [](double x, double y)
          {
            Motion m;
            m << 0, 0, 5e-4 * (x * x + x * y + y * y), 5e-4 * (x + 2 * y), -5e-4 * (2 * x + y), 0;
            return m;
          },
          moments);
    }
}

TEST_CASE("an unsupported shell, flat or warped, has six zero frequencies and no other")
{
  for (const auto& [name, shape] : shapes)
    for (const double warp : {0., 0.2})
    {
      CAPTURE(name);
      CAPTURE(warp);
      const auto bent = quads(1, 1,
                              [&](double x, double y) {
                                return Vec3{x + 0.3 * y, y - 0.2 * x * y, warp * x * y};
                              });
      for (const auto& mesh : {in_shape(bent, shape), in_shape(patch_of_quads(), shape)})
      {
        // thick enough that the dense solver's rounding, 1e-16 of the highest w^2, stays below the bar
        const auto system = assemble({mesh, {210e9, 0.3, 7850}, 0.05});
        const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> pairs{Eigen::MatrixXd(system.K),
                                                                              Eigen::MatrixXd(system.M)};
        const auto& values = pairs.eigenvalues();
        CHECK(pairs.info() == Eigen::Success); // M is positive definite
        CHECK(values.head(6).cwiseAbs().maxCoeff() < 1e-8 * values(6));
      }
    }
}

TEST_CASE("a flat shell's mass is that of its volume, and its inertia about any axis is exact but for the drilling")
{
  const Eigen::Matrix3d R = turn(0.4, -1.3);
  for (const auto& [name, shape] : shapes)
  {
    CAPTURE(name);
    const double a = 2, b = 3, h = 0.2, density = 7850;
    auto mesh = shells(shape, 2, 2, [&](double x, double y) { return Vec3{a * (x - 0.5), b * (y - 0.5), 0}; });
    for (auto& x : mesh.x) Eigen::Map<Eigen::Vector3d>(x.data()) = R * vector(x);
    const auto M = assemble({mesh, {1, 0.3, density}, h}).M;
    const auto energy = [&](const Eigen::Vector3d& shift, const Eigen::Vector3d& spin)
    {
      Eigen::VectorXd v(M.rows());
      for (std::size_t i = 0; i < mesh.x.size(); ++i)
        v.segment<6>(6 * Eigen::Index(i)) << shift + spin.cross(vector(mesh.x[i])), spin;
      return v.dot(M * v);
    };
    const double mass = density * a * b * h;
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
    CHECK(energy(R.col(1), zero) == approx(mass, 1e-12));
    CHECK(energy(zero, R.col(0)) == approx(mass * (b * b + h * h) / 12, 1e-12));
    // about the normal the nodes' own inertia adds mass h^2 / 12 to the exact mass (a^2 + b^2) / 12
    CHECK(energy(zero, R.col(2)) == approx(mass * (a * a + b * b + h * h) / 12, 1e-12));
  }
}

TEST_CASE("a shell whose middle surface is beside its nodes moves as one that is there, by rigid arms")
{
  for (const auto& [name, shape] : shapes)
  {
    CAPTURE(name);
    const auto mesh = in_shape(quads(1, 1, [](double x, double y) { return Vec3{x, 0.8 * y, 0.1 * x * y}; }), shape);
    const std::vector<Vec3> x = positions(mesh, mesh.elements.front());
    std::vector<Vec3> arms, middle;
    for (const Vec3& at : x) arms.push_back({0.02 * at[1], -0.01 * at[0], 0.07 + 0.01 * at[0] * at[1]});
    for (std::size_t i = 0; i < x.size(); ++i) middle.push_back(x[i] + arms[i]);
    const Material material{210e9, 0.3, 7850};
    const auto here = element_matrices(shape, x, material, 0.05, arms),
               there = element_matrices(shape, middle, material, 0.05);
    std::srand(7);
    const Eigen::VectorXd u = Eigen::VectorXd::Random(6 * Eigen::Index(x.size()));
    Eigen::VectorXd carried = u;
    for (std::size_t i = 0; i < x.size(); ++i)
      carried.segment<3>(6 * Eigen::Index(i)) +=
          Eigen::Vector3d(u.segment<3>(6 * Eigen::Index(i) + 3)).cross(vector(arms[i]));
    CHECK(u.dot(here.stiffness * u) == approx(carried.dot(there.stiffness * carried), 1e-11));
    CHECK(u.dot(here.mass * u) == approx(carried.dot(there.mass * carried), 1e-11));
    Eigen::VectorXd rigid = u;
    for (std::size_t i = 0; i < x.size(); ++i)
      rigid.segment<6>(6 * Eigen::Index(i)) << u.head<3>() + Eigen::Vector3d(u.segment<3>(3)).cross(vector(x[i])),
          u.segment<3>(3);
    CHECK(rigid.dot(here.stiffness * rigid) < 1e-12 * u.dot(here.stiffness * u));
  }
}

namespace
{

void fix(Prescribed& prescribed, std::size_t node, const std::vector<int>& components)
{
  for (int k : components) prescribed[6 * int(node) + k] = 0;
}

/// Beam twisted by 90 degrees; its tip's mean displacement along `direction` under a unit load shared by the edge.
double twisted_beam_tip(Shape shape, double thickness, int direction)
{
  const double length = 12, width = 1.1;
  const auto mesh = shells(shape, 12, 2,
                           [&](double s, double t)
                           {
                             const double angle = s * M_PI / 2, r = width * (t - 0.5);
                             return Vec3{length * s, -r * std::sin(angle), r * std::cos(angle)};
                           });
  Prescribed prescribed;
  const auto K = assemble({mesh, {29e6, 0.22, 1}, thickness}).K;
  Eigen::VectorXd load = Eigen::VectorXd::Zero(K.rows());
  for (std::size_t i = 0; i < mesh.x.size(); ++i)
  {
    if (mesh.x[i][0] < 1e-9) fix(prescribed, i, {0, 1, 2, 3, 4, 5});
    if (mesh.x[i][0] > length - 1e-9)
      load(6 * Eigen::Index(i) + direction) = std::abs(mesh.x[i][1]) > 0.49 * width ? 0.25 : 0.5;
  }
  return load.dot(solve(K, load, prescribed));
}

/// Quarter of the roof, n x n elements: deflection of the middle of the free edge.
double scordelis_lo(Shape shape, int n)
{
  const double R = 25, half_length = 25, angle = 40 * M_PI / 180;
  const auto mesh = shells(shape, n, n,
                           [&](double s, double t) {
                             return Vec3{half_length * s, R * std::sin(angle * t), R * std::cos(angle * t)};
                           });
  const Body body{mesh, {4.32e8, 0, 90 / 0.25}, 0.25}; // own weight of 90 a unit of surface
  const auto [K, M] = assemble(body);
  Prescribed prescribed;
  for (std::size_t i = 0; i < mesh.x.size(); ++i)
  {
    if (mesh.x[i][0] < 1e-9) fix(prescribed, i, {0, 4, 5});            // symmetry across the middle
    if (mesh.x[i][0] > half_length - 1e-9) fix(prescribed, i, {1, 2}); // diaphragm
    if (mesh.x[i][1] < 1e-9) fix(prescribed, i, {1, 3, 5});            // symmetry along the crown
  }
  Eigen::VectorXd down = Eigen::VectorXd::Zero(K.rows());
  for (Eigen::Index i = 2; i < K.rows(); i += 6) down(i) = -1;
  const Eigen::VectorXd u = solve(K, M * down, prescribed);
  const auto corner = std::ranges::find_if(mesh.x, [&](const Vec3& x)
                                           { return x[0] < 1e-9 && std::abs(x[1] - R * std::sin(angle)) < 1e-9; });
  return -u(6 * (corner - mesh.x.begin()) + 2);
}

/// Eighth of the cylinder between diaphragms, n x n elements: displacement under a unit pinching force.
double pinched_cylinder(Shape shape, int n)
{
  const double R = 300, half_length = 300;
  const auto mesh = shells(shape, n, n,
                           [&](double s, double t)
                           {
                             const double a = t * M_PI / 2;
                             return Vec3{half_length * s, R * std::sin(a), R * std::cos(a)};
                           });
  const auto K = assemble({mesh, {3e6, 0.3, 1}, 3}).K;
  Prescribed prescribed;
  for (std::size_t i = 0; i < mesh.x.size(); ++i)
  {
    if (mesh.x[i][0] < 1e-9) fix(prescribed, i, {0, 4, 5});
    if (mesh.x[i][0] > half_length - 1e-9) fix(prescribed, i, {1, 2});
    if (mesh.x[i][1] < 1e-9) fix(prescribed, i, {1, 3, 5});
    if (mesh.x[i][2] < 1e-9) fix(prescribed, i, {2, 3, 4});
  }
  Eigen::VectorXd load = Eigen::VectorXd::Zero(K.rows());
  load(2) = -0.25;
  return -solve(K, load, prescribed)(2);
}

} // namespace

TEST_CASE("the twisted beam bends as beam theory says")
{
  for (const auto& [name, shape] : shapes)
  {
    CAPTURE(name);
    const double through = twisted_beam_tip(shape, 0.32, 1), in_width = twisted_beam_tip(shape, 0.32, 2);
    CHECK(through == approx(0.0054244, 0.02));
    CHECK(in_width == approx(0.0017533, 0.02));
  }
}

TEST_CASE("a thin twisted beam does not lock as quadrilaterals, though each is warped")
{
  CHECK(twisted_beam_tip(Shape::quad4, 0.0032, 1) == approx(5256, 0.02));
  CHECK(twisted_beam_tip(Shape::quad4, 0.0032, 2) == approx(1294, 0.02));
}

TEST_CASE("the Scordelis-Lo roof sags by 0.3006 to 0.3024")
{
  for (const auto& [name, shape] : shapes)
  {
    CAPTURE(name);
    const double sag = scordelis_lo(shape, 32);
    CHECK(sag > 0.3006);
    CHECK(sag < 0.3024);
  }
}

TEST_CASE("the pinched cylinder gives way by 1.825e-5 and a little more")
{
  // 1.825e-5 is thin shell theory. Transverse shear, which it leaves out, adds P / (2 pi kappa G h) ln(..) under the
  // point load: measured at this mesh 0.7 %, and growing without bound. The rest, 1 % at most, is the mesh.
  for (const auto& [name, shape] : shapes)
  {
    CAPTURE(name);
    // a corner of shell8 is one triangle of each element alone, which is soft under a point load: measured 3.6 %
    CHECK(pinched_cylinder(shape, 32) == approx(1.007 * 1.825e-5, shape == Shape::quad8 ? 0.04 : 0.012));
  }
}
