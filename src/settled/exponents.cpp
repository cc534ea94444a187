#include "squeal/settled/exponents.hpp"

#include "squeal/algebra/multivector.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

/// Gram-Schmidt. Returns the length of each column before it was scaled, beside those before it.
std::vector<double> orthonormalise(const Flow& flow, std::vector<Owned<Vec>>& columns)
{
  std::vector<double> lengths;
  for (std::size_t k = 0; k < columns.size(); ++k)
  {
    for (int pass = 0; pass < 2; ++pass)
      for (std::size_t j = 0; j < k; ++j)
        check(VecAXPY(columns[k], -energy_product(flow, columns[j], columns[k]), columns[j]));
    lengths.push_back(std::max(energy_norm(flow, columns[k]), 1e-300));
    check(VecScale(columns[k], 1 / lengths.back()));
  }
  return lengths;
}

} // namespace

TangentBundle make_bundle(const Flow& flow, Vec like, PetscInt count)
{
  TangentBundle bundle;
  const MultiVector random = random_multivector(flow.M, 2 * count);
  for (PetscInt k = 0; k < count; ++k)
  {
    Owned<Vec> column = zeros_like(like);
    copy_column(random, 2 * k, displacement(column));
    copy_column(random, 2 * k + 1, velocity(column));
    // both parts weigh about the same, each column's in a ratio of its own: one degree of freedom has two columns
    const Owned<Vec> image = zeros_like(like);
    energy_image(flow, column, image);
    double of_u = 0, of_v = 0;
    check(VecDot(displacement(column), displacement(image), &of_u));
    check(VecDot(velocity(column), velocity(image), &of_v));
    if (of_u > 0 && of_v > 0)
      check(VecScale(velocity(column), (1 + 0.37 * static_cast<double>(k)) * std::sqrt(of_u / of_v)));
    bundle.columns.push_back(std::move(column));
  }
  orthonormalise(flow, bundle.columns);
  bundle.growth.resize(static_cast<std::size_t>(count));
  return bundle;
}

void follow_period(const Flow& flow, TangentBundle& bundle)
{
  flow.apply_tangent(std::vector<Vec>(bundle.columns.begin(), bundle.columns.end()));
  if (flow.offsets.without_held) // each held one has an exponent zero
    for (const Owned<Vec>& column : bundle.columns)
    {
      flow.offsets.without_held(displacement(column));
      flow.offsets.without_held(velocity(column));
    }
  const std::vector<double> lengths = orthonormalise(flow, bundle.columns);
  for (std::size_t k = 0; k < lengths.size(); ++k) bundle.growth[k].push_back(std::log(lengths[k]));
}

std::vector<MeanValue> exponents_of(const TangentBundle& bundle, std::size_t skipped, double windows)
{
  std::vector<MeanValue> exponents;
  for (const std::vector<double>& growth : bundle.growth)
  {
    if (growth.size() < skipped + 4) return {};
    const std::span<const double> counted = std::span(growth).subspan(skipped);
    const MeanValue mean = batch_mean(counted);
    const double shear = std::numbers::ln2 / static_cast<double>(counted.size());
    exponents.push_back({windows * mean.value, windows * (mean.error + shear)});
  }
  std::stable_sort(exponents.begin(), exponents.end(),
                   [](const MeanValue& a, const MeanValue& b) { return a.value > b.value; });
  return exponents;
}

} // namespace squeal
