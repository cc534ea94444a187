#pragma once
/// M and K, symmetric and whole on one process, side by side: what a step multiplies by them goes through their common
/// pattern once, one triangle of it, and once for several trajectories.
#include "squeal/base/petsc.hpp"

#include <array>
#include <optional>
#include <span>
#include <vector>

namespace squeal
{

struct PairedMatrices
{
  std::vector<int> starts, columns;          // by rows, from the diagonal on
  std::vector<std::array<double, 2>> values; // M_ij, K_ij
};

/// Nothing unless M and K are sparse and whole on this process.
std::optional<PairedMatrices> paired(Mat M, Mat K);

/// Mv = M v and Ku = K u of each.
void multiply_both(const PairedMatrices& matrices, std::span<const Vec> v, std::span<const Vec> u,
                   std::span<const Vec> Mv, std::span<const Vec> Ku);

} // namespace squeal
