#include "squeal/cycle/cycle_checkpoint.hpp"

#include "squeal/base/checkpoint.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/equilibrium/file_order.hpp"

#include <memory>
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

void describe_orbit(Checkpoint& checkpoint, const Structure& structure, const std::array<Vec, 2>& state, double& period)
{
  const FileOrder order(structure);
  for (const Vec part : state) order.describe(checkpoint, part);
  describe(checkpoint, period);
}

} // namespace

std::optional<ResumedOrbit> kept_cycle(const Structure& structure)
{
  ResumedOrbit orbit{{zeros_like(structure.load), zeros_like(structure.load), 0, {}}};
  const auto describe = [&](Checkpoint& checkpoint) {
    describe_orbit(checkpoint, structure, {orbit.state.u, orbit.state.v}, orbit.period);
  };
  if (!restore(name_of_file, comm_of(structure.load), describe)) return {};
  return orbit;
}

void keep_cycle(const Structure& structure, Vec start, double period)
{
  keep(name_of_file, comm_of(structure.load),
       [&](Checkpoint& checkpoint) {
         describe_orbit(checkpoint, structure, {displacement(start), velocity(start)}, period);
       });
}

void keep_cycles_of(Flow& flow, const Structure& structure)
{
  struct Near // the last orbit near a cycle
  {
    Owned<Vec> start; // null: none was met
    double period = 0;
  };
  const auto near = std::make_shared<Near>();
  const auto keep = [near, &structure]
  {
    if (near->start.get()) keep_cycle(structure, near->start, near->period);
  };
  flow.integrate = [near, keep, integrate = std::move(flow.integrate)](double period, Vec start, Vec end, Vec rate)
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
    if (rate && is_near(start, end)) *near = {copy_of(start), period};
    if (checkpoint_is_due()) keep();
  };
  if (!flow.apply_tangent) return;
  flow.apply_tangent = [keep, apply = std::move(flow.apply_tangent)](std::span<const Vec> states)
  {
    apply(states);
    if (checkpoint_is_due()) keep();
  };
}

} // namespace squeal
