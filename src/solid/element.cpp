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
  const NodePositions X = columns_of(x);
  return dofs_per_node(shape) == 6 ? shell_matrices(shape, X, material, thickness) : solid_matrices(shape, X, material);
}

/// n dA = (dx/dxi x dx/deta) dxi deta
std::vector<Vec3> face_weights(FaceShape shape, std::span<const Vec3> x)
{
  const NodePositions X = columns_of(x);
  std::vector<Vec3> weights(x.size(), Vec3{});
  for (const auto& [xi, weight] : area_rule(shape))
  {
    const Interpolation at = interpolate(shape, xi);
    const Eigen::Vector3d along = X * at.dN.row(0).transpose(), across = X * at.dN.row(1).transpose();
    const Eigen::Vector3d area = weight * along.cross(across);
    for (std::size_t i = 0; i < x.size(); ++i)
      for (int k = 0; k < 3; ++k) weights[i][k] += at.N(static_cast<Eigen::Index>(i)) * area(k);
  }
  return weights;
}

} // namespace squeal
