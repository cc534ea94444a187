#include "squeal/equilibrium/equilibrium.hpp"
#include "load_path.hpp"

#include <cmath>
#include <Eigen/Dense>
#include <set>

namespace squeal
{

Equilibria::Equilibria(const EquilibriumOptions& options) : options_(options) {}

Equilibria::~Equilibria() = default;

Equilibrium Equilibria::at(const Structure& structure, const Interface& interface)
{
  Equilibrium equilibrium;
  // what nothing touches and nothing loads stays where it is, held or free: the modes of a free body need no support
  if (interface.pairs == 0 && norm_of(structure.load, NORM_INFINITY) == 0)
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

namespace
{

/// The way to the end of a step of the path, with bolts of given shortenings there. These are the ones that it
/// tightens, and those of later steps, which carry nothing yet.
class StepOfBolts
{
public:
  StepOfBolts(Structure& structure, const Interface& interface, Equilibria& equilibria, std::size_t step)
      : structure_(structure), interface_(interface), equilibria_(equilibria), step_(structure.path[step]),
        loose_(copy_of(structure.path[step].load.get()))
  {
    std::set<std::size_t> tightened;
    for (std::size_t i = 0; i < step; ++i)
      tightened.insert(structure.path[i].bolts.begin(), structure.path[i].bolts.end());
    tightened.insert(step_.bolts.begin(), step_.bolts.end());
    bolts_ = step_.bolts;
    for (std::size_t later = step + 1; later < structure.path.size(); ++later)
      for (const std::size_t bolt : structure.path[later].bolts)
        if (tightened.insert(bolt).second) bolts_.push_back(bolt);
    for (const std::size_t bolt : bolts_)
      check(VecAXPY(loose_, -structure.bolts[bolt].shortening, structure.bolts[bolt].pull));
    to_here_.K = shared(structure.K.get());
    to_here_.M = shared(structure.M.get());
    to_here_.names = structure.names;
    to_here_.load = copy_of(step_.load.get());
    for (std::size_t i = 0; i < step; ++i)
      to_here_.path.push_back(
          {structure.path[i].name, shared(structure.path[i].load.get()), structure.path[i].driven_friction, {}});
    to_here_.path.push_back({step_.name, shared(to_here_.load.get()), step_.driven_friction, {}});
  }

  Index bolts() const { return static_cast<Index>(bolts_.size()); }

  /// The tension of a bolt at the end of the step [N].
  double wanted(Index i) { return i < static_cast<Index>(step_.bolts.size()) ? bolt_at(i).tension : 0; }

  /// Sum of what the tension of each bolt lacks [N], at shortenings x.
  VectorXd missing(const VectorXd& x)
  {
    check(VecCopy(loose_, to_here_.load));
    for (Index i = 0; i < x.size(); ++i)
    {
      TightBolt& bolt = bolt_at(i);
      bolt.shortening = x(i);
      check(VecAXPY(to_here_.load, x(i), bolt.pull));
    }
    const Equilibrium found = equilibria_.at(to_here_, interface_);
    if (found.outcome.kind != OutcomeKind::converged)
      throw Error("bolt " + bolt_at(0).name + ": no equilibrium while it is tightened in step '" + step_.name +
                  "': " + found.outcome.reason);
    VectorXd result(x.size());
    for (Index i = 0; i < x.size(); ++i) result(i) = wanted(i) - tension_of(bolt_at(i), found.u);
    return result;
  }

  TightBolt& bolt_at(Index i) { return structure_.bolts[bolts_[static_cast<std::size_t>(i)]]; }

private:
  Structure& structure_;
  const Interface& interface_;
  Equilibria& equilibria_;
  const PathStep& step_;
  std::vector<std::size_t> bolts_;
  Owned<Vec> loose_;  // load at the end of the step without these bolts
  Structure to_here_; // as far as equilibria need it
};

/// Columns: by how much what is missing falls with each shortening [N/m].
Eigen::MatrixXd slopes_at(StepOfBolts& step, const VectorXd& x, const VectorXd& missing)
{
  constexpr double part = 1e-2; // of the shortening: forces are linear while no pair changes its status
  Eigen::MatrixXd slopes(x.size(), x.size());
  for (Index i = 0; i < x.size(); ++i)
  {
    VectorXd beside = x;
    beside(i) += part * step.bolt_at(i).tension / step.bolt_at(i).stiffness;
    slopes.col(i) = (missing - step.missing(beside)) / (beside(i) - x(i));
  }
  return slopes;
}

/// The shortenings at which nothing is missing.
VectorXd shortenings(StepOfBolts& step)
{
  constexpr int most = 20;
  constexpr double enough = 1e-11; // of the tension: what equilibria are found to
  VectorXd x(step.bolts()), tension(step.bolts());
  for (Index i = 0; i < x.size(); ++i)
  {
    tension(i) = step.bolt_at(i).tension;
    x(i) = step.wanted(i) / step.bolt_at(i).stiffness; // if all but the section were rigid
  }
  VectorXd missing = step.missing(x);
  for (int pass = 0; pass < most && (missing.array().abs() > enough * tension.array()).any(); ++pass)
  {
    x += slopes_at(step, x, missing).fullPivLu().solve(missing);
    missing = step.missing(x);
  }
  constexpr double tolerable = 1e-9;
  if ((missing.array().abs() > tolerable * tension.array()).any())
    throw Error(format("bolt %s: its tension stays %g N from %g N: is its shank joined to what holds it?",
                       step.bolt_at(0).name.c_str(), missing.cwiseAbs().maxCoeff(), tension(0)));
  return x;
}

} // namespace

void tighten(Structure& structure, const Interface& interface)
{
  if (structure.bolts.empty()) return;
  Equilibria equilibria{EquilibriumOptions{}};
  for (std::size_t step = 0; step < structure.path.size(); ++step)
  {
    if (structure.path[step].bolts.empty()) continue;
    StepOfBolts here(structure, interface, equilibria, step);
    std::vector<double> before;
    for (Index i = 0; i < here.bolts(); ++i) before.push_back(here.bolt_at(i).shortening);
    const VectorXd found = shortenings(here);
    for (Index i = 0; i < found.size(); ++i)
    {
      const double more = found(i) - before[static_cast<std::size_t>(i)];
      for (std::size_t later = step; later < structure.path.size(); ++later)
        check(VecAXPY(structure.path[later].load, more, here.bolt_at(i).pull));
      check(VecAXPY(structure.preload, more, here.bolt_at(i).pull));
    }
  }
}

} // namespace squeal
