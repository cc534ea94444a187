#pragma once
/// The two families of element kernels behind element.hpp.
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/solid/element.hpp"

namespace squeal
{

ElementMatrices solid_matrices(Shape shape, const NodePositions& X, const Material& material);
ElementMatrices shell_matrices(Shape shape, const NodePositions& X, const Material& material, double thickness);

/// Returns the determinant of a Jacobian. Throws std::runtime_error with its value if it is not positive.
double positive_jacobian(double determinant, std::size_t point);

} // namespace squeal
