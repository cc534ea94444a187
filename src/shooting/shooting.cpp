/// The order of the stages: free periods, the paper's reduced system, the growing base, the full-space finish.
#include "squeal/shooting/shooting.hpp"
#include "squeal/base/progress.hpp"

#include <array>
#include <cmath>
#include <cstdio>

namespace squeal
{

namespace
{

void require(bool good, const char* text)
{
  if (!good) throw Error(text);
}

/// What the options mean is said in the program's option table.
ShootingOptions read_options()
{
  ShootingOptions options;
  const std::array<const char*, 3> finishes = {"multisecant", "newton_krylov", "none"};
  PetscInt finish = 0;
  const char* prefix = "cycle_";
  check(PetscOptionsGetEList(nullptr, prefix, "-finish", finishes.data(), 3, &finish, nullptr));
  options.finish = finishes[static_cast<std::size_t>(finish)];
  check(PetscOptionsGetInt(nullptr, prefix, "-reduced_newtons", &options.reduced_newtons, nullptr));
  check(PetscOptionsGetInt(nullptr, prefix, "-base_growths", &options.base_growths, nullptr));
  check(PetscOptionsGetReal(nullptr, prefix, "-difference", &options.difference, nullptr));
  check(PetscOptionsGetReal(nullptr, prefix, "-rank_tolerance", &options.rank_tolerance, nullptr));
  check(PetscOptionsGetInt(nullptr, prefix, "-secants", &options.secants, nullptr));
  check(PetscOptionsGetReal(nullptr, prefix, "-secant_drop", &options.drop, nullptr));
  check(PetscOptionsGetReal(nullptr, prefix, "-clamp", &options.clamp, nullptr));
  check(PetscOptionsGetInt(nullptr, prefix, "-stall", &options.stall, nullptr));
  check(PetscOptionsGetInt(nullptr, prefix, "-max_periods", &options.max_periods, nullptr));
  check(PetscOptionsGetInt(nullptr, prefix, "-multipliers", &options.multipliers, nullptr));
  if (options.base_growths < 0) options.base_growths = options.finish == "none" ? 4 : 0;
  require(options.difference > 0, "-cycle_difference must be above 0");
  require(options.clamp > 0, "-cycle_clamp must be above 0");
  require(options.secants >= 0, "-cycle_secants must not be below 0");
  return options;
}

void append_shapes(const Shooting& shooting, std::vector<Owned<Vec>>& base, Vec u, Vec v)
{
  const Owned<Vec> moved = zeros_like(shooting.equilibrium), moving = zeros_like(shooting.equilibrium);
  check(VecCopy(u, displacement(moved)));
  check(VecCopy(v, velocity(moving)));
  extend_base(shooting, base, moved);
  extend_base(shooting, base, moving);
}

/// Reduced Newton on the paper's base, then on bases that have learnt what the last one missed. A result that falls
/// onto the equilibrium is refused: the full residual can only be small there.
Orbit reduce(Shooting& shooting, Orbit orbit, const std::vector<Vec>& shapes)
{
  std::vector<Owned<Vec>> base;
  for (const Vec shape : shapes) append_shapes(shooting, base, shape, shape);
  Orbit best = copy_of(orbit);
  for (PetscInt growth = 0; growth <= shooting.options.base_growths; ++growth)
  {
    orbit = shoot_reduced(shooting, orbit, base, growth == 0 ? "reduced" : "grown base");
    if (vanishing(shooting, orbit) || !std::isfinite(orbit.residual)) break;
    // Without a finish this is the result, whatever the start was worth.
    if (orbit.residual < best.residual || shooting.options.finish == "none") best = copy_of(orbit);
    if (orbit.residual <= shooting.tolerance) break;
    append_shapes(shooting, base, displacement(orbit.defect), velocity(orbit.defect));
  }
  return best;
}

} // namespace

Finish finish_in_full_space(Shooting& shooting, Orbit start)
{
  Finish finish{std::move(start), Ending::stalled};
  shooting.secants.clear();
  if (finish.orbit.residual <= shooting.tolerance) return {std::move(finish.orbit), Ending::converged};
  if (shooting.options.finish == "none") return finish;
  if (shooting.options.finish == "multisecant")
  {
    finish = shoot_multisecant(shooting, finish.orbit);
    if (finish.ending == Ending::converged) return finish;
    if (shooting.periods < shooting.options.max_periods)
    {
      shooting.secants.clear();
      Orbit again = free_periods(shooting, finish.orbit.state, finish.orbit.period, 10);
      if (vanishing(shooting, again)) return {std::move(again), Ending::vanished};
      finish = shoot_multisecant(shooting, again);
      if (finish.ending == Ending::converged) return finish;
    }
  }
  if (shooting.periods >= shooting.options.max_periods) return finish;
  const Ending before = finish.ending;
  finish = shoot_newton_krylov(shooting, finish.orbit);
  if (finish.ending == Ending::stalled) finish.ending = before;
  return finish;
}

namespace
{

/// A cycle gone round twice is a solution, too, and no answer: where half the period nearly closes it, that is sought.
Finish gone_round_once(Shooting& shooting, Finish finish)
{
  Orbit half = evaluate(shooting, finish.orbit.state, finish.orbit.period / 2);
  if (!(half.residual < 1e-2)) return finish;
  Finish once = finish_in_full_space(shooting, std::move(half));
  return once.ending == Ending::converged ? std::move(once) : std::move(finish);
}

/// Off a cycle that repels, along what grows and first towards less energy, far enough that free periods lead
/// elsewhere: another cycle, or the same one.
Finish leave(Shooting& shooting, const Finish& found, Vec growing)
{
  const Orbit& orbit = found.orbit;
  const Owned<Vec> fluctuation = copy_of(orbit.state);
  check(VecAXPY(fluctuation, -1, shooting.equilibrium));
  const double outwards = energy_product(shooting.flow, fluctuation, growing) > 0 ? 1 : -1;
  for (const double side : {-outwards, outwards})
  {
    if (shooting.periods >= shooting.options.max_periods) break;
    const Owned<Vec> start = copy_of(orbit.state);
    check(VecAXPY(start, 0.1 * side * orbit.fluctuation, growing));
    Finish other = finish_in_full_space(shooting, free_periods(shooting, start, orbit.period, 20));
    if (other.ending == Ending::converged) return other;
  }
  return {copy_of(orbit), found.ending};
}

/// The multipliers' verdict on a converged cycle. One that repels is left for another that may not.
Finish attracting(Shooting& shooting, Finish finish, const std::vector<Owned<Vec>>& asleep, LimitCycle& cycle)
{
  const Owned<Vec> growing = find_multipliers(shooting, finish.orbit, asleep, cycle);
  if (cycle.stability != "unstable" || shooting.periods >= shooting.options.max_periods) return finish;
  Finish other = leave(shooting, finish, growing);
  LimitCycle second;
  find_multipliers(shooting, other.orbit, asleep, second);
  cycle.multiplier_periods += second.multiplier_periods;
  if (second.stability == "unstable") return finish;
  cycle.multipliers = std::move(second.multipliers);
  cycle.stability = second.stability;
  cycle.trivial_error = second.trivial_error;
  return other;
}

/// A cycle that repels is no answer; with more than one unstable mode the motion need not be periodic at all.
void judge(LimitCycle& cycle, std::size_t asleep)
{
  if (cycle.outcome.kind != OutcomeKind::converged || cycle.stability != "unstable") return;
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(), "the cycle found repels: a small motion beside it grows %.4g times a period",
                std::abs(cycle.multipliers.front()));
  cycle.outcome.kind = asleep == 0 ? OutcomeKind::unstable_cycle : OutcomeKind::not_periodic;
  cycle.outcome.reason = text.data();
  cycle.outcome.reason += asleep == 0 ? "; try another start (-cycle_start_amplitude) or more free periods"
                                      : "; " + std::to_string(asleep + 1) +
                                            " modes are unstable and the motion may be quasi-periodic: integrate it";
}

Outcome outcome_of(const Shooting& shooting, const Finish& finish)
{
  Outcome outcome{OutcomeKind::not_converged, "", shooting.iterations, finish.orbit.residual};
  if (finish.ending == Ending::vanished)
  {
    outcome.kind = OutcomeKind::collapsed_to_equilibrium;
    outcome.reason =
        "the fluctuation fell below a tenth of the energy at the start and at first lift-off or slip reversal";
  }
  else if (finish.ending == Ending::converged)
    outcome.kind = OutcomeKind::converged;
  else if (finish.ending == Ending::not_periodic)
  {
    outcome.kind = OutcomeKind::not_periodic;
    outcome.reason = "the period left the range between half and twice the mode's";
  }
  else
    outcome.reason = "full residual above the tolerance after " + std::to_string(shooting.periods) + " periods";
  return outcome;
}

std::string note_of(const NewtonRecord& record)
{
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), "%s, %ld periods, T %.6g s, residual %.1e", record.stage.c_str(),
                record.periods, record.period, record.residual_full);
  return text.data();
}

} // namespace

