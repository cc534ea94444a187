#include "squeal/equilibrium/equilibrium.hpp"

#include "load_path.hpp"

namespace squeal
{

namespace
{

/// What nothing touches and nothing loads stays where it is, held or free: the modes of a free body need no support.
bool stays_at_rest(const Structure& structure, const Interface& interface)
{
  double load = 0;
  check(VecNorm(structure.load, NORM_INFINITY, &load));
  return interface.pairs == 0 && load == 0;
}

} // namespace

Equilibria::Equilibria(const EquilibriumOptions& options) : options_(options) {}

Equilibria::~Equilibria() = default;

Equilibrium Equilibria::at(const Structure& structure, const Interface& interface)
{
  Equilibrium equilibrium;
  if (stays_at_rest(structure, interface))
  {
    equilibrium.u = zeros_like(structure.load);
    equilibrium.directions = interface.directions;
    equilibrium.outcome = {OutcomeKind::converged, "", 0, 0};
    return equilibrium;
  }
  equilibrium = find_by_path(operators_for(structure, interface), structure, interface, {expected_, {}});
  if (equilibrium.outcome.kind == OutcomeKind::converged) expected_ = equilibrium.closed;
  return equilibrium;
}

Equilibrium Equilibria::at_offsets(const SlidingEquilibrium& path, const std::vector<double>& offsets)
{
  const auto& [structure, interface, equilibrium] = path;
  const auto rows = static_cast<Eigen::Index>(interface.size());
  StickSlipState from{Eigen::VectorXd::Map(equilibrium.reactions.data(), rows), Eigen::VectorXd::Zero(rows)};
  const PairView<double> slips(from.w, interface.directions);
  for (std::size_t i = 0; i < slips.pairs(); ++i)
    for (std::size_t k = 0; is_undriven(interface, i) && k < slips.tangential(i).size(); ++k)
      slips.tangential(i)[k] = -PairView(offsets, interface.directions).tangential(i)[k];
  return find_by_path(operators_for(structure, interface), structure, interface, {{}, std::move(from)});
}

const PathOperators& Equilibria::operators_for(const Structure& structure, const Interface& interface)
{
  if (!kept_ || kept_->K.get() != structure.K || kept_->B.get() != interface.B ||
      kept_->driven == has_undriven_pairs(interface))
  {
    kept_.reset(); // before the next is made: both may be large
    kept_ = std::make_unique<PathOperators>(path_operators(structure, interface, options_));
    ++factors_;
  }
  return *kept_;
}

Equilibrium find_equilibrium(const Structure& structure, const Interface& interface, const EquilibriumOptions& options)
{
  return Equilibria(options).at(structure, interface);
}

} // namespace squeal
