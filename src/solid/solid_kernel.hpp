#pragma once
/// Element matrices of solids.
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/solid/element.hpp"

namespace squeal
{

/// Returns the matrices of a solid with nodes at the columns of X [m].
ElementMatrices solid_matrices(Shape shape, const NodePositions& X, const Material& material);

} // namespace squeal
