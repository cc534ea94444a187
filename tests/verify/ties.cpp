// ranks: 1 2 3
// Ties of bricks meshed 3:2: rigid motions without strain, constant stress without force, all of the mass.
#include "../support/bricks.hpp"
#include "squeal/mesh/contact_pairs.hpp"

#include <doctest/doctest.h>

using namespace squeal;
using namespace squeal::test;

namespace
{

struct Tied
{
  Mesh mesh;
  Scene scene;
};

/// Two boxes on each other, `slave` cells on the upper one's face; the lower one reaches over by `over` on two sides.
Tied tied_boxes(const Cells& lower, const Cells& upper, double over)
{
  Tied tied;
  Mesh low, high;
  add_box(low, "low", 0, {-over, -over, -2}, {1 + over, 1 + over, 0}, lower);
  add_box(high, "high", 1, {0, 0, 0}, {1, 1, 1.5}, upper);
  append(tied.mesh, low);
  append(tied.mesh, high);
  for (const char* name : {"low", "high"}) tied.scene.parts.push_back({name, {2e9, 0.3, 1500}, 0, {}});
  tied.scene.ties.push_back({"high:z-", "low:z+", 0});
  return tied;
}

double size_of(Mat A, Vec x)
{
  double norm = 0, length = 0;
  check(MatNorm(A, NORM_INFINITY, &norm));
  check(VecNorm(x, NORM_INFINITY, &length));
  return norm * length;
}

} // namespace

TEST_CASE("a tied body moves rigidly without strain, and weighs what its parts do")
{
  for (const auto& [lower, upper] : {std::pair{Cells{2, 2, 2}, Cells{3, 3, 2}}, {Cells{3, 2, 2}, Cells{2, 5, 1}}})
    for (const double over : {0., 0.3})
    {
      const Tied tied = tied_boxes(lower, upper, over);
      const Built built = build(tied.mesh, tied.scene, PETSC_COMM_WORLD);
      PetscInt dofs = 0;
      check(VecGetSize(built.structure.load, &dofs));
      const auto nodes = [](const Cells& c) { return (c[0] + 1) * (c[1] + 1) * (c[2] + 1); };
      CHECK(dofs == 3 * (nodes(lower) + nodes(upper) - (upper[0] + 1) * (upper[1] + 1)));
      for (int axis = 0; axis < 6; ++axis)
      {
        const auto u = sample(built.structure, unit_rigid_motion(axis));
        CHECK(largest_of_product(built.structure.K, u) < 1e-14 * size_of(built.structure.K, u)); // rounding of a row
        const double side = 1 + 2 * over, mass = 1500 * (2 * side * side + 1.5);
        if (axis < 3) CHECK(std::abs(form(built.structure.M, u, u) / mass - 1) < 1e-12);
      }
    }
}

TEST_CASE("constant stress passes a tie: no force is left inside")
{
  const Tied tied = tied_boxes({2, 3, 2}, {3, 4, 2}, 0);
  const Built built = build(tied.mesh, tied.scene, PETSC_COMM_WORLD);
  const Field strain = [](const Vec3& x) -> std::array<double, 6>
  { return {1e-3 * x[0] + 2e-4 * x[2], -3e-4 * x[1] + 1e-4 * x[2], 5e-4 * x[2] + 3e-4 * x[0], 0, 0, 0}; };
  const auto u = sample(built.structure, strain), force = zeros_like(u);
  check(MatMult(built.structure.K, u, force));
  const DofNames& names = built.structure.names;
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(force, &first, &last));
  const PetscScalar* values = nullptr;
  check(VecGetArrayRead(force, &values));
  double inside = 0;
  for (PetscInt dof = first; dof < last; ++dof)
  {
    const Vec3& x = names.at[static_cast<std::size_t>(names.nodal_dof[static_cast<std::size_t>(dof)] / 6)];
    const auto between = [](double s, double low, double high) { return s > low + 1e-9 && s < high - 1e-9; };
    if (between(x[0], 0, 1) && between(x[1], 0, 1) && between(x[2], -2, 1.5))
      inside = std::max(inside, std::abs(values[dof - first]));
  }
  check(VecRestoreArrayRead(force, &values));
  CHECK(inside < 1e-10 * 2e9 * 1e-3); // of a stress on a unit face
}

TEST_CASE("ties that contradict each other are refused, with the remedy")
{
  const auto message = [](const Tied& tied)
  {
    try
    {
      (void)tied_nodes(tied.mesh, tied.scene);
    }
    catch (const Error& error)
    {
      return std::string(error.what());
    }
    return std::string();
  };
  Tied twice = tied_boxes({2, 2, 2}, {3, 3, 2}, 0);
  twice.scene.ties.push_back(twice.scene.ties[0]);
  CHECK(message(twice).find("a slave surface of its own") != std::string::npos);
  Tied both = tied_boxes({2, 2, 2}, {3, 3, 2}, 0);
  both.scene.ties.push_back({"low:z+", "high:z-", 0});
  CHECK(message(both).find("exchange slave and master of one") != std::string::npos);
  Tied aside = tied_boxes({2, 2, 2}, {3, 3, 2}, 0);
  aside.scene.ties[0].master = "low:z-";
  CHECK(message(aside).find("correct the names or the mesh") != std::string::npos);
  Tied missing = tied_boxes({2, 2, 2}, {3, 3, 2}, 0);
  missing.scene.ties[0].master = "low:z";
  CHECK(message(missing).find("low:z") != std::string::npos);
}
