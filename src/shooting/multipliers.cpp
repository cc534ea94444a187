/// Floquet multipliers: eigenvalues of dPhi_T/dx at the cycle, by Arnoldi in the energy product on difference
/// quotients of the flow. With as many steps as the state has entries it is the whole monodromy matrix. With fewer it
/// starts from the motions that may grow, a change of amplitude and the unstable modes that the cycle leaves asleep,
/// and the flow's own direction d is taken out along itself, so that the shift in time, whose multiplier is 1, is not
/// found. Caveat: how far from 1 the shift in time itself comes out is the error bar of the verdict.
#include "squeal/shooting/shooting.hpp"

#include <algorithm>
#include <cmath>
#include <petscblaslapack.h>

namespace squeal
{

namespace
{

Owned<Vec> monodromy(Shooting& shooting, const Orbit& orbit, Vec direction)
{
  const double step = shooting.options.difference * orbit.fluctuation;
  const Owned<Vec> moved = copy_of(orbit.state);
  Owned<Vec> end = zeros_like(orbit.state);
  check(VecAXPY(moved, step, direction));
  shooting.flow.integrate(orbit.period, moved, end, nullptr);
  check(VecAXPY(end, -1, orbit.state));
  check(VecAXPY(end, -1, orbit.defect));
  check(VecScale(end, 1 / step));
  return end;
}

/// The monodromy matrix, or what it does beside the flow.
struct Tangent
{
  Owned<Vec> phase;   // energy image of the unit flow f, divided by |d|; null: nothing is taken out
  Vec rate = nullptr; // d

  void project(Vec x) const
  {
    if (!phase.get()) return;
    double along = 0;
    check(VecDot(phase, x, &along));
    check(VecAXPY(x, -along, rate));
  }
};

void normalise(const Shooting& shooting, Vec x)
{
  check(VecScale(x, 1 / std::max(energy_norm(shooting.flow, x), 1e-300)));
}

/// Holds every direction, reproducibly and whatever the number of ranks.
Owned<Vec> every_direction(const Shooting& shooting)
{
  Owned<Vec> start = zeros_like(shooting.equilibrium);
  int part = 0;
  for (const Vec vector : {displacement(start), velocity(start)})
  {
    PetscInt first = 0, last = 0;
    check(VecGetOwnershipRange(vector, &first, &last));
    for (PetscInt i = first; i < last; ++i)
      check(VecSetValue(vector, i, std::cos(1 + 2.4 * i + 1.3 * part), INSERT_VALUES));
    check(VecAssemblyBegin(vector));
    check(VecAssemblyEnd(vector));
    // displacements and velocities of the same weight
    const Owned<Vec> alone = zeros_like(start);
    check(VecCopy(vector, part == 0 ? displacement(alone) : velocity(alone)));
    check(VecScale(vector, 1 / std::max(energy_norm(shooting.flow, alone), 1e-300)));
    ++part;
  }
  return start;
}

/// A change of amplitude, and what sleeps.
Owned<Vec> suspects(const Shooting& shooting, const Orbit& orbit, const std::vector<Owned<Vec>>& asleep)
{
  Owned<Vec> start = copy_of(orbit.state);
  check(VecAXPY(start, -1, shooting.equilibrium));
  normalise(shooting, start);
  for (const Owned<Vec>& motion : asleep) check(VecAXPY(start, 1 / energy_norm(shooting.flow, motion), motion));
  return start;
}

struct Krylov
{
  std::vector<Owned<Vec>> base;
  std::vector<double> H; // column-major, size x size
  int size = 0;
};

Krylov arnoldi(Shooting& shooting, const Orbit& orbit, const Tangent& tangent, Owned<Vec> start, int steps)
{
  const auto n = static_cast<std::size_t>(steps);
  Krylov krylov;
  std::vector<double> all(n * n);
  tangent.project(start);
  normalise(shooting, start);
  krylov.base.push_back(std::move(start));
  while (krylov.size < steps)
  {
    const auto k = static_cast<std::size_t>(krylov.size++);
    Owned<Vec> image = monodromy(shooting, orbit, krylov.base[k]);
    tangent.project(image);
    for (int pass = 0; pass < 2; ++pass)
      for (std::size_t i = 0; i <= k; ++i)
      {
        const double along = energy_product(shooting.flow, krylov.base[i], image);
        all[i + k * n] += along;
        check(VecAXPY(image, -along, krylov.base[i]));
      }
    const double left = energy_norm(shooting.flow, image);
    if (krylov.size == steps || left < 1e-6) break; // the rest is noise of the differences
    all[k + 1 + k * n] = left;
    check(VecScale(image, 1 / left));
    krylov.base.push_back(std::move(image));
  }
  const auto m = static_cast<std::size_t>(krylov.size);
  krylov.H.resize(m * m);
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t k = 0; k < m; ++k) krylov.H[i + k * m] = all[i + k * n];
  return krylov;
}

struct Ritz
{
  std::complex<double> value;
  std::vector<double> real; // part of the vector, in the Krylov base
};

/// Largest first.
std::vector<Ritz> eigenvalues(const Krylov& krylov)
{
  const auto n = static_cast<std::size_t>(krylov.size);
  std::vector<double> H = krylov.H, real(n), imaginary(n), vectors(n * n), work(16 * n);
  PetscBLASInt order = krylov.size, one = 1, work_size = 16 * krylov.size, info = 0;
  double unused = 0;
  LAPACKgeev_("N", "V", &order, H.data(), &order, real.data(), imaginary.data(), &unused, &one, vectors.data(), &order,
              work.data(), &work_size, &info);
  if (info != 0) throw Error("cycle: the eigenvalues of the monodromy matrix did not converge");
  std::vector<Ritz> result;
  for (std::size_t i = 0; i < n; ++i)
  {
    const auto column = vectors.begin() + static_cast<std::ptrdiff_t>((imaginary[i] < 0 ? i - 1 : i) * n);
    result.push_back({{real[i], imaginary[i]}, {column, column + static_cast<std::ptrdiff_t>(n)}});
  }
  std::sort(result.begin(), result.end(),
            [](const Ritz& a, const Ritz& b) { return std::abs(a.value) > std::abs(b.value); });
  return result;
}

/// The shift's own multiplier, in the middle of what the monodromy matrix makes of it.
double shift_multiplier(Shooting& shooting, const Orbit& orbit)
{
  const Owned<Vec> shift = copy_of(orbit.rate.get());
  normalise(shooting, shift);
  const Owned<Vec> image = monodromy(shooting, orbit, shift);
  return energy_product(shooting.flow, shift, image);
}

/// A few Krylov steps may lift a multiplier of modulus 1 a little: 1.006 was seen.
std::string verdict(double largest, double error, bool whole)
{
  const double above = std::max(error, whole ? 1e-6 : 1e-2), below = std::max(error, 1e-6);
  return largest < 1 - below ? "stable" : largest > 1 + above ? "unstable" : "undecided";
}

} // namespace

