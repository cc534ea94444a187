#pragma once
/// What an element or a lumped contribution adds to matrices and vectors of the free degrees of freedom:
/// T_e' A T_e and T_e' f, u_e = T_e q.
#include "squeal/solid/dofs.hpp"

#include <Eigen/Core>

namespace squeal
{

/// The first `components` degrees of freedom of each node.
std::vector<PetscInt> nodal_dofs_of(std::span<const int> nodes, int components);

std::vector<PetscInt> nodal_dofs_of(const Element& element);

/// Returns the free degrees of freedom on which the nodal ones depend, ascending.
std::vector<PetscInt> free_dofs(const DofMap& dofs, const std::vector<PetscInt>& nodal_dofs);

/// An entry of T_e.
struct LocalTerm
{
  Eigen::Index nodal = 0; // position in the nodal degrees of freedom
  Eigen::Index free = 0;  // position in the free ones
  double factor = 0;
};

/// T_e of some nodal degrees of freedom.
struct LocalDofs
{
  std::vector<PetscInt> free; // ascending
  std::vector<LocalTerm> terms;
};

LocalDofs local_dofs(const DofMap& dofs, const std::vector<PetscInt>& nodal_dofs);

/// Adds T_e' A T_e; A of any symmetry.
void add_matrix(Mat matrix, const LocalDofs& local, const Eigen::MatrixXd& A);

/// Adds T_e' f.
void add_vector(Vec vector, const LocalDofs& local, const Eigen::VectorXd& f);

} // namespace squeal
