#pragma once
/// The stability of the sliding equilibrium along the parameter of a branch (src/README.md, section 9.3).
#include "brake_family.hpp"

namespace squeal
{

/// The modes of the band at an equilibrium of the range.
Modes modes_at(const SlidingEquilibrium& sliding, const BrakeBranchProblem& problem);

/// At values spread evenly over the range, and at the scene's own.
std::vector<EquilibriumStability> equilibria_along(BrakeFamily& family, const BrakeBranchProblem& problem);

/// Where modes become unstable or stable, with the frequency of each.
std::vector<BranchEvent> hopf_points(BrakeFamily& family, const BrakeBranchProblem& problem,
                                     const std::vector<EquilibriumStability>& equilibria);

/// The number of unstable modes at a value, from those at the values around it and the Hopf points between them; -1:
/// not known.
int unstable_modes_at(double parameter, const std::vector<EquilibriumStability>& equilibria,
                      const std::vector<BranchEvent>& hopf_points);

} // namespace squeal
