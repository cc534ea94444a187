/// M, C, K and the load on the free degrees of freedom: sums of T_e' A_e T_e over contributions, u_e = T_e q.
///
/// A contribution is that of an element, or lumped: the mass of a point or rigid body, a spring, a superelement. A rank
/// has all elements that share a degree of freedom with it, so that it counts the entries of its own rows exactly.
/// Contributions to rows of other ranks are sent at the end of the assembly. All three matrices receive every
/// contribution, zeros included, which gives them one pattern.
///
/// The load is T' f: a force is shared equally by its nodes; a pressure p is -p times the integral of N_i n dA, n
/// outward. The share of a fixed degree of freedom is carried by its support.
#include "squeal/solid/structure.hpp"

#include "local_dofs.hpp"
#include "spin.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/packed.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/mesh/shapes.hpp"
#include "squeal/solid/binary.hpp"
#include "squeal/solid/element.hpp"

#include <algorithm>
#include <Eigen/Dense>

namespace squeal
{

namespace
{

/// Matrices on the nodal degrees of freedom of a few nodes.
struct Contribution
{
  std::vector<PetscInt> nodal_dofs;
  Eigen::MatrixXd M, C, K; // units as in Structure
  double loss_factor = 0;  // [-]
};

/// `inertia` is xx yy zz xy yz zx [kg m2].
Contribution mass_contribution(int node, double mass, const std::array<double, 6>& inertia)
{
  const auto& [xx, yy, zz, xy, yz, zx] = inertia;
  Contribution result{nodal_dofs_of(std::span(&node, 1), 6), Eigen::MatrixXd::Zero(6, 6), Eigen::MatrixXd::Zero(6, 6),
                      Eigen::MatrixXd::Zero(6, 6)};
  result.M.diagonal().head<3>().setConstant(mass);
  result.M.bottomRightCorner<3, 3>() << xx, xy, zx, xy, yy, yz, zx, yz, zz;
  return result;
}

/// The elongation d . (u_to - u_from) of a spring gives K = k s s', with s the elongations of unit displacements. The
/// ground does not move.
Contribution spring_contribution(const Mesh& mesh, const Spring& spring)
{
  const Eigen::Vector3d direction(spring.direction.data());
  std::vector<int> nodes;
  Eigen::VectorXd s;
  for (const auto& [name, sign] : {std::pair{spring.from, -1.}, std::pair{spring.to, 1.}})
  {
    if (name == ground) continue;
    nodes.push_back(point_node(mesh, name, "spring from " + spring.from + " to " + spring.to));
    s.conservativeResize(s.size() + 3);
    s.tail<3>() = sign * direction;
  }
  const Eigen::MatrixXd square = s * s.transpose();
  return {nodal_dofs_of(nodes, 3), 0 * square, spring.damping * square, spring.stiffness * square};
}

/// Returns a small matrix in a file, whole. Throws Error unless it is symmetric and of this order.
Eigen::MatrixXd small_matrix(const std::filesystem::path& file, Eigen::Index order)
{
  const MatrixSize size = check_matrix_file(file, PETSC_COMM_SELF);
  if (size.rows != order || size.columns != order)
    throw Error(file.string() + ": " + std::to_string(size.rows) + " x " + std::to_string(size.columns) +
                ", but dofs.txt beside it has " + std::to_string(order) + " lines");
  const Eigen::MatrixXd A = dense_copy(load_matrix(file, size, size, PETSC_COMM_SELF));
  constexpr double rounding = 1e-9; // of exported matrices
  if ((A - A.transpose()).cwiseAbs().maxCoeff() > rounding * A.cwiseAbs().maxCoeff())
    throw Error(file.string() + ": not symmetric");
  return A;
}

Contribution superelement_contribution(const std::vector<SuperelementRow>& rows, const std::filesystem::path& folder,
                                       const RayleighDamping& damping)
{
  for (const char* other : {"F.petsc", "G.petsc", "H.petsc"})
    if (is_file(folder / other))
      throw Error((folder / other).string() + ": a superelement has M, K and C alone: remove the file, and put forces "
                                              "into [[force]] by node");
  Contribution added;
  for (const SuperelementRow& row : rows) added.nodal_dofs.push_back(6 * PetscInt{row.node} + row.motion);
  const auto order = static_cast<Eigen::Index>(added.nodal_dofs.size());
  added.M = small_matrix(folder / "M.petsc", order);
  added.K = small_matrix(folder / "K.petsc", order);
  if (is_file(folder / "C.petsc"))
    added.C = small_matrix(folder / "C.petsc", order);
  else
    added.C = damping.alpha * added.M + damping.beta * added.K;
  return added;
}

std::vector<Contribution> lumped_contributions(const Mesh& mesh, const Scene& scene)
{
  std::vector<Contribution> result;
  for (const Point& point : scene.points)
    result.push_back(mass_contribution(point_node(mesh, point.name, "point"), point.mass, {}));
  for (const RigidBody& body : scene.rigid_bodies)
    result.push_back(mass_contribution(point_node(mesh, body.name, "rigid body"), body.mass, body.inertia));
  for (const Spring& spring : scene.springs) result.push_back(spring_contribution(mesh, spring));
  for (std::size_t i = 0; i < mesh.superelements.size(); ++i)
    result.push_back(superelement_contribution(mesh.superelements[i], scene.superelements[i].folder, scene.damping));
  return result;
}

void add_contribution(const Structure& structure, const DofMap& dofs, const Contribution& contribution)
{
  const LocalDofs local = local_dofs(dofs, contribution.nodal_dofs);
  add_matrix(structure.M, local, contribution.M);
  add_matrix(structure.C, local, contribution.C);
  add_matrix(structure.K, local, contribution.K);
  if (structure.K_loss.get()) add_matrix(structure.K_loss, local, contribution.loss_factor * contribution.K);
}

/// Number of entries of each of this rank's rows, in the columns it owns and in the others.
struct RowCounts
{
  std::vector<PetscInt> own, other;
};

/// Counts the entries of rows where each clique of degrees of freedom fills all its rows and columns.
RowCounts count_entries(const DofMap& dofs, const std::vector<std::vector<PetscInt>>& cliques)
{
  const PetscInt rows = dofs.last - dofs.first;
  const auto owns = [&](PetscInt dof) { return dof >= dofs.first && dof < dofs.last; };
  std::vector<std::vector<std::size_t>> cliques_of(rows);
  for (std::size_t i = 0; i < cliques.size(); ++i)
    for (const PetscInt dof : cliques[i])
      if (owns(dof)) cliques_of[dof - dofs.first].push_back(i);
  RowCounts counts{std::vector<PetscInt>(rows, 0), std::vector<PetscInt>(rows, 0)};
  std::vector<PetscInt> last_row(dofs.size, -1); // the last row in which a column was counted
  for (PetscInt row = 0; row < rows; ++row)
    for (const std::size_t clique : cliques_of[row])
      for (const PetscInt dof : cliques[clique])
        if (last_row[dof] != row)
        {
          last_row[dof] = row;
          ++(owns(dof) ? counts.own : counts.other)[row];
        }
  return counts;
}

/// The free degrees of freedom of each of rank 0's contributions, on every rank.
std::vector<std::vector<PetscInt>> free_dofs_of(const DofMap& dofs, const std::vector<Contribution>& lumped,
                                                MPI_Comm comm)
{
  std::vector<std::vector<PetscInt>> result;
  for (const Contribution& contribution : lumped) result.push_back(free_dofs(dofs, contribution.nodal_dofs));
  broadcast_packed(result, comm);
  return result;
}

/// Counts the entries that elements and lumped contributions, by their free degrees of freedom, give this rank's rows.
RowCounts count_entries(const Mesh& mesh, const DofMap& dofs, std::vector<std::vector<PetscInt>> lumped)
{
  std::vector<std::vector<PetscInt>> cliques; // those with a row of this rank
  const auto add = [&](std::vector<PetscInt> free)
  {
    const auto own = std::lower_bound(free.begin(), free.end(), dofs.first);
    if (own != free.end() && *own < dofs.last) cliques.push_back(std::move(free));
  };
  for (const Element& element : mesh.elements) add(free_dofs(dofs, nodal_dofs_of(element)));
  for (std::vector<PetscInt>& free : lumped) add(std::move(free));
  return count_entries(dofs, cliques);
}

Owned<Mat> empty_matrix(const DofMap& dofs, const RowCounts& counts, MPI_Comm comm)
{
  Owned<Mat> A;
  const PetscInt rows = dofs.last - dofs.first;
  check(MatCreate(comm, A.put()));
  check(MatSetSizes(A, rows, rows, dofs.size, dofs.size));
  check(MatSetType(A, MATAIJ));
  check(MatXAIJSetPreallocation(A, 1, counts.own.data(), counts.other.data(), nullptr, nullptr));
  return A;
}

double loss_omega(const Scene& scene)
{
  return two_pi * scene.damping.loss_frequency;
}

/// Returns the contribution of an element. Throws std::runtime_error with its part and place if its Jacobian is not
/// positive.
Contribution element_contribution(const MeshPiece& piece, const Scene& scene, std::size_t index)
{
  const Element& element = piece.mesh.elements[index];
  const Part& part = scene.parts[element.part];
  const std::vector<Vec3> x = positions_of(piece.mesh, element);
  try
  {
    ElementMatrices matrices = element_matrices(element.shape, x, part.material, part.thickness);
    const RayleighDamping damping = part.damping.value_or(scene.damping);
    Eigen::MatrixXd C = damping.alpha * matrices.mass + damping.beta * matrices.stiffness;
    if (part.loss_factor > 0) C += part.loss_factor / loss_omega(scene) * matrices.stiffness;
    return {nodal_dofs_of(element), std::move(matrices.mass), std::move(C), std::move(matrices.stiffness),
            part.loss_factor};
  }
  catch (const std::runtime_error& error)
  {
    const bool whole = piece.element_numbers.empty();
    const int number = whole ? static_cast<int>(index) : piece.element_numbers[index], node = element.nodes[0];
    throw Error("part " + part.name + ", element " + std::to_string(number) + " with " +
                node_text(whole ? node : piece.node_numbers[static_cast<std::size_t>(node)], x[0]) + ": " +
                error.what());
  }
}

void add_force(Vec load, const DofMap& dofs, int node, const Vec3& force)
{
  for (int c = 0; c < 3; ++c)
    for (const DofTerm& term : dofs.terms_of(6 * PetscInt{node} + c))
      check(VecSetValue(load, term.dof, force[c] * term.factor, ADD_VALUES));
}

void add_pressure(Vec load, const DofMap& dofs, const Mesh& mesh, const Face& face, double pressure)
{
  std::vector<Vec3> x;
  for (const int node : nodes_of(face)) x.push_back(mesh.nodes[node]);
  const auto weights = face_weights(face.shape, x);
  for (std::size_t i = 0; i < weights.size(); ++i) add_force(load, dofs, face.nodes[i], -pressure * weights[i]);
}

/// Throws Error for a force of which every part acts on a motion that is held.
void check_acts(const DofMap& dofs, const std::vector<int>& nodes, const Force& force)
{
  if (force.vector == Vec3{}) return;
  for (const int node : nodes)
    for (int c = 0; c < 3; ++c)
      if (force.vector[c] != 0 && !dofs.terms_of(6 * PetscInt{node} + c).empty()) return;
  throw Error("force on " + force.on +
              format(": the vector (%g, %g, %g) N", force.vector[0], force.vector[1], force.vector[2]) +
              " acts on motions only that are held, so it would do nothing: free one of them, or remove the force");
}

} // namespace

Owned<Vec> assemble_load(const Mesh& mesh, const Scene& scene, const DofMap& dofs, MPI_Comm comm)
{
  Owned<Vec> load;
  check(VecCreate(comm, load.put()));
  check(VecSetSizes(load, dofs.last - dofs.first, dofs.size));
  check(VecSetType(load, VECSTANDARD));
  const auto add_all = [&]
  {
    for (const Force& force : scene.forces)
    {
      const auto nodes = named_nodes(mesh, force.on, "force");
      check_acts(dofs, nodes, force);
      for (const int node : nodes) add_force(load, dofs, node, (1. / static_cast<double>(nodes.size())) * force.vector);
    }
    for (const Pressure& pressure : scene.pressures)
      for (const Face& face : named_faces(mesh, pressure.on, "pressure"))
        add_pressure(load, dofs, mesh, face, pressure.value);
  };
  on_rank_zero(comm, add_all);
  check(VecAssemblyBegin(load));
  check(VecAssemblyEnd(load));
  return load;
}

Structure assemble(const MeshPiece& piece, const Scene& scene, MPI_Comm comm)
{
  const Mesh& mesh = piece.mesh;
  const DofMap& dofs = piece.dofs;
  Structure structure;
  const std::int64_t own = std::ranges::count(piece.partition.element_rank, rank_of(comm));
  MPI_Allreduce(&own, &structure.elements, 1, MPI_INT64_T, MPI_SUM, comm);
  structure.names = dofs.names;
  std::vector<Contribution> lumped; // on rank 0
  on_rank_zero(comm, [&] { lumped = lumped_contributions(mesh, scene); });
  {
    const auto counts = count_entries(mesh, dofs, free_dofs_of(dofs, lumped, comm));
    for (Owned<Mat>* A : {&structure.M, &structure.C, &structure.K}) *A = empty_matrix(dofs, counts, comm);
    structure.loss_omega = loss_omega(scene);
    if (structure.loss_omega > 0) structure.K_loss = empty_matrix(dofs, counts, comm);
  }
  const auto add_own_elements = [&]
  {
    for (std::size_t i = 0; i < mesh.elements.size(); ++i)
      if (piece.partition.element_rank[i] == rank_of(comm))
        add_contribution(structure, dofs, element_contribution(piece, scene, i));
  };
  on_every_rank(comm, add_own_elements);
  for (const Contribution& contribution : lumped) add_contribution(structure, dofs, contribution);
  for (Mat A : {structure.M.get(), structure.C.get(), structure.K.get(), structure.K_loss.get()})
  {
    if (!A) continue;
    check(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
    check(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
    mark_symmetric(A);
  }
  add_spin(structure, piece, scene);
  structure.load = assemble_load(mesh, scene, dofs, comm);
  return structure;
}

double work_of_step(const Structure& structure)
{
  MatInfo info;
  check(MatGetInfo(structure.K, MAT_GLOBAL_SUM, &info));
  return info.nz_used;
}

} // namespace squeal
