#include "squeal/equilibrium/linearised_sliding.hpp"

namespace squeal
{

namespace
{

/// A matrix on the rows of B with what add_pair(pair, first row, set) sets for the closed pairs; null where all is
/// zero. Collective.
template <class AddPair>
Owned<Mat> on_pair_rows(const Interface& interface, const std::vector<char>& closed, AddPair add_pair)
{
  const PairRows<PetscInt> rows(interface.directions);
  const IndexRange range = own_rows(interface.B);
  std::vector<SparseRow> own(static_cast<std::size_t>(range.size())); // a pair may straddle ranks
  bool any = false;                                                   // alike on every rank
  const auto set = [&](PetscInt row, PetscInt column, double value)
  {
    any = any || value != 0;
    if (value != 0 && range.holds(row)) own[static_cast<std::size_t>(row - range.first)][column] = value;
  };
  for (std::size_t i = 0; i < closed.size(); ++i)
    if (closed[i]) add_pair(i, rows.normal(static_cast<PetscInt>(i)), set);
  return any ? matrix_of_rows(own, range.size(), comm_of(interface.B)) : Owned<Mat>();
}

} // namespace

Owned<Mat> stiffness_of_pairs(const Interface& interface, const std::vector<char>& closed, PairForces part)
{
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  const auto add_pair = [&](std::size_t i, PetscInt normal, const auto& set)
  {
    const double c = compliance_of(interface, i), of_slip = slip_compliance_of(interface, i);
    if (c > 0) set(normal, normal, 1 / c);
    for (PetscInt k = 1; k <= interface.directions; ++k)
    {
      if (of_slip > 0) set(normal + k, normal + k, 1 / of_slip);
      if (c > 0 && part == PairForces::with_friction)
        set(normal + k, normal, mu[i] * e.of(i)[static_cast<std::size_t>(k - 1)] / c);
    }
  };
  return on_pair_rows(interface, closed, add_pair);
}

Owned<Mat> contact_stiffness(const Interface& interface, const std::vector<char>& closed, PairForces part)
{
  return project(stiffness_of_pairs(interface, closed, part), interface.B, interface.B);
}

Owned<Mat> damping_of_pairs(const Interface& interface, const std::vector<char>& closed,
                            const std::vector<double>& reactions, FrictionDamping part)
{
  const TangentView drive(interface.drive, interface.directions);
  const auto add_pair = [&](std::size_t i, PetscInt normal, const auto& set)
  {
    const double reaction = PairView(reactions, interface.directions).normal(i);
    if (reaction <= 0) return;
    const SlidingFriction friction = sliding_friction(interface.friction.of(i), reaction, drive.of(i)); // even in s
    const auto& damping = part == FrictionDamping::whole ? friction.damping : friction.damping_of_speed;
    for (PetscInt k = 0; k < interface.directions; ++k)
      for (PetscInt l = 0; l < interface.directions; ++l)
        set(normal + 1 + k, normal + 1 + l, damping[static_cast<std::size_t>(k)][static_cast<std::size_t>(l)]);
  };
  return on_pair_rows(interface, closed, add_pair);
}

Owned<Mat> friction_damping(const Interface& interface, const std::vector<char>& closed,
                            const std::vector<double>& reactions, FrictionDamping part)
{
  return project(damping_of_pairs(interface, closed, reactions, part), interface.B, interface.B);
}

} // namespace squeal
