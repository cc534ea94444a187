/// With the velocity v_0 = rate axis x (x - centre) of the particles of a part that spins, and d = (v_0 . grad) U:
///     G = int rho (U' d - d' U) dV,     K_c = - int rho d' d dV,     K_sigma = int (grad U)' sigma (grad U) dV,
/// with sigma the stress under the centrifugal force int rho d' v_0 dV. K_sigma and K_c cancel for rigid rotations,
/// whatever the mesh, since sigma balances that force on the same functions and points.
#include "contributions.hpp"

#include "squeal/algebra/shift_invert.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/solid/element.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

bool spins(const Part& part)
{
  return part.rotation && part.rotation->rate != 0;
}

/// The outer faces of a part: corner nodes, counter-clockwise seen from outside.
std::vector<std::vector<int>> outer_faces(const Mesh& mesh, int part)
{
  std::map<std::vector<int>, std::vector<int>> faces; // by ascending corners; two elements share the others
  for (const Element& element : mesh.elements)
  {
    if (element.part != part) continue;
    for (std::vector<int>& face : faces_of(element))
    {
      std::vector<int> key = face;
      std::ranges::sort(key);
      if (const auto [known, is_new] = faces.try_emplace(std::move(key), std::move(face)); !is_new) faces.erase(known);
    }
  }
  std::vector<std::vector<int>> outer;
  for (auto& [key, face] : faces) outer.push_back(std::move(face));
  return outer;
}

/// How far a face is turned from its circle about the axis.
struct Turned
{
  Vec3 at{};         // [m] its centre
  double angle = 0;  // [rad] between v_0 and the face at its centre
  double within = 0; // [rad] that the face spans about the axis
  double radius = 0; // [m] of its outermost corner
  double area = 0;   // [m2]
};

Turned turned_from_circle(std::span<const Vec3> x, const Rotation& rotation)
{
  std::vector<Vec3> radius;
  Turned turned;
  for (const Vec3& corner : x)
  {
    turned.at = turned.at + 1. / static_cast<double>(x.size()) * corner;
    const Vec3 arm = corner - rotation.centre;
    radius.push_back(arm - dot(arm, rotation.axis) * rotation.axis);
  }
  const Vec3 normal = x.size() == 3 ? cross(x[1] - x[0], x[2] - x[0]) : cross(x[2] - x[0], x[3] - x[1]),
             along = cross(rotation.axis, turned.at - rotation.centre);
  turned.area = norm(normal) / 2;
  for (const Vec3& arm : radius) turned.radius = std::max(turned.radius, norm(arm));
  const double scale = norm(normal) * norm(along);
  if (scale > 0) turned.angle = std::asin(std::min(1., std::abs(dot(normal, along)) / scale));
  for (const Vec3& a : radius)
    for (const Vec3& b : radius) turned.within = std::max(turned.within, std::atan2(norm(cross(a, b)), dot(a, b)));
  return turned;
}

/// Throws Error unless each outer face is tangential to circles about the axis, and the middle of all of them on it. A
/// face with its corners on a surface of revolution has the normal of a point within it. At its centre it is turned by
/// less than half of the angle that it spans, a right-angled triangle by a sixth, a quadrilateral hardly.
void check_revolution(const Mesh& mesh, const Part& part, int index)
{
  constexpr double rounding = 1e-3; // [rad] of meshed coordinates
  constexpr double off_axis = 0.02; // of the largest radius: more than uneven meshes are
  constexpr double degrees = 180 / std::numbers::pi;
  const auto refusal = [&](const std::string& why)
  {
    return Error("[[part]] " + part.name + ": rotation needs a solid of revolution about its axis, but " + why +
                 ": correct axis and centre, leave holes and slots out of the mesh, or take the rotation out");
  };
  Vec3 middle{};
  double area = 0, radius = 0;
  for (const std::vector<int>& face : outer_faces(mesh, index))
  {
    const Turned turned = turned_from_circle(positions_of(mesh, face), *part.rotation);
    if (turned.angle > turned.within / 2 + rounding)
      throw refusal(format("the face at (%g, %g, %g) is turned by %.1f degrees from its circle and spans %.1f",
                           turned.at[0], turned.at[1], turned.at[2], turned.angle * degrees, turned.within * degrees));
    middle = middle + turned.area * (turned.at - part.rotation->centre);
    area += turned.area;
    radius = std::max(radius, turned.radius);
  }
  const Vec3& axis = part.rotation->axis;
  const double off = norm(middle - dot(middle, axis) * axis) / area;
  if (off > off_axis * radius)
    throw refusal(format("the middle of its surface is %.3g m off the axis, of a radius of %.3g m", off, radius));
}

