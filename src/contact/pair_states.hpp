#pragma once
/// The laws of pairs of one increment, and their derivatives, before a step of the iteration (src/README.md, section
/// 2.9).
#include "squeal/contact/stick_slip.hpp"

#include <boost/math/tools/roots.hpp>
#include <cmath>

namespace squeal
{

inline Eigen::Vector3d entries(const Eigen::VectorXd& x, std::size_t pair, int directions)
{
  const PairVector v = PairView<const double>(x, directions).vector(pair);
  return {v[0], v[1], v[2]};
}

/// Forces taken to the cone of friction, with the derivative by those before.
struct ProjectedForces
{
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Matrix3d J = Eigen::Matrix3d::Zero();
};

/// The root l >= 0 of l (1 - x^2/(1 + l)^2) = e^2: a force of length x is taken into the disc of radius 1 by 1/(1 + l).
inline double shrinking(double x, double e)
{
  const double least = std::max(0., x - 1);
  if (e == 0) return least;
  const double most = least + 1 + 2 * e * e;
  const auto excess = [&](double l)
  {
    const double inside = (1 + l - x) * (1 + l + x) / ((1 + l) * (1 + l));
    return std::pair{l * inside - e * e, inside + 2 * l * x * x / ((1 + l) * (1 + l) * (1 + l))};
  };
  std::uintmax_t evaluations = 200;
  return boost::math::tools::newton_raphson_iterate(excess, most, least, most, 52, evaluations);
}

/// A pair before a step of the iteration.
struct PairState
{
  Eigen::Vector3d r, w;
  double mu;
  Eigen::Vector2d e; // of the drive; zero: it has none
  NaturalScale rho;
  double grazing; // [N] of which no sign is read
  double smooth;  // [N] by which corners of the law are rounded off

  double pressing() const { return r[0] - rho.normal * w[0]; }
  Eigen::Vector2d pulling() const { return r.tail<2>() - rho.tangential * w.tail<2>(); }

  ContactStatus status() const
  {
    if (pressing() < -grazing) return ContactStatus::open;
    const bool sticks = e.isZero(0) && mu > 0 && pulling().norm() <= mu * pressing();
    return sticks ? ContactStatus::stick : ContactStatus::slip;
  }

  /// proj(r - rho w) with the disc of the projected normal reaction.
  ProjectedForces projected() const
  {
    ProjectedForces to;
    const double h = pressing(), root = std::hypot(h, 2 * smooth);
    to.p[0] = h > 0 ? (h + root) / 2 : smooth == 0 ? 0 : 2 * smooth * (smooth / (root - h));
    to.J(0, 0) = smooth > 0 ? to.p[0] / root : status() != ContactStatus::open;
    if (!e.isZero(0))
    {
      to.p.tail<2>() = mu * to.p[0] * e;
      to.J.block<2, 1>(1, 0) = mu * to.J(0, 0) * e;
      return to;
    }
    const Eigen::Vector2d t = pulling();
    if (const double radius = mu * to.p[0]; radius > 0)
    {
      const Eigen::Vector2d T = t / radius;
      const double x = T.norm(), l = shrinking(x, smooth / radius), m = 1 + l,
                   c = smooth > 0 ? smooth / radius / l * (smooth / radius) : std::max(0., 1 - x * x),
                   along = l > 0 ? 2 * l / (m * m * (c + 2 * l * x * x / (m * m * m))) : 0;
      to.p.tail<2>() = t / m;
      to.J.bottomRightCorner<2, 2>() = Eigen::Matrix2d::Identity() / m - along / (m * m) * T * T.transpose();
      to.J.block<2, 1>(1, 0) = along * mu * to.J(0, 0) * T;
    }
    else if (mu > 0 && t.norm() > 0)
      to.J.block<2, 1>(1, 0) = mu * to.J(0, 0) * t.normalized();
    return to;
  }
};

/// All pairs before a step of the iteration.
struct PairStates
{
  const StickSlipOperator& of;
  const StickSlipFriction& friction;
  const StickSlipState& at;
  double smooth;
  double grazing = 1e-9 * at.r.lpNorm<Eigen::Infinity>();

  PairState operator[](std::size_t pair) const
  {
    const std::span<const double> e = TangentView<const double>(friction.e, of.directions).of(pair);
    return {entries(at.r, pair, of.directions),
            entries(at.w, pair, of.directions),
            friction.mu[pair],
            {e.empty() ? 0 : e[0], e.size() > 1 ? e[1] : 0},
            of.rho[pair],
            grazing,
            smooth};
  }

  /// The laws' defect [N], r - proj(r - rho w).
  Eigen::VectorXd defects() const
  {
    Eigen::VectorXd result = at.r;
    const PairRows<Eigen::Index> rows(of.directions);
    for (std::size_t pair = 0; pair < of.rho.size(); ++pair)
      result.segment(rows.normal(static_cast<Eigen::Index>(pair)), rows.per_pair()) -=
          (*this)[pair].projected().p.head(rows.per_pair());
    return result;
  }
};

} // namespace squeal
