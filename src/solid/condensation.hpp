#pragma once
/// Static condensation of an element's internal parameters a, which no neighbour shares and no load drives:
///     strain = B u + Ba a,   a = -H^-1 G u,   H = int Ba' D Ba,   G = int Ba' D B,   hence   B <- B - Ba H^-1 G.
/// With the condensed B at the integration points, stiffness and stress need nothing else.
#include <Eigen/Dense>
#include <vector>

namespace squeal
{

/// Strain operator at one integration point and the volume [m3] or area [m2] that it stands for.
template <class Operator> struct StrainPoint
{
  Operator B;
  double measure = 0;
};

/// Returns -H^-1 G: the internal parameters of unit displacements, one displacement a column.
template <class Operator, class Elasticity> Eigen::MatrixXd
condense(std::vector<StrainPoint<Operator>>& points, const std::vector<Operator>& Ba, const Elasticity& D)
{
  const auto parameters = Ba.front().cols(), dofs = points.front().B.cols();
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 12, 12>;
  using Rectangle = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 12, 60>;
  Square H = Square::Zero(parameters, parameters);
  Rectangle G = Rectangle::Zero(parameters, dofs);
  for (std::size_t p = 0; p < points.size(); ++p)
  {
    const Operator stress = points[p].measure * D * Ba[p];
    H += stress.transpose() * Ba[p];
    G += stress.transpose() * points[p].B;
  }
  const Rectangle a = -H.ldlt().solve(G);
  for (std::size_t p = 0; p < points.size(); ++p) points[p].B += Ba[p] * a;
  return a;
}

/// K = int B' D B, exactly symmetric whatever the order of the sums.
template <class Operator, class Elasticity>
Eigen::MatrixXd stiffness_of(const std::vector<StrainPoint<Operator>>& points, const Elasticity& D)
{
  const auto dofs = points.front().B.cols();
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(dofs, dofs);
  for (const auto& [B, measure] : points)
  {
    const Operator stress = measure * D * B;
    K.noalias() += B.transpose() * stress;
  }
  return .5 * (K + K.transpose());
}

} // namespace squeal
