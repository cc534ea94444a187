/// M, C, K and the load on the free degrees of freedom: sums of T_e' A_e T_e over contributions, u_e = T_e q.
///
/// A contribution is that of an element, or lumped: a mass, spring, connector, beam or superelement. Every rank
/// computes the elements that add to its rows. What is lumped is sent by rank 0 at the end of the assembly. All three
/// matrices receive every contribution, zeros included, which gives them one pattern.
#include "squeal/solid/structure.hpp"

#include "contributions.hpp"

namespace squeal
{

namespace
{

void add_contribution(const Structure& structure, const DofMap& dofs, const Contribution& contribution, AddedRows added)
{
  const LocalDofs local = local_dofs(dofs, contribution.nodal_dofs, added);
  add_matrix(structure.M, local, contribution.M);
  add_matrix(structure.C, local, contribution.C);
  add_matrix(structure.K, local, contribution.K);
  if (structure.K_loss.get()) add_matrix(structure.K_loss, local, contribution.loss_factor * contribution.K);
}

/// A matrix of zeros with the pattern of all contributions, as PETSc counts it.
Owned<Mat> zero_matrix(const NumberedMesh& numbered, const Scene& scene, MPI_Comm comm)
{
  const DofMap& dofs = numbered.dofs;
  const PetscInt rows = dofs.last - dofs.first;
  Owned<Mat> pattern, A;
  for (const auto& [matrix, type] : {std::pair{&pattern, MATPREALLOCATOR}, std::pair{&A, MATAIJ}})
  {
    check(MatCreate(comm, matrix->put()));
    check(MatSetSizes(*matrix, rows, rows, dofs.size, dofs.size));
    check(MatSetType(*matrix, type));
  }
  check(MatSetUp(pattern));
  const auto add = [&](const std::vector<PetscInt>& nodal_dofs, AddedRows added)
  {
    const LocalDofs local = local_dofs(dofs, nodal_dofs, added);
    const auto count = static_cast<PetscInt>(local.free.size());
    check(MatSetValues(pattern, count, local.rows.data(), count, local.free.data(), nullptr, INSERT_VALUES));
  };
  for (const std::size_t i : elements_here(numbered)) add(nodal_dofs_of(numbered.mesh.elements[i]), AddedRows::own);
  const auto add_lumped = [&]
  {
    for (const Contribution& lumped : lumped_contributions(numbered.mesh, scene))
      add(lumped.nodal_dofs, AddedRows::all);
  };
  on_rank_zero(comm, add_lumped);
  finish(pattern);
  check(MatPreallocatorPreallocate(pattern, PETSC_TRUE, A));
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
  structure.M = zero_matrix(numbered, scene, comm);
  structure.loss_omega = loss_omega(scene);
  for (Owned<Mat>* A : {&structure.C, &structure.K}) *A = copy_of(structure.M);
  if (structure.loss_omega > 0) structure.K_loss = copy_of(structure.M);
  for_each_contribution(numbered, scene, comm,
                        [&](const Contribution& contribution, AddedRows added)
                        { add_contribution(structure, dofs, contribution, added); });
  for (Mat A : {structure.M.get(), structure.C.get(), structure.K.get(), structure.K_loss.get()})
  {
    if (!A) continue;
    finish(A);
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
