#include "local_dofs.hpp"

#include "squeal/mesh/shapes.hpp"
#include "squeal/solid/element.hpp"

#include <algorithm>

namespace squeal
{

std::vector<PetscInt> nodal_dofs_of(std::span<const int> nodes, int components)
{
  std::vector<PetscInt> result;
  for (const int node : nodes)
    for (int c = 0; c < components; ++c) result.push_back(6 * PetscInt{node} + c);
  return result;
}

std::vector<PetscInt> nodal_dofs_of(const Element& element)
{
  return nodal_dofs_of(nodes_of(element), dofs_per_node(element.shape));
}

std::vector<PetscInt> free_dofs(const DofMap& dofs, const std::vector<PetscInt>& nodal_dofs)
{
  std::vector<PetscInt> result;
  for (const PetscInt nodal_dof : nodal_dofs)
    for (const DofTerm& term : dofs.terms_of(nodal_dof)) result.push_back(term.dof);
  std::sort(result.begin(), result.end());
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

LocalDofs local_dofs(const DofMap& dofs, const std::vector<PetscInt>& nodal_dofs)
{
  LocalDofs local{free_dofs(dofs, nodal_dofs), {}};
  for (std::size_t i = 0; i < nodal_dofs.size(); ++i)
    for (const DofTerm& term : dofs.terms_of(nodal_dofs[i]))
    {
      const auto place = std::lower_bound(local.free.begin(), local.free.end(), term.dof) - local.free.begin();
      local.terms.push_back({static_cast<Eigen::Index>(i), place, term.factor});
    }
  return local;
}

void add_matrix(Mat matrix, const LocalDofs& local, const Eigen::MatrixXd& A)
{
  const auto count = static_cast<PetscInt>(local.free.size());
  Eigen::MatrixXd AT = Eigen::MatrixXd::Zero(A.rows(), count);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> sum(count, count);
  sum.setZero();
  for (const LocalTerm& t : local.terms) AT.col(t.free) += t.factor * A.col(t.nodal);
  for (const LocalTerm& t : local.terms) sum.row(t.free) += t.factor * AT.row(t.nodal);
  check(MatSetValues(matrix, count, local.free.data(), count, local.free.data(), sum.data(), ADD_VALUES));
}

void add_vector(Vec vector, const LocalDofs& local, const Eigen::VectorXd& f)
{
  for (const LocalTerm& t : local.terms)
    check(VecSetValue(vector, local.free[static_cast<std::size_t>(t.free)], t.factor * f(t.nodal), ADD_VALUES));
}

} // namespace squeal
