#include "squeal/contact/condensed.hpp"

#include <cmath>

namespace squeal
{

namespace
{

/// Entries that are all different, the same for any number of ranks: a start for inverse iteration.
Owned<Vec> uneven_vector(Mat A)
{
  Owned<Vec> x;
  check(MatCreateVecs(A, x.put(), nullptr));
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(x, &first, &last));
  for (PetscInt i = first; i < last; ++i)
    check(VecSetValue(x, i, 1 + 0.5 * std::sin(7. * static_cast<double>(i) + 1), INSERT_VALUES));
  check(VecAssemblyBegin(x));
  check(VecAssemblyEnd(x));
  return x;
}

/// Inverse iteration: x becomes the motion that A resists least, next to D = diag(A); returns x'A x / x'D x.
double least_resistance(const Factor& factor, Vec D, Vec x)
{
  const auto load = zeros_like(x), scaled = zeros_like(x);
  double quotient = 1;
  for (int iteration = 0; iteration < 3; ++iteration)
  {
    double size = 0, work = 0, weight = 0;
    check(VecNorm(x, NORM_INFINITY, &size));
    if (!std::isfinite(size) || size == 0) return 0;
    check(VecScale(x, 1 / size));
    check(VecPointwiseMult(load, D, x));
    solve(factor, load, x);
    check(VecPointwiseMult(scaled, D, x));
    check(VecDot(x, load, &work));
    check(VecDot(x, scaled, &weight));
    quotient = work / weight;
  }
  return quotient;
}

PetscInt row_of_largest_entry(Vec x)
{
  PetscInt where = 0;
  double value = 0;
  const auto size = zeros_like(x);
  check(VecCopy(x, size));
  check(VecAbs(size));
  check(VecMax(size, &where, &value));
  return where;
}

/// After a failed factorisation: finds the motion that A resists least, with a little added to A's diagonal. If that
/// matrix does not factor either, A is indefinite.
void find_loose(Mat A, Vec D, const FactorOptions& options, Factored& result)
{
  double largest = 0, part = 1e-8;
  check(VecNorm(D, NORM_INFINITY, &largest));
  const auto x = uneven_vector(A);
  const auto uniform = zeros_like(D);
  check(VecSet(uniform, 1));
  for (bool failed = true; failed && part < 100; part *= 10)
  {
    const Owned<Mat> shifted = copy_of(A);
    check(MatShift(shifted, largest > 0 ? part * largest : 1));
    const Factor factor(shifted, nullptr, options);
    failed = factor.failed();
    if (failed) result.indefinite = true;
    if (!failed) least_resistance(factor, uniform, x);
  }
  result.loose = row_of_largest_entry(x);
}

} // namespace

Factored factor_positive(Mat A, const Interface& interface, const FactorOptions& options)
{
  Factored result;
  Mat B = interface.pairs > 0 ? interface.B.get() : nullptr;
  result.factor = Factor(A, B, options);
  Owned<Vec> D;
  check(MatCreateVecs(A, D.put(), nullptr));
  check(MatGetDiagonal(A, D));
  if (result.factor.failed())
  {
    find_loose(A, D, options, result);
    return result;
  }
  // a singular matrix often factors without complaint; rounding leaves it this much resistance and no more
  const auto x = uneven_vector(A);
  result.resistance = least_resistance(result.factor, D, x);
  if (!(result.resistance > 1e-14)) result.loose = row_of_largest_entry(x);
  return result;
}

Factor factor_held(Mat A, const Interface& interface, const DofNames& names, const FactorOptions& options)
{
  auto [factor, loose, indefinite, resistance] = factor_positive(A, interface, options);
  if (loose)
    throw Error((indefinite ? "not positive definite: driven on, not back, is" : "singular: nothing resists") +
                (" a motion that is largest at " + describe(names, *loose)) + "; give it a support, a spring or mass");
  return std::move(factor);
}

} // namespace squeal
