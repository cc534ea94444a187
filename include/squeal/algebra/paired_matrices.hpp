#pragma once
/// M and K, symmetric and whole on one process, stored together (src/README.md, section 8.5). One pass through their
/// upper triangles gives the products of both, for several trajectories at once.
#include "squeal/base/petsc.hpp"

#include <array>
#include <optional>
#include <span>
#include <vector>

namespace squeal
{

struct PairedMatrices
{
  std::vector<PetscInt> starts, columns;     // of each row, from the diagonal on
  std::vector<std::array<double, 2>> values; // M_ij, K_ij
};

/// Nothing unless M and K are sparse and whole on this process.
std::optional<PairedMatrices> pair_matrices(Mat M, Mat K);

/// Mv = M v and Ku = K u of each.
void multiply_both(const PairedMatrices& matrices, std::span<const Vec> v, std::span<const Vec> u,
                   std::span<const Vec> Mv, std::span<const Vec> Ku);

} // namespace squeal
