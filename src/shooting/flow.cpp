#include "squeal/shooting/flow.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

Vec part(Vec state, PetscInt index)
{
  Vec result = nullptr;
  check(VecNestGetSubVec(state, index, &result));
  return result;
}

} // namespace

void apply(const Preconditioner& preconditioner, double period, Vec x, Vec y)
{
  if (preconditioner)
    preconditioner(period, x, y);
  else
    check(VecAXPBY(y, -1, 0, x));
}

Owned<Vec> state_of(Vec u, Vec v)
{
  const Owned<Vec> own_u = copy_of(u), own_v = copy_of(v);
  Vec parts[] = {own_u, own_v};
  Owned<Vec> state;
  check(VecCreateNest(comm_of(u), 2, nullptr, parts, state.put()));
  return state;
}

Vec displacement(Vec state)
{
  return part(state, 0);
}

Vec velocity(Vec state)
{
  return part(state, 1);
}

PetscInt dofs_of(Vec state)
{
  return entry_count(displacement(state));
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
  return dot(a, image);
}

double energy_norm(const Flow& flow, Vec a)
{
  const double square = energy_product(flow, a, a);
  return square < 0 ? 0 : std::sqrt(square); // what is not a number stays so
}

void normalise(const Flow& flow, Vec x)
{
  check(VecScale(x, 1 / std::max(energy_norm(flow, x), 1e-300)));
}

void extend_base(const Flow& flow, double rank_tolerance, std::vector<Owned<Vec>>& base, Vec candidate)
{
  const double length = energy_norm(flow, candidate);
  if (!(length > 0)) return;
  Owned<Vec> fresh = copy_of(candidate);
  for (int pass = 0; pass < 2; ++pass) // the second removes what rounding left
    for (const auto& member : base) check(VecAXPY(fresh, -energy_product(flow, member, fresh), member));
  const double left = energy_norm(flow, fresh);
  if (left < rank_tolerance * length) return;
  check(VecScale(fresh, 1 / left));
  base.push_back(std::move(fresh));
}

} // namespace squeal
