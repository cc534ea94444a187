// ranks: 1 2
// Parts that spin, in the frame at rest. Rigid motions keep no stiffness, whatever the mesh; the gyroscopic matrix of
// tilts is rate I_p; a thin ring that does not stretch has the doublets of src/README.md, section 1.10.
#include "../support/bricks.hpp"
#include "../support/linearised.hpp"
#include "small_fem.hpp"
#include "squeal/solid/structure.hpp"

#include <numbers>

using namespace squeal;
using namespace squeal::test;

namespace
{

const MPI_Comm& world = PETSC_COMM_WORLD; // set when the session starts

/// Of an annulus about the axis z through `centre`.
struct Annulus
{
  double inner, outer, height; // [m]
  std::array<int, 3> cells;    // about the axis, across, along
  double uneven = 0;           // of the angles of the cells
  Vec3 centre{};
};

small_fem::Mesh annulus(const Annulus& a)
{
  const auto place = [&](double s, double r, double z)
  {
    const double angle = 2 * std::numbers::pi * (s + a.uneven * std::sin(2 * std::numbers::pi * s)),
                 radius = a.outer + (a.inner - a.outer) * r;
    return a.centre + Vec3{radius * std::cos(angle), radius * std::sin(angle), a.height * (z - 0.5)};
  };
  return small_fem::joined({small_fem::bricks(a.cells, place)});
}

struct SpinModel
{
  Mesh mesh;
  Scene scene;
};

SpinModel spinning(const small_fem::Mesh& body, const Rotation& rotation, const Material& material)
{
  SpinModel model;
  model.mesh.nodes.assign(body.x.begin(), body.x.end());
  for (const auto& nodes : body.elements)
  {
    Element element{body.shape, 0, {}};
    std::copy(nodes.begin(), nodes.end(), element.nodes.begin());
    model.mesh.elements.push_back(element);
    add_to_group(model.mesh, "disc", nodes);
  }
  Part part{"disc", material, 0, {}};
  part.rotation = rotation;
  model.scene.parts.push_back(part);
  return model;
}

/// A x over the sizes of both.
double relative_product(Mat A, Vec x)
{
  return largest_of_product(A, x) / (norm_of(A, NORM_INFINITY) * norm_of(x, NORM_INFINITY));
}

const std::array shapes = {Shape::hex8, Shape::wedge6,  Shape::hex20, Shape::tet10,
                           Shape::tet4, Shape::wedge15, Shape::hex27, Shape::pyramid13};

/// |lambda| of the pairs that are found, ascending.
std::vector<double> pairs_of(Built built, double band)
{
  SmallModel model;
  model.structure = std::move(built.structure);
  PetscInt local = 0;
  check(MatGetLocalSize(model.structure.K, &local, nullptr));
  model.interface.B = matrix_of_rows({}, local, world);
  ModesSettings settings;
  settings.band = band;
  const Modes modes = test::modes_of(model, find_equilibrium(model.structure, model.interface, {}), settings, {});
  REQUIRE(modes.outcome.kind == OutcomeKind::converged);
  std::vector<double> result;
  for (const ComplexMode& mode : modes.modes)
  {
    CHECK(mode.backward_error < 1e-12);
    CHECK(std::abs(mode.lambda.real()) < 1e-7 * std::abs(mode.lambda)); // conservative; doublets lie near each other
    result.push_back(mode.lambda.imag());
  }
  std::sort(result.begin(), result.end());
  return result;
}

constexpr double E = 2e11, rho = 7800, R = 0.5, thickness = 0.01, depth = 0.02;

/// The doublet of order n of a thin ring.
std::array<double, 2> doublet(int n, double rate)
{
  const double bending = E * thickness * thickness / (12 * rho * std::pow(R, 4)), n2 = n * n,
               common = n * (n2 - 1) / (n2 + 1), mean = std::sqrt(rate * rate + (n2 + 1) * bending);
  return {common * (mean - rate), common * (mean + rate)};
}

/// The pairs of a ring that moves in its plane.
std::vector<double> ring_pairs(int cells, double rate, double band)
{
  SpinModel model = spinning(annulus({R - thickness / 2, R + thickness / 2, depth, {cells, 1, 1}}),
                             {{0, 0, 1}, {}, rate}, {E, 0, rho});
  model.scene.supports.push_back({"disc", {false, false, true}});
  return pairs_of(build(model.mesh, model.scene, world), band);
}

} // namespace

