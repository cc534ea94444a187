// A frictional structure for events.cpp: its reactions, rates and constraints for given statuses of its pairs.
#pragma once

#include <Eigen/Dense>

#include <array>
#include <cmath>
#include <vector>

using Eigen::MatrixXd;
using Eigen::VectorXd;

enum : int
{
  open = 0,
  stick = 1,
  forwards = 2,
  backwards = 3
};

inline int sign(int status)
{
  return status == forwards ? 1 : status == backwards ? -1 : 0;
}

struct System
{
  int n = 0, pairs = 0;
  MatrixXd inverse_mass, C, K, M, Bn, Bt, W; // W = B M^-1 B', rows normal first, then tangential
  VectorXd F, gap, drive, u0;
  MatrixXd B;
  double kinetic = 0, rest = 0, decay = 1; // friction coefficient at high speed, at rest, decay speed
  double length = 1, speed = 1, force = 1, acceleration = 1;
  std::vector<int> status;

  double mu(double s) const { return kinetic + (rest - kinetic) * std::exp(-std::abs(s) / decay); }
};

// Reactions (normal, then tangential) for given statuses: zero rows of B x'' on closed and sticking pairs. w = B a
// without reactions, or B v before an impulse; coefficients are each slipping pair's mu.
inline bool reactions(const System& s, const std::vector<int>& status, const VectorXd& w, const VectorXd& mu,
                      VectorXd& r)
{
  const int m = s.pairs;
  r.setZero(2 * m);
  std::array<int, 16> row{};
  int rows = 0;
  for (int i = 0; i < m; ++i)
    if (status[i] != open)
    {
      row[rows++] = i;
      if (status[i] == stick) row[rows++] = m + i;
    }
  if (rows == 0) return true;
  MatrixXd A(rows, rows);
  VectorXd b(rows);
  for (int p = 0; p < rows; ++p)
  {
    b(p) = -w(row[p]);
    for (int q = 0; q < rows; ++q)
    {
      const int column = row[q];
      A(p, q) = s.W(row[p], column);
      if (column < m && sign(status[column]) != 0)
        A(p, q) -= mu(column) * sign(status[column]) * s.W(row[p], m + column);
    }
  }
  const Eigen::PartialPivLU<MatrixXd> lu(A);
  const VectorXd x = lu.solve(b);
  if (!x.allFinite()) return false;
  for (int p = 0; p < rows; ++p)
  {
    r(row[p]) = x(p);
    if (row[p] < m && sign(status[row[p]]) != 0) r(m + row[p]) = -mu(row[p]) * sign(status[row[p]]) * x(p);
  }
  return true;
}

struct Rates
{
  VectorXd a, r;
};

inline void rates(const System& s, const std::vector<int>& status, const VectorXd& u, const VectorXd& v, Rates& out)
{
  const VectorXd free = s.inverse_mass * (s.F - s.C * v - s.K * u);
  VectorXd mu(s.pairs);
  const VectorXd sliding = s.Bt * v - s.drive;
  for (int i = 0; i < s.pairs; ++i) mu(i) = s.mu(status[i] == stick ? 0 : sliding(i));
  reactions(s, status, s.B * free, mu, out.r);
  out.a = free + s.inverse_mass * (s.B.transpose() * out.r);
}

// One event function a pair and kind: it falls through zero.
inline void events(const System& s, const VectorXd& u, const VectorXd& v, const Rates& now, VectorXd& e)
{
  e.setConstant(2 * s.pairs, 1);
  const VectorXd gap = s.gap + s.Bn * u, sliding = s.Bt * v - s.drive;
  for (int i = 0; i < s.pairs; ++i)
  {
    if (s.status[i] == open)
    {
      e(2 * i) = gap(i) / s.length;
      continue;
    }
    e(2 * i) = now.r(i) / s.force;
    e(2 * i + 1) = s.status[i] == stick ? (s.rest * now.r(i) - std::abs(now.r(s.pairs + i))) / s.force
                                        : sign(s.status[i]) * sliding(i) / s.speed;
  }
}
