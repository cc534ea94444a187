// ranks: 1
/// Solid elements against exact and published answers. Sources: MacNeal and Harder 1985 (patch test, beams);
/// three-dimensional elasticity by a semi-analytical Ritz series (thick disc); NAFEMS (thick plate).
#include "small_fem.hpp"

#include <doctest/doctest.h>
#include <numeric>
#include <string>

using namespace squeal;
using namespace small_fem;

namespace
{

const std::vector<std::pair<std::string, Shape>> solids = {
    {"hex8", Shape::hex8},           {"wedge6", Shape::wedge6},       {"hex20", Shape::hex20},
    {"tet10", Shape::tet10},         {"tet4", Shape::tet4},           {"pyramid5", Shape::pyramid5},
    {"pyramid13", Shape::pyramid13}, {"pyramid14", Shape::pyramid14}, {"wedge15", Shape::wedge15},
    {"wedge18", Shape::wedge18},     {"hex27", Shape::hex27}};

/// Unit cube of 7 bricks, the inner one skew (MacNeal and Harder 1985).
small_fem::Mesh patch_of_bricks()
{
  small_fem::Mesh mesh{Shape::hex8, {}, {}};
  mesh.x = {{0, 0, 0},
            {1, 0, 0},
            {1, 1, 0},
            {0, 1, 0},
            {0, 0, 1},
            {1, 0, 1},
            {1, 1, 1},
            {0, 1, 1},
            {0.249, 0.342, 0.192},
            {0.826, 0.288, 0.288},
            {0.850, 0.649, 0.263},
            {0.273, 0.750, 0.230},
            {0.320, 0.186, 0.643},
            {0.677, 0.305, 0.683},
            {0.788, 0.693, 0.644},
            {0.165, 0.745, 0.702}};
  mesh.elements = {{8, 9, 10, 11, 12, 13, 14, 15}};
  for (const std::array<int, 4>& side :
       {std::array{0, 1, 2, 3}, {4, 7, 6, 5}, {0, 4, 5, 1}, {1, 5, 6, 2}, {2, 6, 7, 3}, {3, 7, 4, 0}})
  {
    std::vector<int> element(side.begin(), side.end());
    for (int node : side) element.push_back(node + 8);
    mesh.elements.push_back(element);
  }
  return mesh;
}

/// 2 x 2 x 2 bricks of the unit cube with the middle node, and those inside the faces and edges, off centre.
small_fem::Mesh skew_cube()
{
  const auto bend = [](double s, double by) { return s + by * s * (1 - s); };
  return bricks({2, 2, 2},
                [&](double x, double y, double z) {
                  return Vec3{bend(x, 0.3 * y - 0.2 * z), bend(y, 0.25 * z + 0.2 * x), bend(z, 0.3 - 0.4 * x * y)};
                });
}

bool on_cube_face(const Vec3& x)
{
  return std::any_of(x.begin(), x.end(), [](double s) { return std::abs(s) < 1e-12 || std::abs(s - 1) < 1e-12; });
}

/// Every inner node moves with the linear field prescribed on the faces, and the stress is the field's everywhere.
void check_patch(const small_fem::Mesh& mesh)
{
  const auto exact = [](const Vec3& x)
  {
    const double sum = x[0] + x[1] + x[2];
    return Vec3{5e-4 * (sum + x[0]), 5e-4 * (sum + x[1]), 5e-4 * (sum + x[2])};
  };
  const Material material{1e6, 0.25, 1};
  Prescribed prescribed;
  for (std::size_t node = 0; node < mesh.x.size(); ++node)
    for (int k = 0; k < 3; ++k)
      if (on_cube_face(mesh.x[node])) prescribed[3 * int(node) + k] = exact(mesh.x[node])[k];
  const auto K = assemble({mesh, material, 0}).K;
  const Eigen::VectorXd u = solve(K, Eigen::VectorXd::Zero(K.rows()), prescribed);
  for (std::size_t node = 0; node < mesh.x.size(); ++node)
    for (int k = 0; k < 3; ++k)
      CHECK(std::abs(u(3 * int(node) + k) - exact(mesh.x[node])[k]) < 1e-13); // 1e-10 of the largest displacement
  for (const auto& element : mesh.elements)
  {
    std::vector<double> ue;
    for (int node : element)
      for (int k = 0; k < 3; ++k) ue.push_back(u(3 * node + k));
    for (const auto& s : solid_stress(mesh.shape, positions(mesh, element), material, ue))
      for (int k = 0; k < 6; ++k) CHECK(s[k] == approx(k < 3 ? 2000 : 400, 1e-10));
  }
}

} // namespace

