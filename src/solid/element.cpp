#include "squeal/solid/element.hpp"

#include "kernels.hpp"
#include "squeal/mesh/shapes.hpp"

#include <sstream>
#include <stdexcept>

namespace squeal
{

int dofs_per_node(Shape shape)
{
  return is_shell(shape) ? 6 : 3;
}

double positive_jacobian(double determinant, std::size_t point)
{
  if (determinant > 0) return determinant;
  std::ostringstream text;
  text << "the Jacobian is " << determinant << " at integration point " << point
       << ": the element is too distorted, folded or numbered inside out; correct the mesh there";
  throw std::runtime_error(text.str());
}

ElementMatrices element_matrices(Shape shape, std::span<const Vec3> x, const Material& material, double thickness)
{
  const NodePositions X = position_matrix(x);
  return is_shell(shape) ? shell_matrices(shape, X, material, thickness) : solid_matrices(shape, X, material);
}

} // namespace squeal
