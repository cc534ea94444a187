#pragma once
/// Parts that the kernels of solids and shells share. Static condensation of the internal parameters a of an element,
/// which no neighbour shares and no load acts on:
///     strain = B u + Ba a,   a = -H^-1 G u,   H = int Ba' D Ba,   G = int Ba' D B,   hence   B <- B - Ba H^-1 G.
/// Stiffness and stress then follow from the condensed B at the integration points alone.
#include "squeal/base/dense.hpp"
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
Eigen::MatrixXd condense_parameters(std::vector<StrainPoint<Strains>>& points, const std::vector<ParameterStrains>& Ba,
                                    const Elasticity& D)
{
  const Eigen::Index parameters = Ba.front().cols();
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(parameters, parameters),
                  G = Eigen::MatrixXd::Zero(parameters, points.front().B.cols());
  for (std::size_t p = 0; p < points.size(); ++p)
  {
    const ParameterStrains stress = points[p].measure * D * Ba[p];
    H += stress.transpose() * Ba[p];
    G += stress.transpose() * points[p].B;
  }
  const Eigen::MatrixXd a = -H.ldlt().solve(G);
  for (std::size_t p = 0; p < points.size(); ++p) points[p].B += Ba[p] * a;
  return a;
}

/// Returns K = int B' D B, symmetric to the last bit whatever the order of the sums.
template <class Strains, class Elasticity>
Eigen::MatrixXd stiffness_matrix(const std::vector<StrainPoint<Strains>>& points, const Elasticity& D)
{
  const Eigen::Index dofs = points.front().B.cols();
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(dofs, dofs);
  for (const auto& [B, measure] : points)
  {
    const Strains stress = measure * D * B;
    K.noalias() += B.transpose() * stress;
  }
  return 0.5 * (K + K.transpose());
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

/// Returns the matrices of a solid or shell with nodes at the columns of X [m]. A shell's middle surface is at the arms
/// [m] from them.
ElementMatrices solid_matrices(Shape shape, const NodePositions& X, const Material& material);
ElementMatrices shell_matrices(Shape shape, const NodePositions& X, const NodePositions& arms, const Material& material,
                               double thickness);

struct BeamSection
{
  double young = 0, shear = 0;         // [Pa] moduli
  double density = 0;                  // [kg/m3]
  double area = 0;                     // [m2]
  double bending_2 = 0, bending_3 = 0; // [m4] second moments, for bending along axis 2 and along axis 3
  double torsion = 0;                  // [m4]
  double shear_factor = 0;             // [-] area of shear over area; 0: rigid
};

BeamSection section_of(const Beam& beam);

/// Returns the matrices of a beam from a to b on x y z rx ry rz of both. `axis_2` lies across it; zero: any.
ElementMatrices beam_matrices(const Vec3& a, const Vec3& b, const Vec3& axis_2, const BeamSection& section);

} // namespace squeal
