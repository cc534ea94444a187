#include "swept_model.hpp"

#include "squeal/contact/pairs.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

namespace squeal
{

void reverse_rotation(Structure& structure, Interface& interface)
{
  for (double& velocity : interface.drive) velocity = -velocity;
  if (!structure.G.get()) return;
  structure.G = copy_of(structure.G); // other models may share the matrix
  check(MatScale(structure.G, -1));
}

SweptModel::SweptModel(const SweepProblem& problem, std::function<void()> end_if_asked)
    : problem_(problem), end_if_asked_(std::move(end_if_asked)), searched_(problem_.equilibrium_options)
{
}

void SweptModel::go_to(const SweptPlace& place)
{
  if (model_ && at_ == place) return;
  model_.reset();
  model_ = problem_.model_at(place.values);
  if (place.reversed) reverse_rotation(model_->structure, model_->interface);
  at_ = place;
}

const SweptModel::Known& SweptModel::known_at(const SweptPlace& place)
{
  const auto found = known_.find(place);
  if (found != known_.end()) return found->second;
  Known known;
  try
  {
    go_to(place);
    known.equilibrium = searched_.at(model_->structure, model_->interface);
    known.rigid = known.equilibrium.closed;
    for (std::size_t i = 0; i < known.rigid.size(); ++i)
      known.rigid[i] = known.rigid[i] && compliance_of(model_->interface, i) == 0;
  }
  catch (const Error& error)
  {
    model_.reset();
    known.equilibrium.outcome = {OutcomeKind::no_equilibrium, error.what(), 0, 1};
  }
  return known_[place] = std::move(known);
}

void SweptModel::prepare(const SweptPlace& place)
{
  if (equilibrium_at(place).outcome.kind != OutcomeKind::converged) return;
  const std::vector<char>& rigid = known_at(place).rigid;
  if (at_every_.empty()) at_every_ = rigid;
  for (std::size_t i = 0; i < at_every_.size(); ++i) at_every_[i] = at_every_[i] && i < rigid.size() && rigid[i];
}

BasisProblem SweptModel::basis_problem(const Equilibrium& equilibrium) const
{
  return {model_->structure, model_->interface, equilibrium.closed, problem_.modes.band, problem_.modes_options};
}

PointModes SweptModel::modes_at(const SweptPlace& place, double tolerance)
{
  const Equilibrium& equilibrium = equilibrium_at(place);
  PointModes modes;
  try
  {
    go_to(place);
    if (equilibrium.history) throw Error("nothing drives a pair there, and sweeps of modes do not know such pairs");
    const std::vector<char>& rigid = known_at(place).rigid;
    std::vector<char> common = basis_ ? basis_->closed : at_every_;
    if (common.size() != rigid.size())
      throw Error(format("the number of contact pairs changes from %zu to %zu", common.size(), rigid.size()));
    for (std::size_t i = 0; i < common.size(); ++i) common[i] = common[i] && rigid[i];
    if (!basis_) basis_ = make_modes_basis(basis_problem(equilibrium), common);
    if (common != basis_->closed) rebase(*basis_, basis_problem(equilibrium), common);
    modes = find_point_modes(
        *basis_, {{model_->structure, model_->interface, equilibrium}, problem_.modes.band, tolerance, end_if_asked_});
  }
  catch (const Error& error)
  {
    modes.outcome = {OutcomeKind::not_converged, error.what(), 0, 0};
  }
  return modes;
}

void SweptModel::forget(const SweptPlace& place)
{
  known_.erase(place);
}

bool SweptModel::same_pairs_closed(const SweptPlace& a, const SweptPlace& b)
{
  return equilibrium_at(a).closed == equilibrium_at(b).closed && known_at(a).rigid == known_at(b).rigid;
}

int SweptModel::changed_pairs(const SweptPlace& a, const SweptPlace& b)
{
  const std::vector<char>&from = equilibrium_at(a).closed, &to = equilibrium_at(b).closed;
  if (from.size() != to.size()) return 0;
  return std::inner_product(from.begin(), from.end(), to.begin(), 0, std::plus<>(), std::not_equal_to<>());
}

std::optional<ContactChange> SweptModel::contact_change(const SweptPlace& from, const SweptPlace& to, double tolerance)
{
  const Equilibrium &first = equilibrium_at(from), &last = equilibrium_at(to);
  const std::size_t pairs = first.closed.size();
  const auto changing = std::ranges::mismatch(first.closed, last.closed);
  if (last.closed.size() != pairs || changing.in1 == first.closed.end()) return std::nullopt;
  const auto pair = static_cast<std::size_t>(changing.in1 - first.closed.begin());

  searched_.expect(first.closed); // what is expected next: not what was visited before, which a restart does not
  double before = from.values[0], behind = to.values[0];
  while (std::abs(behind - before) > tolerance)
  {
    end_if_asked_();
    SweptPlace place = to;
    place.values[0] = (before + behind) / 2;
    const Equilibrium& at = equilibrium_at(place);
    if (at.outcome.kind != OutcomeKind::converged || at.closed.size() != pairs)
      return ContactChange{0, 0, place.values[0]};
    double& end = at.closed[pair] == first.closed[pair] ? before : behind;
    place.values[0] = std::exchange(end, place.values[0]);
    if (place != from && place != to) forget(place);
  }
  return ContactChange{before, behind};
}

Eigen::Index SweptModel::shapes() const
{
  return basis_ ? basis_->basis.shapes() : 0;
}

} // namespace squeal
