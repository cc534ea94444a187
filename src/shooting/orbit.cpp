/// States of the shooting solver, their energy product, and the flow's evaluations.
#include "squeal/shooting/shooting.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace squeal
{

Owned<Vec> state_of(Vec u, Vec v)
{
  const Owned<Vec> mine_u = copy_of(u), mine_v = copy_of(v);
  Vec parts[] = {mine_u, mine_v};
  Owned<Vec> state;
  check(VecCreateNest(comm_of(u), 2, nullptr, parts, state.put()));
  return state;
}

namespace
{

Vec part(Vec state, PetscInt index)
{
  Vec result = nullptr;
  check(VecNestGetSubVec(state, index, &result));
  return result;
}

} // namespace

Vec displacement(Vec state)
{
  return part(state, 0);
}

Vec velocity(Vec state)
{
  return part(state, 1);
}

void energy_image(const Flow& flow, Vec x, Vec image)
{
  check(MatMult(flow.K, displacement(x), displacement(image)));
  check(MatMult(flow.M, velocity(x), velocity(image)));
}

double energy_product(const Flow& flow, Vec a, Vec b)
{
  const Owned<Vec> image = zeros_like(b);
  energy_image(flow, b, image);
  double product = 0;
  check(VecDot(a, image, &product));
  return product;
}

double energy_norm(const Flow& flow, Vec a)
{
  return std::sqrt(std::max(0., energy_product(flow, a, a)));
}

Orbit evaluate(Shooting& shooting, Vec state, double period)
{
  Orbit orbit{copy_of(state), period, zeros_like(state), zeros_like(state), 0, 0};
  shooting.flow.integrate(period, orbit.state, orbit.defect, orbit.rate);
  ++shooting.periods;
  check(VecAXPY(orbit.defect, -1, orbit.state));
  const Owned<Vec> fluctuation = copy_of(orbit.state);
  check(VecAXPY(fluctuation, -1, shooting.equilibrium));
  orbit.fluctuation = energy_norm(shooting.flow, fluctuation);
  orbit.residual = energy_norm(shooting.flow, orbit.defect) / orbit.fluctuation;
  // 0/0: the equilibrium itself, which is no cycle
  if (!std::isfinite(orbit.residual)) orbit.residual = std::numeric_limits<double>::infinity();
  return orbit;
}

Orbit copy_of(const Orbit& orbit)
{
  return {copy_of(orbit.state), orbit.period,      copy_of(orbit.defect),
          copy_of(orbit.rate),  orbit.fluctuation, orbit.residual};
}

void record(Shooting& shooting, const std::string& stage, int unknowns, double projected, const Orbit& orbit)
{
  shooting.records.push_back({stage, unknowns, shooting.periods, orbit.period, projected, orbit.residual});
  if (shooting.announce) shooting.announce(shooting.records.back());
}

int full_unknowns(const Orbit& orbit)
{
  PetscInt dofs = 0;
  check(VecGetSize(displacement(orbit.state), &dofs));
  return static_cast<int>(2 * dofs + 1);
}

bool admissible_period(const Shooting& shooting, double period)
{
  return period > shooting.first_period / 2 && period < shooting.first_period * 2;
}

bool vanishing(const Shooting& shooting, const Orbit& orbit)
{
  return !(orbit.fluctuation > shooting.least_fluctuation);
}

Orbit free_periods(Shooting& shooting, Vec state, double period, int count)
{
  Owned<Vec> current = copy_of(state);
  for (int done = 0; done < count; ++done)
  {
    const Orbit orbit = evaluate(shooting, current, period);
    record(shooting, "free", 0, std::nan(""), orbit);
    check(VecAXPY(current, 1, orbit.defect));
    // The recurrence nearest to the start lies where the defect is orthogonal to the flow. A new period costs a
    // factorisation, so a small correction waits for the last one.
    const double speed = energy_norm(shooting.flow, orbit.rate);
    double correction = speed > 0 ? -energy_product(shooting.flow, orbit.defect, orbit.rate) / (speed * speed) : 0;
    correction = std::clamp(correction, -0.2 * period, 0.2 * period);
    const bool worth_it = done + 1 == count || std::abs(correction) > 0.02 * period;
    if (worth_it && admissible_period(shooting, period + correction)) period += correction;
  }
  return evaluate(shooting, current, period);
}

} // namespace squeal
