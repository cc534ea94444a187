#pragma once
/// The two families of element kernels behind element.hpp.
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/solid/element.hpp"

namespace squeal
{

ElementMatrices solid_matrices(Shape shape, const NodePositions& X, const Material& material);
ElementMatrices shell_matrices(Shape shape, const NodePositions& X, const Material& material, double thickness);

/// Determinant of a Jacobian, or std::runtime_error naming it when it is not positive.
double positive(double determinant, std::size_t point);

/// Dense symmetric matrix as the array that ElementMatrices holds.
template <class Matrix> std::vector<double> entries(const Matrix& A)
{
  return {A.data(), A.data() + A.size()};
}

} // namespace squeal
