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
    {"hex8", Shape::hex8}, {"wedge6", Shape::wedge6}, {"hex20", Shape::hex20}, {"tet10", Shape::tet10}};

/// Unit cube of 7 bricks, the inner one skew (MacNeal and Harder 1985).
small_fem::Mesh patch_of_bricks()
{
  small_fem::Mesh mesh{Shape::hex8, {}, {}};
  mesh.x = {{0, 0, 0},          {1, 0, 0},          {1, 1, 0},          {0, 1, 0},
            {0, 0, 1},          {1, 0, 1},          {1, 1, 1},          {0, 1, 1},
            {.249, .342, .192}, {.826, .288, .288}, {.850, .649, .263}, {.273, .750, .230},
            {.320, .186, .643}, {.677, .305, .683}, {.788, .693, .644}, {.165, .745, .702}};
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
                  return Vec3{bend(x, .3 * y - .2 * z), bend(y, .25 * z + .2 * x), bend(z, .3 - .4 * x * y)};
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
  const Material material{1e6, .25, 1};
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
      for (int k = 0; k < 6; ++k) CHECK(s[k] == doctest::Approx(k < 3 ? 2000 : 400).epsilon(1e-10));
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
      const auto [k, m] = element_matrices(shape, x, {210e9, .3, 7850}, 0);
      const auto n = static_cast<Eigen::Index>(3 * x.size());
      const Eigen::Map<const Eigen::MatrixXd> K(k.data(), n, n), M(m.data(), n, n);
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
    const auto M = assemble({in_shape(skew_cube(), shape), {1, .3, 7850}, 0}).M;
    Eigen::VectorXd along = Eigen::VectorXd::Zero(M.rows());
    for (Eigen::Index i = 1; i < M.rows(); i += 3) along(i) = 1;
    CHECK_MESSAGE(along.dot(M * along) == doctest::Approx(7850).epsilon(1e-12), name); // the cube's faces stay plane
  }
}

TEST_CASE("a folded solid is refused by the name of its Jacobian")
{
  const std::vector<Vec3> x = {{0, 0, 0},  {1, 0, 0},  {1, 1, 0},  {0, 1, 0},
                               {0, 0, -1}, {1, 0, -1}, {1, 1, -1}, {0, 1, -1}};
  CHECK_THROWS_AS(element_matrices(Shape::hex8, x, {1, .3, 1}, 0), std::runtime_error);
}

TEST_CASE("the weights of a closed surface of faces are its area vector, and a square shares evenly")
{
  const std::vector<Vec3> corners = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {1, 0, 0},
                                     {2, 1, 0}, {1, 2, 0}, {0, 1, 0}, {1, 1, 0}};
  const auto weights = [&](FaceShape shape, std::size_t n) { return face_weights(shape, std::span(corners).first(n)); };
  for (const auto& w : weights(FaceShape::quad4, 4)) CHECK(w[2] == doctest::Approx(1).epsilon(1e-14));
  CHECK(weights(FaceShape::quad8, 8)[0][2] == doctest::Approx(-1. / 3).epsilon(1e-13)); // why quad8 cannot touch
  CHECK(weights(FaceShape::quad9, 9)[8][2] == doctest::Approx(16. / 9).epsilon(1e-13));
  const std::vector<Vec3> triangle = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {.5, 0, 0}, {.5, .5, 0}, {0, .5, 0}};
  const auto w = face_weights(FaceShape::triangle6, triangle);
  CHECK(std::abs(w[0][2]) < 1e-15);
  CHECK(w[4][2] == doctest::Approx(1. / 6).epsilon(1e-13));
}