TEST_CASE("a constant strain is reproduced on skew meshes of every solid shape")
{
  for (const auto& [name, shape] : solids)
  {
    SUBCASE(name.c_str())
    {
      check_patch(in_shape(skew_cube(), shape));
    }
  }
  SUBCASE("MacNeal's seven hex8")
  {
    check_patch(patch_of_bricks());
  }
  SUBCASE("MacNeal's seven hex20")
  {
    check_patch(in_shape(patch_of_bricks(), Shape::hex20));
  }
}

TEST_CASE("an unsupported solid has six zero frequencies and no other")
{
  for (const auto& [name, shape] : solids)
  {
    SUBCASE(name.c_str())
    {
      auto mesh = in_shape(skew_cube(), shape);
      mesh.elements.resize(1); // one element: what a neighbour could hide shows
      std::vector<Vec3> x = positions(mesh, mesh.elements[0]);
      const auto [K, M] = element_matrices(shape, x, {210e9, 0.3, 7850}, 0);
      const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> pairs(K, M);
      const auto& values = pairs.eigenvalues();
      CHECK(pairs.info() == Eigen::Success); // M is positive definite
      CHECK(values.head(6).cwiseAbs().maxCoeff() < 1e-8 * values(6));
    }
  }
}

TEST_CASE("the mass of a solid is its density times its volume")
{
  for (const auto& [name, shape] : solids)
  {
    const auto M = assemble({in_shape(skew_cube(), shape), {1, 0.3, 7850}, 0}).M;
    Eigen::VectorXd along = Eigen::VectorXd::Zero(M.rows());
    for (Eigen::Index i = 1; i < M.rows(); i += 3) along(i) = 1;
    CHECK_MESSAGE(along.dot(M * along) == approx(7850, 1e-12), name); // the cube's faces stay plane
  }
}

TEST_CASE("a folded solid is refused by the name of its Jacobian")
{
  const std::vector<Vec3> x = {{0, 0, 0},  {1, 0, 0},  {1, 1, 0},  {0, 1, 0},
                               {0, 0, -1}, {1, 0, -1}, {1, 1, -1}, {0, 1, -1}};
  CHECK_THROWS_AS(element_matrices(Shape::hex8, x, {1, 0.3, 1}, 0), std::runtime_error);
}

TEST_CASE("the weights of a closed surface of faces are its area vector, and a square shares evenly")
{
  const std::vector<Vec3> corners = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0},
                                     {1, 0, 0}, {2, 1, 0}, {1, 2, 0}, {0, 1, 0}};
  const auto weights = [&](Shape shape, std::size_t n) { return face_weights(shape, std::span(corners).first(n)); };
  for (const auto& w : weights(Shape::quad4, 4)) CHECK(w[2] == approx(1, 1e-14));
  CHECK(weights(Shape::quad8, 8)[0][2] == approx(-1. / 3, 1e-13)); // why quad8 cannot touch
  const std::vector<Vec3> triangle = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.5, 0, 0}, {0.5, 0.5, 0}, {0, 0.5, 0}};
  const auto w = face_weights(Shape::triangle6, triangle);
  CHECK(std::abs(w[0][2]) < 1e-15);
  CHECK(w[4][2] == approx(1. / 6, 1e-13));
}

namespace
{

/// Consistent forces of a traction [Pa] on the plane end x = length; the traction is interpolated from the nodes' own.
Eigen::VectorXd end_load(const small_fem::Mesh& mesh, double length, const std::function<Vec3(const Vec3&)>& traction)
{
  static const std::map<Shape, std::pair<Shape, std::vector<int>>> ends = {
      {Shape::hex8, {Shape::quad4, {1, 2, 6, 5}}},
      {Shape::wedge6, {Shape::quad4, {1, 2, 5, 4}}},
      {Shape::hex20, {Shape::quad8, {1, 2, 6, 5, 11, 14, 18, 12}}},
      {Shape::hex27, {Shape::quad9, {1, 2, 6, 5, 11, 14, 18, 12, 23}}},
      {Shape::wedge15, {Shape::quad8, {1, 2, 5, 4, 9, 11, 14, 10}}},
      {Shape::pyramid13, {Shape::quad8, {0, 3, 2, 1, 6, 10, 8, 5}}},
      {Shape::tet10, {Shape::triangle6, {1, 2, 3, 5, 8, 9}}}};
  const auto& [face, local] = ends.at(mesh.shape);
  Eigen::VectorXd load = Eigen::VectorXd::Zero(3 * Eigen::Index(mesh.x.size()));
  for (const auto& element : mesh.elements)
  {
    std::vector<int> nodes;
    for (int corner : local) nodes.push_back(element[corner]);
    if (std::any_of(nodes.begin(), nodes.end(), [&](int node) { return mesh.x[node][0] < length - 1e-9; })) continue;
    const auto weights = face_weights(face, positions(mesh, nodes));
    for (std::size_t i = 0; i < nodes.size(); ++i)
      for (int k = 0; k < 3; ++k)
        load(3 * nodes[i] + k) += weights[i][0] * traction(mesh.x[nodes[i]])[k]; // the end faces x, exactly
  }
  return load;
}

/// Displacement that works with the load, under the load, x = 0 held.
double response(const small_fem::Mesh& mesh, const Material& material, const Eigen::VectorXd& load)
{
  Prescribed prescribed;
  for (std::size_t i = 0; i < mesh.x.size(); ++i)
    if (mesh.x[i][0] < 1e-9)
      for (int k = 0; k < 3; ++k) prescribed[3 * int(i) + k] = 0;
  return load.dot(solve(assemble({mesh, material, 0}).K, load, prescribed));
}

} // namespace

