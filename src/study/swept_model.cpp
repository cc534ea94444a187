#include "swept_model.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

/// Place of the friction coefficient among the swept numbers; -1: it is none of them.
int friction_place(const SweepSettings& settings)
{
  const auto found = std::ranges::find(settings.key, "friction.coefficient");
  return found == settings.key.end() ? -1 : static_cast<int>(found - settings.key.begin());
}

/// The values without that of the friction coefficient: a model is built again where they change.
std::vector<double> without_friction(std::vector<double> values, const SweepSettings& settings)
{
  if (const int place = friction_place(settings); place >= 0) values.erase(values.begin() + place);
  return values;
}

} // namespace

SweptModel::SweptModel(const SweepProblem& problem)
    : problem_(problem), equilibrium_options_(problem.equilibrium_options)
{
  // the independent fixed point is a check of single runs
  if (equilibrium_options_.check_max_iterations < 0) equilibrium_options_.check_max_iterations = 0;
}

void SweptModel::go_to(const Point& point)
{
  if (model_ && at_ == point) return;
  const SweepSettings& settings = problem_.settings;
  if (!model_ || without_friction(at_.first, settings) != without_friction(point.first, settings))
  {
    model_.reset();
    model_ = problem_.model_at(point.first);
    at_ = {point.first, false};
  }
  Interface& interface = model_->interface;
  if (const int place = friction_place(settings); place >= 0)
    interface.friction.coefficient = point.first[static_cast<std::size_t>(place)];
  if (at_.second != point.second)
    for (double& velocity : interface.drive) velocity = -velocity;
  at_ = point;
}

const PairCompliance& SweptModel::compliance()
{
  const auto& [structure, interface] = *model_;
  if (compliance_ && equal(K_, structure.K) && equal(B_, interface.B)) return *compliance_;
  compliance_.reset();
  K_ = copy_of(structure.K);
  B_ = copy_of(interface.B);
  return compliance_.emplace(structure, interface, equilibrium_options_);
}

Equilibrium SweptModel::find(const Point& point)
{
  go_to(point);
  const auto& [structure, interface] = *model_;
  if (interface.pairs == 0) return find_equilibrium(structure, interface, equilibrium_options_);
  return find_equilibrium(structure, interface, compliance(), closed_, equilibrium_options_);
}

const Equilibrium& SweptModel::equilibrium_at(const std::vector<double>& values, bool reversed)
{
  const Point point{values, reversed};
  const auto known = equilibria_.find(point);
  if (known != equilibria_.end()) return known->second;
  Equilibrium equilibrium;
  try
  {
    equilibrium = find(point);
  }
  catch (const LibraryError&)
  {
    throw;
  }
  catch (const Error& error)
  {
    model_.reset();
    equilibrium.outcome = {OutcomeKind::no_equilibrium, error.what(), 0, 1};
  }
  if (equilibrium.outcome.kind == OutcomeKind::converged) closed_ = equilibrium.closed;
  return equilibria_[point] = std::move(equilibrium);
}

void SweptModel::prepare(const std::vector<SweepLine>& lines)
{
  for (const SweepLine& line : lines)
    for (const std::vector<double>& values : line.points)
    {
      const Equilibrium& equilibrium = equilibrium_at(values, line.reversed);
      if (equilibrium.outcome.kind != OutcomeKind::converged) continue;
      if (at_every_.empty()) at_every_ = equilibrium.closed;
      for (std::size_t i = 0; i < at_every_.size(); ++i)
        at_every_[i] = at_every_[i] && i < equilibrium.closed.size() && equilibrium.closed[i];
    }
}

BasisProblem SweptModel::basis_problem() const
{
  return {model_->structure, model_->interface, problem_.modes.band, problem_.modes_options};
}

PointModes SweptModel::modes_at(const std::vector<double>& values, bool reversed)
{
  const Equilibrium& equilibrium = equilibrium_at(values, reversed);
  PointModes modes;
  try
  {
    go_to({values, reversed});
    std::vector<char> common = basis_ ? basis_->closed : at_every_;
    if (common.size() != equilibrium.closed.size())
      throw Error(
          format("the number of contact pairs changes from %zu to %zu", common.size(), equilibrium.closed.size()));
    for (std::size_t i = 0; i < common.size(); ++i) common[i] = common[i] && equilibrium.closed[i];
    if (!basis_) basis_ = make_modes_basis(basis_problem(), common);
    if (common != basis_->closed) rebase(*basis_, basis_problem(), common);
    modes = find_point_modes(
        *basis_, {{model_->structure, model_->interface, equilibrium}, problem_.modes.band, problem_.options});
  }
  catch (const LibraryError&)
  {
    throw;
  }
  catch (const Error& error)
  {
    modes.outcome = {OutcomeKind::not_converged, error.what(), 0, 0};
  }
  return modes;
}

MultiVector SweptModel::vectors(const PointModes& modes, Side side) const
{
  const auto& [structure, interface] = *model_;
  const ClosedContact contact = eliminate_closed_pairs(structure, interface, equilibria_.at(at_).closed);
  return expanded(*basis_, contact, modes.pairs, side);
}

} // namespace squeal