Owned<Vec> find_multipliers(Shooting& shooting, const Orbit& orbit, const std::vector<Owned<Vec>>& asleep,
                            LimitCycle& cycle)
{
  PetscInt dofs = 0;
  check(VecGetSize(displacement(orbit.state), &dofs));
  PetscInt wanted = shooting.options.multipliers;
  if (wanted < 0) wanted = dofs <= 25 ? 2 * dofs : 8 + 2 * static_cast<PetscInt>(asleep.size());
  cycle.multipliers.clear();
  cycle.stability.clear();
  const int steps = static_cast<int>(std::min(wanted, 2 * dofs));
  if (steps == 0) return {};
  const bool whole = steps == 2 * dofs;
  Tangent tangent;
  if (!whole)
  {
    const double speed = energy_norm(shooting.flow, orbit.rate);
    tangent = {zeros_like(orbit.rate), orbit.rate};
    energy_image(shooting.flow, orbit.rate, tangent.phase);
    check(VecScale(tangent.phase, 1 / (speed * speed)));
  }
  const Krylov krylov =
      arnoldi(shooting, orbit, tangent, whole ? every_direction(shooting) : suspects(shooting, orbit, asleep), steps);
  std::vector<Ritz> found = eigenvalues(krylov);
  cycle.multiplier_periods += krylov.size;
  if (whole)
  {
    const auto shift =
        std::min_element(found.begin(), found.end(),
                         [](const Ritz& a, const Ritz& b) { return std::abs(a.value - 1.) < std::abs(b.value - 1.); });
    cycle.trivial_error = std::abs(shift->value - 1.);
    found.erase(shift);
  }
  else
  {
    cycle.trivial_error = std::abs(shift_multiplier(shooting, orbit) - 1);
    ++cycle.multiplier_periods;
  }
  if (found.empty()) return {};
  for (const Ritz& ritz : found) cycle.multipliers.push_back(ritz.value);
  cycle.stability = verdict(std::abs(found.front().value), cycle.trivial_error, whole);
  Owned<Vec> growing = zeros_like(orbit.state);
  for (std::size_t i = 0; i < krylov.base.size(); ++i) check(VecAXPY(growing, found.front().real[i], krylov.base[i]));
  normalise(shooting, growing);
  return growing;
}

} // namespace squeal
