#include "balance.hpp"

namespace squeal
{

bool balances(const Structure& structure, const Interface& interface, Equilibrium& equilibrium)
{
  const auto residual = zeros_like(structure.load);
  double load = 0, stress = 0, defect = 0, stiffness = 0, motion = 0;
  check(MatMult(structure.K, equilibrium.u, residual));
  check(VecNorm(residual, NORM_2, &stress));
  check(VecScale(residual, -1));
  check(VecAXPY(residual, 1, structure.load));
  if (interface.pairs > 0) add_reactions(interface, equilibrium.reactions, residual);
  check(VecNorm(residual, NORM_2, &defect));
  check(VecNorm(structure.load, NORM_2, &load));
  check(VecNorm(equilibrium.u, NORM_2, &motion));
  check(MatNorm(structure.K, NORM_INFINITY, &stiffness));
  equilibrium.force_residual = defect == 0 ? 0 : defect / (load > 0 ? load : stress);
  return equilibrium.force_residual <= 1e-9 || defect <= 4 * PETSC_MACHINE_EPSILON * stiffness * motion;
}

} // namespace squeal