Shooting begin_shooting(const Flow& flow, const Preconditioner& preconditioner, const ShootingStart& start,
                        double tolerance, Progress& progress)
{
  declare_reduced_options();
  declare_fallback_options();
  Shooting shooting{flow, preconditioner, read_options()};
  const Owned<Vec> rest = zeros_like(start.equilibrium);
  shooting.equilibrium = state_of(start.equilibrium, rest);
  shooting.first_period = start.period;
  shooting.tolerance = tolerance;
  shooting.residual_projected = std::nan("");
  shooting.announce = [&progress](const NewtonRecord& entry)
  { progress.update(static_cast<double>(entry.periods), note_of(entry)); };
  return shooting;
}

LimitCycle shoot(const Flow& flow, const ShootingStart& start, const Preconditioner& preconditioner, double tolerance,
                 int free)
{
  Progress progress(comm_of(start.u), "cycle", free + 60.);
  Shooting shooting = begin_shooting(flow, preconditioner, start, tolerance, progress);
  const Owned<Vec> first = state_of(start.u, start.v);
  Orbit orbit = free_periods(shooting, first, start.period, free);
  // Below the first event nothing limits a vibration; above it a start may be ten times too large and still find one.
  shooting.least_fluctuation = std::min(orbit.fluctuation, start.first_event) * std::sqrt(0.1);
  if (orbit.residual > tolerance && shooting.options.reduced_newtons != 0 && !start.shapes.empty())
    orbit = reduce(shooting, std::move(orbit), start.shapes);
  Finish finish = finish_in_full_space(shooting, std::move(orbit));

  LimitCycle cycle;
  if (finish.ending == Ending::converged) finish = gone_round_once(shooting, std::move(finish));
  if (finish.ending == Ending::converged) finish = attracting(shooting, std::move(finish), start.asleep, cycle);
  cycle.outcome = outcome_of(shooting, finish);
  cycle.period = finish.orbit.period;
  cycle.residual_projected = shooting.residual_projected;
  cycle.residual_full = finish.orbit.residual;
  cycle.newton_iterations = shooting.iterations;
  cycle.start = {copy_of(displacement(finish.orbit.state)), copy_of(velocity(finish.orbit.state)), 0, {}};
  judge(cycle, start.asleep.size());
  cycle.periods_integrated = shooting.periods;
  cycle.records = std::move(shooting.records);
  return cycle;
}

} // namespace squeal
