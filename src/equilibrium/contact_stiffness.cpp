#include "squeal/equilibrium/contact_stiffness.hpp"

namespace squeal
{

Owned<Mat> stiffness_of_pairs(const Interface& interface, const std::vector<char>& closed, PairForces part)
{
  const PairRows<PetscInt> rows(interface.directions);
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(interface.B, &first, &last));
  Owned<Mat> result;
  check(MatCreateAIJ(comm_of(interface.B), last - first, last - first, PETSC_DETERMINE, PETSC_DETERMINE, 1, nullptr, 1,
                     nullptr, result.put()));
  bool any = false; // alike on every rank
  for (std::size_t i = 0; i < closed.size(); ++i)
  {
    const double c = compliance_of(interface, i);
    if (!closed[i] || c == 0) continue;
    any = true;
    const PetscInt normal = rows.normal(static_cast<PetscInt>(i));
    for (PetscInt k = 0; k < rows.per_pair(); ++k)
    {
      if (normal + k < first || normal + k >= last || (k > 0 && part == PairForces::normal)) continue;
      const double force = k == 0 ? 1 : mu[i] * e.of(i)[static_cast<std::size_t>(k - 1)];
      check(MatSetValue(result, normal + k, normal, force / c, INSERT_VALUES));
    }
  }
  if (!any) return {};
  check(MatAssemblyBegin(result, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(result, MAT_FINAL_ASSEMBLY));
  return result;
}

Owned<Mat> contact_stiffness(const Interface& interface, const std::vector<char>& closed, PairForces part)
{
  const Owned<Mat> stiffness = stiffness_of_pairs(interface, closed, part);
  if (!stiffness.get()) return {};
  return project(stiffness, interface.B, interface.B);
}

Owned<Mat> compliant_reactions(const Interface& interface, const std::vector<char>& closed)
{
  const PairRows<PetscInt> rows(interface.directions);
  if (interface.compliance.empty()) return {};
  PetscInt own_rows = 0, first = 0, last = 0;
  check(MatGetLocalSize(interface.B, &own_rows, nullptr));
  Owned<Mat> choice, result;
  check(MatCreateAIJ(comm_of(interface.B), PETSC_DECIDE, own_rows, interface.pairs, PETSC_DETERMINE, 1, nullptr, 1,
                     nullptr, choice.put()));
  check(MatGetOwnershipRange(choice, &first, &last));
  for (PetscInt pair = first; pair < last; ++pair)
  {
    const auto i = static_cast<std::size_t>(pair);
    if (closed[i] && compliance_of(interface, i) > 0)
      check(MatSetValue(choice, pair, rows.normal(pair), -1 / compliance_of(interface, i), INSERT_VALUES));
  }
  check(MatAssemblyBegin(choice, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(choice, MAT_FINAL_ASSEMBLY));
  check(MatMatMult(choice, interface.B, MAT_INITIAL_MATRIX, PETSC_DEFAULT, result.put()));
  return result;
}

} // namespace squeal
