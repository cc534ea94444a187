// ranks: 1 2 3
#include "../support/small_models.hpp"

#include <doctest/doctest.h>

using namespace squeal;

TEST_CASE("the oscillator's pad rests on the disc with the reaction that both springs give")
{
  // closed, frictionless: 0.5 y + 1.2 y - 0.1 x = -1, 1.1 x = 0.1 y: r = -1.2 y
  const auto model = test::unilateral_oscillator(0, 1);
  const double y = -1 / (1.7 - 0.01 / 1.1), r = -1.2 * y;
  const auto u = test::vector_like(model.structure.K, {0.1 * y / 1.1, y, y});
  const auto force = zeros_like(u), reaction = zeros_like(u);
  check(MatMult(model.structure.K, u, force));
  check(VecAXPY(force, -1, model.structure.load));
  Owned<Vec> multiplier;
  check(MatCreateVecs(model.interface.B, nullptr, multiplier.put()));
  check(VecSetValue(multiplier, 0, rank_of(PETSC_COMM_WORLD) == 0 ? r : 0., ADD_VALUES));
  check(VecAssemblyBegin(multiplier));
  check(VecAssemblyEnd(multiplier));
  check(MatMultTranspose(model.interface.B, multiplier, reaction));
  check(VecAXPY(force, -1, reaction));
  double defect = 0;
  check(VecNorm(force, NORM_INFINITY, &defect));
  CHECK(defect < 1e-15);
}

TEST_CASE("a chain without ground springs has one rigid motion")
{
  const auto model = test::mass_spring_chain(7, 2, 3, 0.1, -1);
  const auto u = test::vector_like(model.structure.K, std::vector<double>(7, 1.));
  const auto force = zeros_like(u);
  check(MatMult(model.structure.K, u, force));
  CHECK(all_entries(force) == std::vector<double>(7, 0.));
}
