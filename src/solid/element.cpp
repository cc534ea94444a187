#include "squeal/solid/element.hpp"

#include "kernels.hpp"
#include "squeal/mesh/shapes.hpp"

namespace squeal
{

int dofs_per_node(Shape shape)
{
  return is_shell(shape) ? 6 : 3;
}

ElementMatrices element_matrices(Shape shape, std::span<const Vec3> x, const Material& material, double thickness)
{
  const NodePositions X = position_matrix(x);
  return is_shell(shape) ? shell_matrices(shape, X, material, thickness) : solid_matrices(shape, X, material);
}

} // namespace squeal
