#include "squeal/cycle/cycle_checkpoint.hpp"

#include "squeal/base/checkpoint.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/equilibrium/file_order.hpp"

#include <utility>

namespace squeal
{

namespace
{

constexpr const char* name_of_file = "cycle";

/// Whether a period comes back to its start within a hundredth, by velocities: Newton's method then stays with the
/// cycle that the search is led to.
bool is_near(Vec start, Vec end)
{
  constexpr double near = 0.01;
  const Owned<Vec> moved = copy_of(velocity(end));
  double first = 0, by = 0;
  check(VecAXPY(moved, -1, velocity(start)));
  check(VecNorm(velocity(start), NORM_2, &first));
  check(VecNorm(moved, NORM_2, &by));
  return by <= near * first;
}

void describe_orbit(Checkpoint& checkpoint, const FileOrder& order, const std::array<Vec, 2>& state, double& period)
{
  for (const Vec part : state) order.describe(checkpoint, part);
  describe(checkpoint, period);
}

} // namespace

std::optional<ResumedOrbit> kept_cycle(const Structure& structure)
{
  std::optional<Checkpoint> checkpoint = kept_everywhere(name_of_file, comm_of(structure.load));
  if (!checkpoint) return {};
  const FileOrder order(structure);
  ResumedOrbit orbit{{zeros_like(structure.load), zeros_like(structure.load), 0, {}}};
  describe_orbit(*checkpoint, order, {orbit.state.u, orbit.state.v}, orbit.period);
  return orbit;
}

void keep_cycle(const Structure& structure, Vec start, double period)
{
  checkpoint_made();
  if (!checkpoints_are_kept()) return;
  Checkpoint checkpoint;
  describe_orbit(checkpoint, FileOrder(structure), {displacement(start), velocity(start)}, period);
  if (rank_of(comm_of(structure.load)) == 0) keep(checkpoint, name_of_file);
}

void CycleKeeper::watch(Flow& flow)
{
  flow.integrate = [this, integrate = std::move(flow.integrate)](double period, Vec start, Vec end, Vec rate)
  {
    try
    {
      integrate(period, start, end, rate);
    }
    catch (const Interrupted&)
    {
      keep();
      throw;
    }
    if (rate) note(period, start, end);
    keep_if_due();
  };
  if (!flow.apply_tangent) return;
  flow.apply_tangent = [this, apply = std::move(flow.apply_tangent)](std::span<const Vec> states)
  {
    apply(states);
    keep_if_due();
  };
}

void CycleKeeper::note(double period, Vec start, Vec end)
{
  if (!is_near(start, end)) return;
  start_ = copy_of(start);
  period_ = period;
}

void CycleKeeper::keep_if_due()
{
  if (checkpoint_is_due()) keep();
}

void CycleKeeper::keep() const
{
  if (start_.get()) keep_cycle(structure_, start_, period_);
}

} // namespace squeal
