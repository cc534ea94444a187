#pragma once
/// Complex vectors side by side, and what an Arnoldi process does with them. Every function is collective; small
/// matrices are whole on every rank.
#include "squeal/analysis/block.hpp"

#include <Eigen/Dense>

namespace squeal
{

struct ComplexBlock
{
  Block re, im; // of one shape

  PetscInt columns() const { return re.columns; }
};

/// A X
ComplexBlock product(Mat A, const ComplexBlock& X);

/// X* Y
Eigen::MatrixXcd inner(const ComplexBlock& X, const ComplexBlock& Y);

/// Y += X a
void add_combination(ComplexBlock& Y, const ComplexBlock& X, const Eigen::MatrixXcd& a);

/// Y += alpha X
void add(ComplexBlock& Y, std::complex<double> alpha, const ComplexBlock& X);

/// X a
ComplexBlock combination(const ComplexBlock& X, const Eigen::MatrixXcd& a);

ComplexBlock columns_from(const ComplexBlock& X, PetscInt first);

/// The part of X that the orthonormal V lacks joins V as orthonormal columns; a column that V holds up to 1e-13 of its
/// length is dropped. Returns V* X, V the new one.
Eigen::MatrixXcd extend_orthonormal(ComplexBlock& V, ComplexBlock X);

/// The first half of every rank's rows, and the second.
ComplexBlock upper_half(const ComplexBlock& Z);
ComplexBlock lower_half(const ComplexBlock& Z);
ComplexBlock stacked(const ComplexBlock& upper, const ComplexBlock& lower);

} // namespace squeal