/// An element of this rank that spins.
struct Spinning
{
  const Element& element;
  const Part& part;
  std::vector<Vec3> x; // [m]
  LocalDofs local;
};

std::vector<Spinning> spinning_elements(const NumberedMesh& numbered, const Scene& scene)
{
  std::vector<Spinning> result;
  for (const std::size_t i : elements_here(numbered))
  {
    const Element& element = numbered.mesh.elements[i];
    const Part& part = scene.parts[static_cast<std::size_t>(element.part)];
    if (!spins(part)) continue;
    result.push_back({element, part, positions_of(numbered.mesh, nodes_of(element)),
                      local_dofs(numbered.dofs, nodal_dofs_of(element), AddedRows::own)});
  }
  return result;
}

double trace(Mat A)
{
  PetscScalar sum = 0;
  check(MatGetTrace(A, &sum));
  return sum;
}

/// K^-1 force. The force is balanced on every body that nothing holds, so that it moves none: K - shift M is factored
/// instead, and the residual is solved for until it vanishes.
std::vector<double> displacements(const Structure& structure, Vec force)
{
  constexpr int passes = 50;
  constexpr double enough = 1e-6, rounding = 1e-13;
  const double size = norm_of(force, NORM_2);
  double now = size, last = HUGE_VAL;
  PencilFactor factor(structure.K, structure.M, Keep::factor, {});
  factor.factorise(-1e-8 * trace(structure.K) / trace(structure.M)); // below every eigenvalue of K x = theta M x
  const Owned<Vec> u = zeros_like(force), residual = zeros_like(force), change = zeros_like(force);
  check(VecCopy(force, residual));
  for (int pass = 0; pass < passes && now > rounding * size && now <= last / 2; ++pass)
  {
    last = now;
    copy_column(factor.solve(columns_of(std::array<Vec, 1>{residual})), 0, change);
    check(VecAXPY(u, 1, change));
    check(MatMult(structure.K, u, residual));
    check(VecAYPX(residual, -1, force));
    now = norm_of(residual, NORM_2);
  }
  if (!(std::min(last, now) <= enough * size))
    throw Error(format("rotation of parts: the centrifugal force is not balanced: the residual stays at %.1e of it",
                       now / size));
  return all_entries(u);
}

/// The displacements of an element's nodes, from all free degrees of freedom.
Eigen::VectorXd of_nodes(const LocalDofs& local, const std::vector<double>& u, std::size_t order)
{
  Eigen::VectorXd result = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(order));
  for (const LocalTerm& t : local.terms)
    result(t.nodal) += t.factor * u[static_cast<std::size_t>(local.free[static_cast<std::size_t>(t.free)])];
  return result;
}

} // namespace

void add_spin(Structure& structure, const NumberedMesh& numbered, const Scene& scene)
{
  if (std::ranges::none_of(scene.parts, spins)) return;
  const MPI_Comm comm = comm_of(structure.K);
  const auto check_all = [&]
  {
    for (std::size_t i = 0; i < scene.parts.size(); ++i)
      if (spins(scene.parts[i])) check_revolution(numbered.mesh, scene.parts[i], static_cast<int>(i));
  };
  on_rank_zero(comm, check_all);
  const std::vector<Spinning> elements = spinning_elements(numbered, scene);

  Owned<Mat> centrifugal;
  const Owned<Vec> force = vector_of_rows(structure.K);
  check(VecSet(force, 0));
  for (Owned<Mat>* A : {&structure.G, &centrifugal}) check(MatDuplicate(structure.K, MAT_DO_NOT_COPY_VALUES, A->put()));
  for (const Spinning& of : elements)
  {
    const SpinMatrices spin = spin_matrices(of.element.shape, of.x, of.part.material, *of.part.rotation);
    add_matrix(structure.G, of.local, spin.gyroscopic);
    add_matrix(centrifugal, of.local, spin.centrifugal);
    add_vector(force, of.local, spin.force);
  }
  finish(structure.G);
  finish(force);
  const std::vector<double> u = displacements(structure, force);
  for (const Spinning& of : elements)
  {
    const Eigen::VectorXd own = of_nodes(of.local, u, 3 * of.x.size());
    add_matrix(centrifugal, of.local,
               stress_stiffness(of.element.shape, of.x, of.part.material,
                                std::span(own.data(), static_cast<std::size_t>(own.size()))));
  }
  finish(centrifugal);
  check(MatAXPY(structure.K, 1, centrifugal, SAME_NONZERO_PATTERN));
  mark_symmetric(structure.K);
}

} // namespace squeal
