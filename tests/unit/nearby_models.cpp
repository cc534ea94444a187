// A sweep over each kind of number makes anew the parts of the model that the number enters, and those alone.
#include "squeal/model.hpp"

#include <array>
#include <doctest/doctest.h>

using namespace squeal;

namespace
{

/// A tip that slides on a disc, both on springs.
Scene two_points()
{
  Scene scene;
  const Motions free{true, false, true, false, false, false};
  scene.points = {{"tip", {0, 0, 0.1}, 1, free}, {"disc", {0, 0, 0}, 2, free}};
  scene.springs = {{"tip", ground, {1, 0, 0}, 1e5, 1}, {"tip", ground, {0, 0, 1}, 2e5, 0}};
  scene.springs.push_back({"disc", ground, {0, 0, 1}, 1e6, 2});
  scene.springs.push_back({"disc", ground, {1, 0, 0}, 1e6, 2});
  scene.forces = {{"tip", {0, 0, -5}}};
  scene.contacts.emplace_back();
  scene.contacts[0].rotor = "disc";
  scene.contacts[0].stator = "tip";
  scene.contacts[0].normal = Vec3{0, 0, 1};
  scene.contacts[0].velocity = {1, 0, 0};
  scene.friction.coefficient = 0.3;
  return scene;
}

/// Whether M, C, K, the load and B are the same objects.
std::array<bool, 5> shared_parts(const Model& a, const Model& b)
{
  return {a.structure.M.get() == b.structure.M, a.structure.C.get() == b.structure.C,
          a.structure.K.get() == b.structure.K, a.structure.load.get() == b.structure.load,
          a.interface.B.get() == b.interface.B};
}

double difference(Mat A, Mat B)
{
  const Owned<Mat> rest = copy_of(A);
  double size = 0;
  check(MatAXPY(rest, -1, B, DIFFERENT_NONZERO_PATTERN));
  check(MatNorm(rest, NORM_FROBENIUS, &size));
  return size;
}

/// The model is that of the scene with these numbers, built from nothing.
void check_model(const Model& model, const Scene& scene, const std::vector<SceneNumber>& numbers)
{
  Scene other = scene_with(scene, numbers);
  const Model built = build_model(other, PETSC_COMM_WORLD);
  for (const auto matrix : {&Structure::M, &Structure::C, &Structure::K})
    CHECK(difference(model.structure.*matrix, built.structure.*matrix) == 0);
  CHECK(difference(model.interface.B, built.interface.B) == 0);
  PetscBool same_load = PETSC_FALSE;
  check(VecEqual(model.structure.load, built.structure.load, &same_load));
  CHECK(same_load == PETSC_TRUE);
  CHECK(model.interface.gap == built.interface.gap);
  CHECK(model.interface.drive == built.interface.drive);
  CHECK(model.interface.compliance == built.interface.compliance);
  CHECK(model.interface.friction.common.coefficient == built.interface.friction.common.coefficient);
}

struct Kind
{
  SceneNumber number;
  std::array<bool, 5> same_part; // as the scene's own: M, C, K, load, B
};

} // namespace

TEST_CASE("a number makes anew the parts that it enters alone, whatever number was changed before")
{
  Scene scene = two_points();
  const Model model = build_model(scene, PETSC_COMM_WORLD);
  NearbyModels models(model, scene);
  const Model own = models.at({});
  CHECK(own.structure.K.get() == model.structure.K);
  const std::vector<Kind> kinds = {
      {{"friction.coefficient", 0.4}, {true, true, true, true, true}},
      {{"contact.0.gap", -1e-6}, {true, true, true, true, true}},
      {{"contact.0.compliance", 1e-9}, {true, true, true, true, true}},
      {{"contact.0.velocity.0", 2}, {true, true, true, true, false}},
      {{"force.0.vector.2", -7}, {true, true, true, false, true}},
      {{"spring.0.damping", 3}, {true, false, true, true, true}},
      {{"point.tip.mass", 2}, {false, false, true, true, true}},
      {{"spring.0.stiffness", 3e5}, {true, false, false, true, true}},
      {{"point.tip.at.2", 0.2}, {false, false, false, false, false}},
  };
  for (const Kind& kind : kinds)
  {
    CAPTURE(kind.number.key);
    const Model changed = models.at({&kind.number, 1});
    std::array<bool, 5> same = shared_parts(changed, own);
    if (kind.number.key == "spring.0.stiffness") same[0] = true; // of one assembly with K
    CHECK(same == kind.same_part);
    check_model(changed, scene, {kind.number});
  }
}

TEST_CASE("weights of a coupling make its rows anew")
{
  Scene scene = two_points();
  scene.points.push_back({"side", {0.1, 0, 0.1}, 3, {true, true, true, false, false, false}});
  scene.springs.push_back({"side", ground, {1, 0, 0}, 1e5, 0});
  scene.springs.push_back({"side", ground, {0, 1, 0}, 1e5, 0});
  scene.springs.push_back({"side", ground, {0, 0, 1}, 1e5, 0});
  Coupling& mean = scene.couplings.emplace_back();
  mean.name = "mean";
  mean.on = {"tip", "disc", "side"};
  mean.at = {0, 0, 0.05};
  mean.weights = {1, 1, 1};
  mean.mass = 4;
  mean.inertia = {1, 1, 1};
  const Model model = build_model(scene, PETSC_COMM_WORLD);
  NearbyModels models(model, scene);
  for (const double weight : {3., 5.})
  {
    const SceneNumber number{"coupling.mean.weights.0", weight};
    check_model(models.at({&number, 1}), scene, {number});
  }
}
