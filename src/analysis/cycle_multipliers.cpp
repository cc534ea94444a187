/// Floquet multipliers: eigenvalues of dPhi_T/dx at the cycle, by Arnoldi in the energy product on difference
/// quotients of the flow. With as many steps as the state has entries it is the whole monodromy matrix.
/// Caveat: one multiplier is 1 (a shift in time); how far from 1 it comes out is the error bar of the verdict.
#include "squeal/analysis/shooting.hpp"

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

/// The start holds every direction, reproducibly and whatever the number of ranks.
Owned<Vec> starting_vector(const Shooting& shooting, const Orbit& orbit)
{
  Owned<Vec> start = zeros_like(orbit.state);
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
  check(VecScale(start, 1 / energy_norm(shooting.flow, start)));
  return start;
}

std::vector<std::complex<double>> eigenvalues(std::vector<double> H, int size)
{
  const std::size_t n = static_cast<std::size_t>(size);
  std::vector<double> real(n), imaginary(n), work(16 * n);
  PetscBLASInt order = size, one = 1, work_size = 16 * size, info = 0;
  double unused = 0;
  LAPACKgeev_("N", "N", &order, H.data(), &order, real.data(), imaginary.data(), &unused, &one, &unused, &one,
              work.data(), &work_size, &info);
  if (info != 0) throw Error("cycle: the eigenvalues of the monodromy matrix did not converge");
  std::vector<std::complex<double>> result;
  for (std::size_t i = 0; i < n; ++i) result.emplace_back(real[i], imaginary[i]);
  std::sort(result.begin(), result.end(), [](const auto& a, const auto& b) { return std::abs(a) > std::abs(b); });
  return result;
}

} // namespace

void find_multipliers(Shooting& shooting, const Orbit& orbit, LimitCycle& cycle)
{
  PetscInt dofs = 0;
  check(VecGetSize(displacement(orbit.state), &dofs));
  PetscInt wanted = shooting.options.multipliers;
  if (wanted < 0) wanted = dofs <= 25 ? 2 * dofs : 0;
  const int steps = static_cast<int>(std::min(wanted, 2 * dofs));
  if (steps == 0) return;
  const std::size_t n = static_cast<std::size_t>(steps);
  std::vector<Owned<Vec>> base;
  std::vector<double> hessenberg(n * n); // column-major
  base.push_back(starting_vector(shooting, orbit));
  int done = 0;
  while (done < steps)
  {
    const std::size_t k = static_cast<std::size_t>(done++);
    Owned<Vec> image = monodromy(shooting, orbit, base[k]);
    ++cycle.multiplier_periods;
    for (int pass = 0; pass < 2; ++pass)
      for (std::size_t i = 0; i <= k; ++i)
      {
        const double along = energy_product(shooting.flow, base[i], image);
        hessenberg[i + k * n] += along;
        check(VecAXPY(image, -along, base[i]));
      }
    const double left = energy_norm(shooting.flow, image);
    if (done == steps || left < 1e-6) break; // the rest is noise of the differences
    hessenberg[k + 1 + k * n] = left;
    check(VecScale(image, 1 / left));
    base.push_back(std::move(image));
  }
  const std::size_t m = static_cast<std::size_t>(done);
  std::vector<double> H(m * m);
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t k = 0; k < m; ++k) H[i + k * m] = hessenberg[i + k * n];
  cycle.multipliers = eigenvalues(std::move(H), done);
  const auto distance = [](std::complex<double> multiplier) { return std::abs(multiplier - 1.); };
  const auto trivial = std::min_element(cycle.multipliers.begin(), cycle.multipliers.end(),
                                        [&](auto a, auto b) { return distance(a) < distance(b); });
  cycle.trivial_error = distance(*trivial);
  double largest = 0;
  for (auto it = cycle.multipliers.begin(); it != cycle.multipliers.end(); ++it)
    if (it != trivial) largest = std::max(largest, std::abs(*it));
  const double margin = std::max(cycle.trivial_error, 1e-6);
  cycle.stability = largest < 1 - margin ? "stable" : largest > 1 + margin ? "unstable" : "undecided";
}

} // namespace squeal
