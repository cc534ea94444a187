/// M, C, K and the load on the free degrees of freedom: sums of T_e' A_e T_e over contributions, u_e = T_e q.
///
/// A contribution is that of an element, or lumped: a mass, spring, connector, beam or superelement. Every rank has the
/// mesh, so that it counts the entries of its own rows exactly.
/// Contributions to rows of other ranks are sent at the end of the assembly. All three matrices receive every
/// contribution, zeros included, which gives them one pattern.
#include "squeal/solid/structure.hpp"

#include "contributions.hpp"
#include "local_dofs.hpp"
#include "spin.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

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

/// Counts the entries that elements and lumped contributions give this rank's rows.
RowCounts count_entries(const Mesh& mesh, const DofMap& dofs, const std::vector<Contribution>& lumped)
{
  std::vector<std::vector<PetscInt>> cliques; // those with a row of this rank
  const auto add = [&](std::vector<PetscInt> free)
  {
    const auto own = std::lower_bound(free.begin(), free.end(), dofs.first);
    if (own != free.end() && *own < dofs.last) cliques.push_back(std::move(free));
  };
  for (const Element& element : mesh.elements) add(free_dofs(dofs, nodal_dofs_of(element)));
  for (const Contribution& contribution : lumped) add(free_dofs(dofs, contribution.nodal_dofs));
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

} // namespace

Structure assemble(const NumberedMesh& numbered, const Scene& scene, MPI_Comm comm)
{
  const Mesh& mesh = numbered.mesh;
  const DofMap& dofs = numbered.dofs;
  Structure structure;
  structure.elements = static_cast<std::int64_t>(mesh.elements.size());
  structure.names = dofs.names;
  std::vector<Contribution> lumped;
  on_every_rank(comm, [&] { lumped = lumped_contributions(mesh, scene); });
  {
    const auto counts = count_entries(mesh, dofs, lumped);
    for (Owned<Mat>* A : {&structure.M, &structure.C, &structure.K}) *A = empty_matrix(dofs, counts, comm);
    structure.loss_omega = loss_omega(scene);
    if (structure.loss_omega > 0) structure.K_loss = empty_matrix(dofs, counts, comm);
  }
  const auto add_own_elements = [&]
  {
    for (std::size_t i = 0; i < mesh.elements.size(); ++i)
      if (numbered.partition.element_rank[i] == rank_of(comm))
        add_contribution(structure, dofs, element_contribution(numbered, scene, i));
  };
  on_every_rank(comm, add_own_elements);
  for (const Contribution& contribution : lumped)
    if (rank_of(comm) == 0) add_contribution(structure, dofs, contribution);
  for (Mat A : {structure.M.get(), structure.C.get(), structure.K.get(), structure.K_loss.get()})
  {
    if (!A) continue;
    check(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
    check(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
    mark_symmetric(A);
  }
  add_spin(structure, numbered, scene);
  structure.load = assemble_load(mesh, scene, dofs, comm);
  assemble_preload(structure, numbered, scene, comm);
  return structure;
}

double work_of_step(const Structure& structure)
{
  MatInfo info;
  check(MatGetInfo(structure.K, MAT_GLOBAL_SUM, &info));
  return info.nz_used;
}

} // namespace squeal
