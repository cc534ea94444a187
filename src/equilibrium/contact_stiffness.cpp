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
  const auto set = [&](PetscInt row, PetscInt column, double value)
  {
    any = any || value != 0;
    if (value != 0 && row >= first && row < last) check(MatSetValue(result, row, column, value, INSERT_VALUES));
  };
  for (std::size_t i = 0; i < closed.size(); ++i)
  {
    if (!closed[i]) continue;
    const double c = compliance_of(interface, i), of_slip = slip_compliance_of(interface, i);
    const PetscInt normal = rows.normal(static_cast<PetscInt>(i));
    if (c > 0) set(normal, normal, 1 / c);
    for (PetscInt k = 1; k < rows.per_pair(); ++k)
    {
      if (of_slip > 0) set(normal + k, normal + k, 1 / of_slip);
      if (c > 0 && part == PairForces::with_friction)
        set(normal + k, normal, mu[i] * e.of(i)[static_cast<std::size_t>(k - 1)] / c);
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

Owned<Mat> damping_of_pairs(const Interface& interface, const std::vector<char>& closed,
                            const std::vector<double>& reactions, FrictionDamping part)
{
  const PairRows<PetscInt> rows(interface.directions);
  const TangentView drive(interface.drive, interface.directions);
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(interface.B, &first, &last));
  Owned<Mat> result;
  check(MatCreateAIJ(comm_of(interface.B), last - first, last - first, PETSC_DETERMINE, PETSC_DETERMINE,
                     interface.directions, nullptr, interface.directions, nullptr,
                     result.put())); // a pair may straddle ranks
  bool any = false;                  // alike on every rank
  for (std::size_t i = 0; i < closed.size(); ++i)
  {
    const double reaction = PairView(reactions, interface.directions).normal(i);
    if (!closed[i] || reaction <= 0) continue;
    const SlidingFriction friction = sliding_friction(interface.friction.of(i), reaction, drive.of(i)); // even in s
    const auto& damping = part == FrictionDamping::whole ? friction.damping : friction.damping_of_speed;
    const PetscInt tangential = rows.tangential(static_cast<PetscInt>(i));
    for (PetscInt k = 0; k < rows.directions; ++k)
      for (PetscInt l = 0; l < rows.directions; ++l)
      {
        const double value = damping[static_cast<std::size_t>(k)][static_cast<std::size_t>(l)];
        any = any || value != 0;
        if (tangential + k >= first && tangential + k < last)
          check(MatSetValue(result, tangential + k, tangential + l, value, INSERT_VALUES));
      }
  }
  if (!any) return {};
  check(MatAssemblyBegin(result, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(result, MAT_FINAL_ASSEMBLY));
  return result;
}

Owned<Mat> friction_damping(const Interface& interface, const std::vector<char>& closed,
                            const std::vector<double>& reactions, FrictionDamping part)
{
  const Owned<Mat> damping = damping_of_pairs(interface, closed, reactions, part);
  if (!damping.get()) return {};
  return project(damping, interface.B, interface.B);
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
