#pragma once
/// Parts that the kernels of solids and shells share. Static condensation of the internal parameters a of an element,
/// which no neighbour shares and no load acts on:
///     strain = B u + Ba a,   a = -H^-1 G u,   H = int Ba' D Ba,   G = int Ba' D B,   hence   B <- B - Ba H^-1 G.
/// Stiffness and stress then follow from the condensed B at the integration points alone.
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/solid/element.hpp"

#include <Eigen/Dense>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace squeal
{

/// Strain operator at one integration point.
template <class Strains> struct StrainPoint
{
  Strains B;          // strains of unit displacements, one displacement a column
  double measure = 0; // [m3 or m2] volume or area that the point stands for
};

/// Condenses the parameters with strain operators Ba out of the points. Returns -H^-1 G, the parameters of unit
/// displacements, one displacement a column.
template <class Strains, class ParameterStrains, class Elasticity>
auto condense_parameters(std::vector<StrainPoint<Strains>>& points, const std::vector<ParameterStrains>& Ba,
                         const Elasticity& D)
{
  constexpr int parameters = ParameterStrains::ColsAtCompileTime, dofs = Strains::ColsAtCompileTime;
  using Parameters = Eigen::Matrix<double, parameters, dofs>;
  Eigen::Matrix<double, parameters, parameters> H;
  Parameters G;
  H.setZero();
  G.setZero();
  for (std::size_t p = 0; p < points.size(); ++p)
  {
    const ParameterStrains stress = points[p].measure * D * Ba[p];
    H += stress.transpose() * Ba[p];
    G += stress.transpose() * points[p].B;
  }
  const Parameters a = -H.ldlt().solve(G);
  for (std::size_t p = 0; p < points.size(); ++p) points[p].B += Ba[p] * a;
  return a;
}

/// Returns K = int B' D B, symmetric to the last bit whatever the order of the sums.
template <class Strains, class Elasticity>
auto stiffness_matrix(const std::vector<StrainPoint<Strains>>& points, const Elasticity& D)
{
  constexpr int dofs = Strains::ColsAtCompileTime;
  using Square = Eigen::Matrix<double, dofs, dofs>;
  Square K = Square::Zero();
  for (const auto& [B, measure] : points)
  {
    const Strains stress = measure * D * B;
    K.noalias() += B.transpose() * stress;
  }
  return Square(0.5 * (K + K.transpose()));
}

/// Returns the determinant of a Jacobian. Throws std::runtime_error with its value if it is not positive.
inline double positive_jacobian(double determinant, std::size_t point)
{
  if (determinant > 0) return determinant;
  std::ostringstream text;
  text << "the Jacobian is " << determinant << " at integration point " << point
       << ": the element is too distorted, folded or numbered inside out; correct the mesh there";
  throw std::runtime_error(text.str());
}

/// Returns the matrices of a solid, or of a shell, with nodes at the columns of X [m].
ElementMatrices solid_matrices(Shape shape, const NodePositions& X, const Material& material);
ElementMatrices shell_matrices(Shape shape, const NodePositions& X, const Material& material, double thickness);

} // namespace squeal