TEST_CASE("rigid motions of a part that spins keep no stiffness, and tilts have the gyroscopic moment")
{
  const Vec3 axis = {0, 0, 1}, centre = {0.3, -0.2, 0.1};
  const double rate = 900;
  for (const Shape shape : shapes)
  {
    const auto body = small_fem::in_shape(annulus({0.3, 0.5, 0.1, {14, 1, 1}, 0.03, centre}), shape);
    const SpinModel model = spinning(body, {axis, centre, rate}, {E, 0.3, rho});
    const Built built = build(model.mesh, model.scene, world);
    const auto& [M, C, K, G] = std::tie(built.structure.M, built.structure.C, built.structure.K, built.structure.G);
    std::array<Owned<Vec>, 3> tilts;
    for (std::size_t k = 0; k < 3; ++k)
    {
      Vec3 e{};
      e[k] = 1;
      const Owned<Vec> moved = sample(built.structure, rigid_motion(e, {}));
      tilts[k] = sample(built.structure, rigid_motion(-1 * cross(e, centre), e));
      CHECK(relative_product(K, moved) < 1e-13);
      CHECK(relative_product(K, tilts[k]) < 1e-13);
    }
    const double polar = form(M, tilts[2], tilts[2]);
    CHECK(form(G, tilts[0], tilts[1]) == approx(rate * polar, 1e-12));
    CHECK(form(G, tilts[1], tilts[0]) == approx(-rate * polar, 1e-12));
    CHECK(std::abs(form(G, tilts[0], tilts[0])) < 1e-12 * rate * polar);
  }
}

TEST_CASE("a free ring nutates at its rate times the ratio of its moments of inertia")
{
  // stiff: strains of the gyroscopic moment change the frequency by (rate/elastic)^2
  const double rate = 3;
  const SpinModel model = spinning(annulus({0.4, 0.5, 0.1, {16, 1, 1}}), {{0, 0, 1}, {}, rate}, {E, 0.3, rho});
  Built built = build(model.mesh, model.scene, world);
  const Owned<Vec> tilt = sample(built.structure, rigid_motion({}, {1, 0, 0})),
                   turn = sample(built.structure, rigid_motion({}, {0, 0, 1}));
  const double ratio = form(built.structure.M, turn, turn) / form(built.structure.M, tilt, tilt);
  const std::vector<double> pairs = pairs_of(std::move(built), 2 * rate / (2 * std::numbers::pi));
  REQUIRE(pairs.size() == 1);
  CHECK(pairs[0] == approx(rate * ratio, 1e-5));
}

TEST_CASE("a thin ring's doublets split as theory has it, and converge with the mesh")
{
  for (const double part : {0.1, 0.5})
  {
    const double rate = part * doublet(2, 0)[0], band = 1.7 * doublet(3, rate)[1] / (2 * std::numbers::pi);
    // two rigid motions in the plane are at zero
    const std::array<std::vector<double>, 2> meshes = {ring_pairs(24, rate, band), ring_pairs(72, rate, band)};
    for (const int n : {2, 3})
    {
      const auto exact = doublet(n, rate);
      std::array<double, 2> error{}, split_error{};
      for (const std::size_t fine : {0u, 1u})
      {
        REQUIRE(meshes[fine].size() >= 4);
        std::array<double, 2> found{};
        for (std::size_t k = 0; k < 2; ++k)
          found[k] = *std::ranges::min_element(meshes[fine], {}, [&](double f) { return std::abs(f - exact[k]); });
        split_error[fine] = std::abs((found[1] - found[0]) / (exact[1] - exact[0]) - 1);
        error[fine] = std::max(std::abs(found[0] / exact[0] - 1), std::abs(found[1] / exact[1] - 1));
      }
      CHECK(split_error[1] < 0.01);
      CHECK(error[1] < 0.01);
      // order two gives a ninth of the frequency's error; the thickness leaves some 6e-5 of the splitting
      CHECK(split_error[1] < 0.5 * split_error[0]);
      CHECK(error[1] < error[0] / 6);
    }
  }
}

TEST_CASE("what is no solid of revolution about its axis does not spin")
{
  const Annulus a{0.3, 0.5, 0.1, {14, 1, 1}};
  const Material steel{E, 0.3, rho};
  const Rotation rotation{{0, 0, 1}, {}, 10};
  const auto fails = [&](const SpinModel& model)
  { CHECK_THROWS_AS((void)build(model.mesh, model.scene, world), Error); };
  auto slotted = annulus(a);
  slotted.elements.pop_back();
  fails(spinning(slotted, rotation, steel));
  fails(spinning(annulus(a), {{0, 0, 1}, {0.2, 0, 0}, 10}, steel));
  fails(spinning(annulus(a), {{1, 0, 0}, {}, 10}, steel));
  fails(spinning(small_fem::bricks({3, 3, 1},
                                   [](double x, double y, double z) {
                                     return Vec3{x - 0.5, y - 0.5, z};
                                   }),
                 rotation, steel));
  const SpinModel fits = spinning(annulus(a), {{0, 0, 1}, {0, 0, 7}, 10}, steel);
  CHECK_NOTHROW((void)build(fits.mesh, fits.scene, world));
}
