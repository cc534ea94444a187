#pragma once
/// M and K, symmetric, stored together (src/README.md, section 8.5). One pass gives the products of both. Of the
/// columns that a rank owns the upper triangle is stored, of others each entry.
#include "squeal/base/petsc.hpp"

#include <array>
#include <Eigen/Core>
#include <optional>
#include <petscsf.h>
#include <span>
#include <vector>

namespace squeal
{

/// Entries of M and K by rows: M_ij, K_ij.
struct PairedRows
{
  std::vector<PetscInt> starts{0}, columns{};
  std::vector<std::array<double, 2>> values{};
};

/// The entries of M and K of this rank, and what it exchanges with others for a product.
struct PairedMatrices
{
  MPI_Comm comm = MPI_COMM_NULL;
  PairedRows own;           // from the diagonal on
  PairedRows foreign;       // columns of other ranks, counted in the order in which they are received
  std::size_t received = 0; // number of these columns
  Owned<PetscSF> exchange;  // of their rows
};

/// Nothing unless M and K are sparse and of one pattern with the diagonal. Collective.
std::optional<PairedMatrices> pair_matrices(Mat M, Mat K);

/// `to` = (M v, K u) of `of` = (v, u). Collective.
void multiply_both(const PairedMatrices& matrices, const std::array<Vec, 2>& of, const std::array<Vec, 2>& to);

/// Whether A is stored by compressed rows (AIJ).
bool is_sparse(Mat A);

} // namespace squeal