namespace
{

/// Displacement of the end of a 6 x 0.2 x 0.1 cantilever over beam theory's, under a unit end load along x, y and z.
Eigen::Vector3d cantilever(Shape shape, std::array<int, 3> elements)
{
  const auto box = [](double x, double y, double z) { return Vec3{6 * x, 0.2 * (y - 0.5), 0.1 * (z - 0.5)}; };
  const auto mesh = in_shape(bricks(elements, box), shape);
  const Eigen::Vector3d exact(2.9978e-5, 0.107937, 0.431132);
  Eigen::Vector3d ratio;
  for (int k = 0; k < 3; ++k)
  {
    Vec3 traction{};
    traction[k] = 1 / 0.02;
    ratio(k) = response(mesh, {1e7, 0.3, 1}, end_load(mesh, 6, [&](const Vec3&) { return traction; })) / exact(k);
  }
  return ratio;
}

/// Twist per unit torque of the same cantilever over the exact 0.034089, 6 x 6 x 4 elements.
double twist(Shape shape)
{
  const auto box = [](double x, double y, double z) { return Vec3{6 * x, 0.2 * (y - 0.5), 0.1 * (z - 0.5)}; };
  const auto mesh = in_shape(bricks({6, 6, 4}, box), shape);
  const Eigen::VectorXd load = end_load(mesh, 6, [](const Vec3& x) { return Vec3{0, -x[2], x[1]}; });
  double torque = 0;
  for (std::size_t i = 0; i < mesh.x.size(); ++i)
    torque += mesh.x[i][1] * load(3 * Eigen::Index(i) + 2) - mesh.x[i][2] * load(3 * Eigen::Index(i) + 1);
  return response(mesh, {1e7, 0.3, 1}, load / torque) / 0.034089;
}

} // namespace

TEST_CASE("a straight cantilever of six elements stretches and bends as beam theory says")
{
  // a constant curvature an element cannot follow the linear one: 1 - 1 / (4 6^2) = 0.7 %; the rest is the clamp, which
  // holds the width of the section and, coarsely meshed, of a whole element. Without the modes 90 % would be missing.
  const Eigen::Vector3d hex8 = cantilever(Shape::hex8, {6, 1, 1});
  for (int k = 0; k < 3; ++k) CHECK(hex8(k) == approx(1, 0.03));
  // the clamp's hold is felt a little more by full integration
  for (const Shape shape : {Shape::hex20, Shape::tet10, Shape::hex27, Shape::wedge15, Shape::pyramid13})
  {
    const Eigen::Vector3d ratio = cantilever(shape, {6, 1, 1});
    for (int k = 0; k < 3; ++k) CHECK(ratio(k) == approx(1, 0.045));
  }
}

TEST_CASE("the linear wedge is stiff in bending and converges")
{
  const double coarse = 1 - cantilever(Shape::wedge6, {12, 2, 1})(2),
               fine = 1 - cantilever(Shape::wedge6, {48, 8, 2})(2);
  CHECK(fine > 0);
  CHECK(fine < 0.5 * coarse);
}

TEST_CASE("a straight cantilever twists by Saint-Venant's torsion")
{
  // one element across has the warping y z alone and gives 0.858 of it; six by four leave 2 %, and the clamp's hold
  for (const Shape shape : {Shape::hex8, Shape::hex20, Shape::tet10, Shape::hex27, Shape::wedge15, Shape::pyramid13})
  {
    CHECK(twist(shape) == approx(1, 0.04));
  }
}

