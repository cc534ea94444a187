#include "squeal/attractors/attractors.hpp"

#include "starts.hpp"

#include "squeal/base/progress.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/transient/step_guards.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace squeal
{

namespace
{

constexpr long most_periods = 400;
constexpr int block = 50;              // periods between two looks at the energies
constexpr double at_rest = 1e-4;       // of the least energy of a start
constexpr std::size_t coordinates = 4; // of the least stable modes

/// One trajectory as it is seen.
struct Watched
{
  std::vector<double> energies; // [J] fluctuating, of each step
  std::array<double, coordinates> last{}, squares{};
  std::array<std::vector<double>, coordinates> crossings; // [s] upwards through zero
};

/// Trajectories that are integrated together.
class Swarm
{
public:
  Swarm(const AttractorProblem& problem, int steps_per_period, std::vector<State> starts)
      : problem_(problem), steps_per_period_(steps_per_period), rest_force_(zeros_like(problem.sliding.equilibrium.u)),
        states_(std::move(starts)), watched_(states_.size())
  {
    const auto& [structure, interface, equilibrium] = problem.sliding;
    const double period = 1 / problem.unstable.modes.front().frequency_hz();
    step_ = make_theta_step(structure, interface, period / steps_per_period_, problem.settings.theta, problem.step);
    check(MatMult(structure.K, equilibrium.u, rest_force_));
    check(VecDot(rest_force_, equilibrium.u, &rest_energy_));
    rest_energy_ /= 2;
    for (std::size_t i = 0; i < std::min(coordinates, problem.modes.size()); ++i)
      shapes_.push_back(problem.modes[i].real);
    for (State& state : states_) works_.push_back(begin_steps(step_, structure, interface, state));
  }

  long periods() const { return steps_ / steps_per_period_; }
  const State& now(std::size_t k) const { return states_[k]; }

  void integrate_to(long periods)
  {
    const MPI_Comm comm = comm_of(problem_.sliding.structure.load);
    while (steps_ < periods * steps_per_period_)
    {
      ++steps_;
      const std::vector<StepReport> reports =
          advance(step_, problem_.sliding.structure, problem_.sliding.interface, works_, states_);
      for (std::size_t k = 0; k < states_.size(); ++k) watch(reports[k], k);
      end_if_asked(comm);
    }
  }

  std::vector<ReachedMotion> reached() const
  {
    double least = watched_.front().energies.front();
    for (const Watched& watched : watched_) least = std::min(least, watched.energies.front());
    std::vector<ReachedMotion> motions;
    for (std::size_t k = 0; k < watched_.size(); ++k)
    {
      const Watched& watched = watched_[k];
      const auto moving = std::max_element(watched.squares.begin(), watched.squares.end()) - watched.squares.begin();
      const std::vector<double>& crossings = watched.crossings[static_cast<std::size_t>(moving)];
      motions.push_back(
          reached_by(means_over(watched.energies, own_period(crossings) / step_.h), crossings, at_rest * least));
      motions.back().starts = {k};
    }
    return motions;
  }

private:
  /// [s] Two crossings apart, as some motions cross twice a period; the mode's where there are too few.
  double own_period(const std::vector<double>& crossings) const
  {
    const MeanValue frequency = frequency_of(crossings);
    return frequency.value > 0 ? 2 / frequency.value : step_.h * steps_per_period_;
  }

  /// Takes the energy of the fluctuation and the velocities along the modes.
  void watch(const StepReport& report, std::size_t k)
  {
    Watched& watched = watched_[k];
    const double h = step_.h;
    double work = 0;
    check(VecDot(rest_force_, states_[k].u, &work));
    watched.energies.push_back(report.energy - work + rest_energy_);
    std::array<double, coordinates> now{};
    check(VecMDot(works_[k].Mv, static_cast<PetscInt>(shapes_.size()), shapes_.data(), now.data()));
    for (std::size_t i = 0; i < shapes_.size(); ++i)
    {
      watched.squares[i] += now[i] * now[i];
      if (watched.last[i] < 0 && now[i] >= 0)
        watched.crossings[i].push_back(h * (static_cast<double>(steps_) - now[i] / (now[i] - watched.last[i])));
    }
    watched.last = now;
  }

  const AttractorProblem& problem_;
  const int steps_per_period_;
  ThetaStep step_;
  Owned<Vec> rest_force_; // K u0
  double rest_energy_ = 0;
  std::vector<Vec> shapes_;
  std::vector<State> states_;
  std::vector<Watched> watched_;
  std::vector<StepWork> works_;
  long steps_ = 0;
};

/// After so many periods. That no cycle attracts is not said of a short motion: it may still be on its way to one.
bool all_settled(const std::vector<ReachedMotion>& motions, long periods)
{
  const bool is_short = periods < 200;
  return std::none_of(motions.begin(), motions.end(),
                      [&](const ReachedMotion& motion) {
                        return motion.kind == ReachedKind::unsettled ||
                               (is_short && motion.kind == ReachedKind::varying);
                      });
}

/// Adds to the bars of motions what half as many steps a period change, from where each one's first start has ended,
/// over as many periods.
void add_step_errors(const AttractorProblem& problem, const Swarm& swarm, std::vector<ReachedMotion>& motions)
{
  std::vector<ReachedMotion*> moving;
  std::vector<State> ends;
  for (ReachedMotion& motion : motions)
  {
    if (motion.kind == ReachedKind::rest) continue;
    moving.push_back(&motion);
    ends.push_back(copy_of(swarm.now(motion.starts.front())));
  }
  if (moving.empty()) return;
  Swarm coarse(problem, std::max(problem.settings.steps_per_period / 2, 1), std::move(ends));
  coarse.integrate_to(swarm.periods());
  const std::vector<ReachedMotion> others = coarse.reached();
  for (std::size_t k = 0; k < moving.size(); ++k)
  {
    moving[k]->energy.error += std::abs(others[k].energy.value - moving[k]->energy.value);
    moving[k]->frequency.error += std::abs(others[k].frequency.value - moving[k]->frequency.value);
  }
}

} // namespace

Attractors find_attractors(const AttractorProblem& problem)
{
  Attractors found;
  const int steps = problem.settings.steps_per_period;
  const std::string refusal =
      friction_refusal(problem.sliding, &problem.unstable.modes.front(), problem.settings.theta,
                       1 / (problem.unstable.modes.front().frequency_hz() * steps), problem.step, 1);
  if (!refusal.empty()) return {{OutcomeKind::refused, refusal, 0, 0}, {}, {}, 0};
  std::vector<State> states;
  for (NamedStart& start : make_starts(problem))
  {
    found.starts.push_back(start.name);
    states.push_back(std::move(start.state));
  }
  if (states.empty()) return {{OutcomeKind::skipped, "no amplitude is known that contact limits", 0, 0}, {}, {}, 0};
  Swarm swarm(problem, steps, std::move(states));
  Progress progress(comm_of(problem.sliding.structure.load), "attractors", static_cast<double>(most_periods));
  std::vector<ReachedMotion> motions;
  for (long target = block;; target += block) // of periods, after which the energies are looked at
  {
    swarm.integrate_to(target);
    found.periods = target;
    motions = swarm.reached();
    progress.update(static_cast<double>(target), format("%ld periods", target));
    if (all_settled(motions, target) || target + block > most_periods) break;
  }
  const bool settled = all_settled(motions, std::numeric_limits<long>::max());
  found.motions = joined(std::move(motions));
  add_step_errors(problem, swarm, found.motions);
  found.motions = joined(std::move(found.motions)); // motions that differ by less than these errors
  found.outcome = {settled ? OutcomeKind::completed : OutcomeKind::not_converged,
                   settled ? "" : format("some motions had not settled after %ld periods", found.periods), 0, 0};
  return found;
}

} // namespace squeal
