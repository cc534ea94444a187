/// A straight beam of two nodes with transverse shear, by the shapes of a beam that is loaded at its ends alone
/// (Timoshenko; Przemieniecki, Theory of Matrix Structural Analysis, 1968). With phi = 12 E I/(k G A L^2) and xi = x/L:
///     v = [1 - 3 xi^2 + 2 xi^3 + phi (1 - xi)]/(1 + phi) v_a + L [xi - 2 xi^2 + xi^3 + phi (xi - xi^2)/2]/(1 + phi)
///     t_a
/// and alike at b. Stiffness is exact; the mass has the rotation of the sections.
#include "kernels.hpp"

#include "squeal/base/constants.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <array>
#include <cmath>
#include <Eigen/Dense>

namespace squeal
{

namespace
{

using Row = Eigen::RowVector4d;            // of v_a, t_a, v_b, t_b
using Rows = Eigen::Matrix<double, 6, 12>; // of the motion of a section, or of its strain
using Columns = const std::array<int, 4>&; // of v_a, t_a, v_b, t_b

struct Bending
{
  Row motion, rotation, curvature, shear;
};

/// At xi of a beam of length L.
Bending bending_at(double xi, double L, double phi)
{
  const double f = 1 / (1 + phi), p = xi * xi, q = xi * p, lag = phi * (xi - p) / 2;
  Bending at;
  at.motion << 1 - 3 * p + 2 * q + phi * (1 - xi), L * (xi - 2 * p + q + lag), 3 * p - 2 * q + phi * xi,
      L * (q - p - lag);
  at.rotation << 6 * (p - xi) / L, 1 - 4 * xi + 3 * p + phi * (1 - xi), 6 * (xi - p) / L, 3 * p - 2 * xi + phi * xi;
  at.curvature << 6 * (2 * xi - 1) / L, 6 * xi - 4 - phi, 6 * (1 - 2 * xi) / L, 6 * xi - 2 + phi;
  at.shear << -phi / L, -phi / 2, phi / L, -phi / 2;
  at.motion *= f;
  at.rotation *= f;
  at.curvature *= f / L;
  at.shear *= f;
  return at;
}

/// Adds a row of four, with the second and fourth times `sign`.
void put(Rows& rows, int row, Columns columns, const Row& values, double sign)
{
  for (int k = 0; k < 4; ++k) rows(row, columns[static_cast<std::size_t>(k)]) += (k % 2 == 0 ? 1 : sign) * values(k);
}

/// Columns: the axes of the beam.
Eigen::Matrix3d axes_of(const Eigen::Vector3d& along, const Vec3& axis_2)
{
  Eigen::Vector3d second(axis_2.data());
  if (second.norm() == 0)
  {
    Eigen::Index least = 0;
    along.cwiseAbs().minCoeff(&least);
    second = Eigen::Vector3d::Unit(least);
  }
  Eigen::Matrix3d axes;
  axes.col(0) = along;
  axes.col(1) = (second - second.dot(along) * along).normalized();
  axes.col(2) = axes.col(0).cross(axes.col(1));
  return axes;
}

double shear_number(const BeamSection& s, double inertia, double L)
{
  return s.shear_factor > 0 ? 12 * s.young * inertia / (s.shear_factor * s.shear * s.area * L * L) : 0;
}

} // namespace

ElementMatrices beam_matrices(const Vec3& a, const Vec3& b, const Vec3& axis_2, const BeamSection& s)
{
  constexpr std::array<int, 4> along_2 = {1, 5, 7, 11}, along_3 = {2, 4, 8, 10};
  const Eigen::Vector3d span(Vec3(b - a).data());
  const double L = span.norm(), kGA = s.shear_factor * s.shear * s.area;
  const double phi_2 = shear_number(s, s.bending_2, L), phi_3 = shear_number(s, s.bending_3, L);
  const Eigen::Vector<double, 6> stiffness{s.young * s.area,     kGA, kGA, s.shear * s.torsion, s.young * s.bending_3,
                                           s.young * s.bending_2};
  Eigen::Vector<double, 6> mass{s.area, s.area, s.area, s.bending_2 + s.bending_3, s.bending_3, s.bending_2};
  mass *= s.density;
  ElementMatrices local{Eigen::MatrixXd::Zero(12, 12), Eigen::MatrixXd::Zero(12, 12)};
  for (const LinePoint& point : gauss(4))
  {
    const double xi = (1 + point.x) / 2, length = point.weight * L / 2;
    Rows motion = Rows::Zero(), strain = Rows::Zero();
    for (const int first : {0, 3})
    {
      motion(first, first) = 1 - xi;
      motion(first, first + 6) = xi;
      strain(first, first) = -1 / L;
      strain(first, first + 6) = 1 / L;
    }
    const Bending in_2 = bending_at(xi, L, phi_2), in_3 = bending_at(xi, L, phi_3);
    put(motion, 1, along_2, in_2.motion, 1);
    put(motion, 5, along_2, in_2.rotation, 1);
    put(strain, 1, along_2, in_2.shear, 1);
    put(strain, 5, along_2, in_2.curvature, 1);
    put(motion, 2, along_3, in_3.motion, -1);
    put(motion, 4, along_3, -in_3.rotation, -1);
    put(strain, 2, along_3, in_3.shear, -1);
    put(strain, 4, along_3, -in_3.curvature, -1);
    local.mass += length * motion.transpose() * mass.asDiagonal() * motion;
    local.stiffness += length * strain.transpose() * stiffness.asDiagonal() * strain;
  }
  const Eigen::Matrix3d axes = axes_of(span / L, axis_2);
  Eigen::MatrixXd turn = Eigen::MatrixXd::Zero(12, 12);
  for (int k = 0; k < 12; k += 3) turn.block<3, 3>(k, k) = axes.transpose();
  return {turn.transpose() * local.stiffness * turn, turn.transpose() * local.mass * turn};
}

BeamSection section_of(const Beam& beam)
{
  BeamSection section{
      beam.young,       beam.young / (2 * (1 + beam.poisson)), beam.density, beam.area, 0, 0, beam.torsion,
      beam.shear_factor};
  if (beam.diameter > 0)
  {
    const double quarter = two_pi / 8 * beam.diameter * beam.diameter; // pi d^2/4
    section.area = quarter;
    section.bending_2 = section.bending_3 = quarter * beam.diameter * beam.diameter / 16;
    section.torsion = 2 * section.bending_2;
  }
  else
  {
    section.bending_2 = beam.bending.front();
    section.bending_3 = beam.bending.back();
  }
  return section;
}

} // namespace squeal