TEST_CASE("the twisted beam of 12 x 2 x 1 bricks bends as beam theory says")
{
  const double thickness = 0.32, width = 1.1;
  const auto beam = [&](double s, double b, double c)
  {
    const double angle = s * M_PI / 2, y = width * (b - 0.5), z = thickness * (0.5 - c);
    return Vec3{12 * s, z * std::cos(angle) - y * std::sin(angle), z * std::sin(angle) + y * std::cos(angle)};
  };
  for (const Shape shape : {Shape::hex8, Shape::hex20, Shape::tet10})
  {
    const auto mesh = in_shape(bricks({12, 2, 1}, beam), shape);
    const auto tip = [&](const Vec3& traction) {
      return response(mesh, {29e6, 0.22, 1}, end_load(mesh, 12, [&](const Vec3&) { return traction; }));
    };
    const double unit = 1 / (thickness * width);
    CHECK(tip({0, unit, 0}) == approx(0.0054244, 0.02));
    CHECK(tip({0, 0, unit}) == approx(0.0017533, 0.02));
  }
}

TEST_CASE(
    "frequencies of a cube between rollers converge with the second power of the size, quadratic elements' fourth")
{
  // u = (sin pi x cos pi y, -cos pi x sin pi y, 0) and its like have no volume change: omega^2 = 2 pi^2 G/rho, three
  // times. Orders of two meshes are a few tenths off their limit.
  const double exact = std::sqrt(1e9 / 2.6 / 1000 * 2) / 2;
  const auto error = [&](Shape shape, int n)
  {
    const auto mesh = in_shape(bricks({n, n, n}, [](double x, double y, double z) { return Vec3{x, y, z}; }), shape);
    Prescribed rollers;
    for (std::size_t i = 0; i < mesh.x.size(); ++i)
      for (int k = 0; k < 3; ++k)
        if (std::abs(mesh.x[i][k]) < 1e-12 || std::abs(mesh.x[i][k] - 1) < 1e-12) rollers[3 * int(i) + k] = 0;
    const auto f = frequencies(assemble({mesh, {1e9, 0.3, 1000}, 0}), rollers, 3, 0);
    return (f[0] + f[1] + f[2]) / 3 / exact - 1;
  };
  for (const auto& [name, shape] : solids)
  {
    const bool linear = middles_of(shape).empty();
    const int n = linear ? 4 : 2;
    const double coarse = std::abs(error(shape, n)), fine = std::abs(error(shape, 2 * n));
    CAPTURE(name);
    CHECK(std::log2(coarse / fine) > (linear ? 1.7 : 3.3));
    CHECK(fine < (linear ? 0.05 : 0.004));
  }
}

namespace
{

/// Ring of outer radius 0.32, inner 0.145, thickness 0.045; nodes between corners lie on their circle.
small_fem::Mesh ring(int around, int across, int through, Shape shape)
{
  auto mesh = in_shape(joined({bricks({across, around, through},
                                      [](double r, double a, double z)
                                      {
                                        const double radius = 0.145 + 0.175 * r, angle = 2 * M_PI * a;
                                        return Vec3{radius * std::cos(angle), radius * std::sin(angle), 0.045 * z};
                                      })}),
                       shape);
  for (auto& x : mesh.x)
  {
    const double steps = std::atan2(x[1], x[0]) / (2 * M_PI) * around;
    const double out = std::abs(steps - std::round(steps)) < 1e-6 ? 1 : 1 / std::cos(M_PI / around);
    x = {x[0] * out, x[1] * out, x[2]};
  }
  return mesh;
}

} // namespace

TEST_CASE("a free thick disc rings as three-dimensional elasticity says, its doublets unsplit")
{
  // n = 2, 2, 0, 3, 3, 1, 1, 2, 2, 4, 4, 2, 2 of the semi-analytical series, 5e-6 or better
  const std::vector<double> exact = {467.3769,  467.3769,  939.7882,  1211.4824, 1211.4824, 1642.3402, 1642.3402,
                                     1708.8579, 1708.8579, 2150.7736, 2150.7736, 2928.6487, 2928.6487};
  const auto check = [&](const small_fem::Mesh& mesh, double tolerance)
  {
    const auto f = frequencies(assemble({mesh, {210e9, 0.3, 7850}, 0}), {}, 6 + int(exact.size()), 1e7);
    for (std::size_t i = 0; i < exact.size(); ++i) CHECK(f[i + 6] == approx(exact[i], tolerance));
    for (const std::size_t i : {0, 3, 5, 7, 9, 11}) CHECK(f[i + 7] / f[i + 6] - 1 < 1e-4);
  };
  // second order in the size: 96 x 10 x 4 hex8, too long for here, are within 0.9 %
  SUBCASE("48 x 5 x 2 hex8")
  {
    check(ring(48, 5, 2, Shape::hex8), 0.03);
  }
  SUBCASE("32 x 3 x 1 hex20")
  {
    check(ring(32, 3, 1, Shape::hex20), 0.02);
  }
}
