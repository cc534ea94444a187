#pragma once
/// Element matrices of flat shells.
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/solid/element.hpp"

namespace squeal
{

/// Returns the matrices of a shell with nodes at the columns of X [m].
ElementMatrices shell_matrices(Shape shape, const NodePositions& X, const Material& material, double thickness);

} // namespace squeal
