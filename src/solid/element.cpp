/// Which kernel serves which shape, and what both families share.
#include "squeal/solid/element.hpp"

#include "kernels.hpp"

#include <sstream>
#include <stdexcept>

namespace squeal
{

int dofs_per_node(Shape shape)
{
  return shape == Shape::shell4 || shape == Shape::shell3 ? 6 : 3;
}

double positive(double determinant, std::size_t point)
{
  if (determinant > 0) return determinant;
  std::ostringstream text;
  text << "the Jacobian is " << determinant << " at integration point " << point
       << ": the element is too distorted, folded or numbered inside out; mend the mesh there";
  throw std::runtime_error(text.str());
}

ElementMatrices element_matrices(Shape shape, std::span<const Vec3> x, const Material& material, double thickness)
{
  const NodePositions X = position_matrix(x);
  return dofs_per_node(shape) == 6 ? shell_matrices(shape, X, material, thickness) : solid_matrices(shape, X, material);
}

} // namespace squeal
