// Motion of a frictional structure by events, for tests/evidence/random_systems.py: no code, no step and no contact
// solver of squeal's.
//
//   M v' + C v + K u = F + Bn' rn + Bt' rt,   v = u',   0 <= g0 + Bn u _|_ rn >= 0,   |rt| <= mu(|s|) rn,  rt opposes s
//   = Bt v - drive
//
// Every pair has one tangential row and is open, sticks or slips one way. Between events the equations are smooth:
// Dormand and Prince's pair of orders 5 and 4. Events are zeros of gap, reaction, sliding velocity and margin of stick.
// Impacts are plastic: impulses keep both laws with the velocities after them. The status after an event is the
// consistent one of all combinations.

#include "events.hpp"

#include <cstring>

namespace
{

struct Step
{
  VectorXd u, v;
  double error = 0;
  Rates end;
};

void advance(const System& s, const VectorXd& u, const VectorXd& v, const Rates& start, double h, double relative,
             Step& out)
{
  static const double a[6][6] = {{1.0 / 5},
                                 {3.0 / 40, 9.0 / 40},
                                 {44.0 / 45, -56.0 / 15, 32.0 / 9},
                                 {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
                                 {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
                                 {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
  static const double d[7] = {71.0 / 57600, 0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
  std::array<VectorXd, 7> ku, kv;
  ku[0] = v;
  kv[0] = start.a;
  for (int stage = 0; stage < 6; ++stage)
  {
    out.u = u;
    out.v = v;
    for (int j = 0; j <= stage; ++j)
      if (a[stage][j] != 0)
      {
        out.u += h * a[stage][j] * ku[j];
        out.v += h * a[stage][j] * kv[j];
      }
    rates(s, s.status, out.u, out.v, out.end);
    ku[stage + 1] = out.v;
    kv[stage + 1] = out.end.a;
  }
  VectorXd eu = VectorXd::Zero(s.n), ev = eu;
  for (int j = 0; j < 7; ++j)
  {
    eu += h * d[j] * ku[j];
    ev += h * d[j] * kv[j];
  }
  out.error = std::max(eu.cwiseAbs().maxCoeff() / s.length, ev.cwiseAbs().maxCoeff() / s.speed) / relative;
}

// Puts closed pairs back to a gap of zero and to rest along the normal, sticking ones to the drive: rounding and the
// step's error.
void project(const System& s, VectorXd& u, VectorXd& v)
{
  std::array<int, 16> row{};
  int rows = 0, normals = 0;
  for (int i = 0; i < s.pairs; ++i)
    if (s.status[i] != open) row[rows++] = i;
  normals = rows;
  for (int i = 0; i < s.pairs; ++i)
    if (s.status[i] == stick) row[rows++] = s.pairs + i;
  if (rows == 0) return;
  MatrixXd A(rows, rows);
  VectorXd bu = VectorXd::Zero(rows), bv(rows);
  for (int p = 0; p < rows; ++p)
  {
    for (int q = 0; q < rows; ++q) A(p, q) = s.W(row[p], row[q]);
    bv(p) = s.B.row(row[p]).dot(v) - (row[p] < s.pairs ? 0 : s.drive(row[p] - s.pairs));
    if (p < normals) bu(p) = s.gap(row[p]) + s.Bn.row(row[p]).dot(u);
  }
  const auto put_back = [&](int size, const VectorXd& b, VectorXd& x)
  {
    const VectorXd y = A.topLeftCorner(size, size).ldlt().solve(b.head(size));
    for (int p = 0; p < size; ++p) x -= y(p) * (s.inverse_mass * s.B.row(row[p]).transpose());
  };
  put_back(normals, bu, u);
  put_back(rows, bv, v);
}

bool touches(const System& s, int i, const VectorXd& u)
{
  return s.status[i] != open || s.gap(i) + s.Bn.row(i).dot(u) < 1e-9 * s.length;
}

// Next combination of statuses; pairs that do not touch stay open.
bool next(std::vector<int>& status, const std::vector<bool>& touching)
{
  for (std::size_t i = 0; i < status.size(); ++i)
  {
    if (!touching[i]) continue;
    if (++status[i] <= backwards) return true;
    status[i] = open;
  }
  return false;
}

// Plastic impact of all pairs that touch. Returns the margin of the statuses found; negative where none is consistent.
double impact(System& s, const VectorXd& u, VectorXd& v)
{
  std::vector<bool> touching(s.pairs);
  for (int i = 0; i < s.pairs; ++i) touching[i] = touches(s, i, u);
  const VectorXd w = s.B * v - (VectorXd(2 * s.pairs) << VectorXd::Zero(s.pairs), s.drive).finished();
  std::vector<int> status(s.pairs, open), best;
  double margin = -1e300;
  VectorXd r, best_r;
  do
  {
    VectorXd mu(s.pairs), after = w;
    for (int pass = 0; pass < 60; ++pass)
    { // mu at the mean speed of the impact
      for (int i = 0; i < s.pairs; ++i) mu(i) = s.mu((after(s.pairs + i) + w(s.pairs + i)) / 2);
      if (!reactions(s, status, w, mu, r)) break;
      const VectorXd change = s.W * r + w - after;
      after += change;
      if (s.rest == s.kinetic || change.cwiseAbs().maxCoeff() < 1e-14 * s.speed) break;
    }
    double least = 1e300;
    const double impulse = 1e-300 + r.cwiseAbs().maxCoeff();
    for (int i = 0; i < s.pairs; ++i)
    {
      if (!touching[i]) continue;
      if (status[i] == open)
        least = std::min(least, after(i) / s.speed);
      else
        least = std::min(least, r(i) / impulse);
      if (status[i] == stick) least = std::min(least, (mu(i) * r(i) - std::abs(r(s.pairs + i))) / impulse);
      if (sign(status[i]) != 0) least = std::min(least, sign(status[i]) * after(s.pairs + i) / s.speed);
    }
    if (least > margin)
    {
      margin = least;
      best = status;
      best_r = r;
    }
  } while (next(status, touching));
  v += s.inverse_mass * (s.B.transpose() * best_r);
  return margin;
}

// Statuses of touching pairs that the accelerations keep. Pairs that slide keep their way.
double settle(System& s, const VectorXd& u, const VectorXd& v)
{
  std::vector<bool> touching(s.pairs);
  const VectorXd sliding = s.Bt * v - s.drive, normal = s.Bn * v;
  for (int i = 0; i < s.pairs; ++i) touching[i] = touches(s, i, u) && normal(i) < 1e-9 * s.speed;
  std::vector<int> status(s.pairs, open), best = status;
  double margin = -1e300;
  Rates now;
  do
  {
    bool allowed = true;
    for (int i = 0; i < s.pairs && allowed; ++i)
      if (touching[i] && std::abs(sliding(i)) > 1e-9 * s.speed && status[i] != open)
        allowed = status[i] == (sliding(i) > 0 ? forwards : backwards);
    if (!allowed) continue;
    rates(s, status, u, v, now);
    double least = 1e300;
    for (int i = 0; i < s.pairs; ++i)
    {
      if (!touching[i]) continue;
      if (status[i] == open)
        least = std::min(least, s.Bn.row(i).dot(now.a) / s.acceleration);
      else
        least = std::min(least, now.r(i) / s.force);
      if (status[i] == stick) least = std::min(least, (s.rest * now.r(i) - std::abs(now.r(s.pairs + i))) / s.force);
      if (sign(status[i]) != 0 && std::abs(sliding(i)) <= 1e-9 * s.speed)
        least = std::min(least, sign(status[i]) * s.Bt.row(i).dot(now.a) / s.acceleration);
    }
    if (least > margin)
    {
      margin = least;
      best = status;
    }
  } while (next(status, touching));
  s.status = best;
  return margin;
}

double energy(const System& s, const VectorXd& u, const VectorXd& v)
{
  return (v.dot(s.M * v) + (u - s.u0).dot(s.K * (u - s.u0))) / 2;
}

} // namespace

extern "C"
{

  System* make_system(int n, int pairs, const double* M, const double* C, const double* K, const double* Bn,
                      const double* Bt, const double* F, const double* gap, const double* drive, const double* u0,
                      const double* friction, const double* scales)
  {
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const auto matrix = [](const double* p, int rows, int columns)
    { return MatrixXd(Eigen::Map<const Rows>(p, rows, columns)); };
    const auto vector = [](const double* p, int size) { return VectorXd(Eigen::Map<const VectorXd>(p, size)); };
    auto* s = new System;
    s->n = n, s->pairs = pairs;
    s->M = matrix(M, n, n), s->C = matrix(C, n, n), s->K = matrix(K, n, n);
    s->inverse_mass = s->M.inverse();
    s->Bn = matrix(Bn, pairs, n), s->Bt = matrix(Bt, pairs, n);
    s->B.resize(2 * pairs, n);
    s->B << s->Bn, s->Bt;
    s->W = s->B * s->inverse_mass * s->B.transpose();
    s->F = vector(F, n), s->gap = vector(gap, pairs), s->drive = vector(drive, pairs), s->u0 = vector(u0, n);
    s->kinetic = friction[0], s->rest = friction[1], s->decay = friction[2];
    s->length = scales[0], s->speed = scales[1], s->force = scales[2], s->acceleration = scales[3];
    return s;
  }

  void free_system(System* s)
  {
    delete s;
  }

  // Integrates x = (u, v) over `time`. statuses: in and out; the first is negative: found from x. samples: rows of (u,
  // v) at equal times. sums: time integrals of the fluctuating energy and of 1 while some pair is open, while some
  // sticks, events, impacts. Returns 0, or 1 where no status is consistent, 2 where events pile up.
  int integrate(System* system, double* x, double time, int* statuses, double relative, double longest, int samples,
                double* sampled, double* sums)
  {
    System& s = *system;
    VectorXd u = Eigen::Map<VectorXd>(x, s.n), v = Eigen::Map<VectorXd>(x + s.n, s.n);
    s.status.assign(s.pairs, open);
    if (statuses[0] < 0)
    {
      for (int i = 0; i < s.pairs; ++i)
        if (s.gap(i) + s.Bn.row(i).dot(u) < 1e-7 * s.length) s.status[i] = forwards;
      VectorXd still = v;
      project(s, u, still);
      if (impact(s, u, v) < -1e-6) return 1;
      settle(s, u, v);
      project(s, u, v);
    }
    else
    {
      s.status.assign(statuses, statuses + s.pairs);
      project(s, u, v);
    }
    Rates now;
    rates(s, s.status, u, v, now);
    double t = 0, h = longest / 10;
    int stored = 0, idle = 0, code = 0;
    VectorXd before(2 * s.pairs), after(2 * s.pairs);
    Step step;
    std::fill(sums, sums + 5, 0.0);
    while (samples > 0 ? stored < samples : t < time)
    {
      const double stop = samples > 0 ? time * (stored + 1) / samples : time;
      h = std::min(h, longest);
      const bool cut = t + h >= stop * (1 - 1e-15);
      double taken = cut ? stop - t : h;
      advance(s, u, v, now, taken, relative, step);
      if (step.error > 1 && taken > 1e-12 * longest)
      {
        h = taken * std::max(0.2, 0.9 * std::pow(step.error, -0.2));
        continue;
      }
      h = (cut && taken < h / 2) ? h : taken * std::min(3.0, 0.9 * std::pow(std::max(step.error, 1e-6), -0.2));
      events(s, u, v, now, before);
      events(s, step.u, step.v, step.end, after);
      int which = -1;
      const auto crossed = [&](const VectorXd& e)
      {
        for (int i = 0; i < e.size(); ++i)
          if (e(i) < 0 && (before(i) > 0 || e(i) < -1e-10)) return true;
        return false;
      };
      if (crossed(after))
      { // the first zero, by halving: every trial is a step of its own
        double low = 0, high = taken;
        for (int k = 0; k < 60 && high - low > 1e-13 * longest; ++k)
        {
          const double middle = (low + high) / 2;
          advance(s, u, v, now, middle, relative, step);
          events(s, step.u, step.v, step.end, after);
          (crossed(after) ? high : low) = middle;
        }
        taken = high;
        advance(s, u, v, now, taken, relative, step);
        events(s, step.u, step.v, step.end, after);
        double least = 0;
        for (int i = 0; i < after.size(); ++i)
          if (after(i) < 0 && (before(i) > 0 || after(i) < -1e-10) && (which < 0 || after(i) < least))
          {
            which = i;
            least = after(i);
          }
      }
      const double e0 = energy(s, u, v), e1 = energy(s, step.u, step.v);
      const double em = energy(s, (u + step.u) / 2 + taken / 8 * (v - step.v),
                               1.5 * (step.u - u) / std::max(taken, 1e-300) - (v + step.v) / 4);
      sums[0] += taken * (e0 + 4 * em + e1) / 6;
      bool some_open = false, some_stick = false;
      for (const int status : s.status) some_open |= status == open, some_stick |= status == stick;
      sums[1] += some_open ? taken : 0;
      sums[2] += some_stick ? taken : 0;
      u = step.u, v = step.v, now = step.end;
      t += taken;
      if (which < 0)
      {
        project(s, u, v);
        rates(s, s.status, u, v, now);
        idle = 0;
        if (cut)
        {
          t = stop;
          if (samples > 0)
          {
            std::memcpy(sampled + static_cast<long>(stored) * 2 * s.n, u.data(), sizeof(double) * s.n);
            std::memcpy(sampled + static_cast<long>(stored) * 2 * s.n + s.n, v.data(), sizeof(double) * s.n);
            ++stored;
          }
        }
        continue;
      }
      sums[3] += 1;
      idle = taken < 1e-9 * longest ? idle + 1 : 0;
      if (idle > 200)
      {
        code = 2;
        break;
      }
      const int pair = which / 2, was = s.status[pair];
      bool whole = true;
      if (was == open)
      {
        sums[4] += 1;
        s.status[pair] = forwards; // it touches
        VectorXd still = v;
        project(s, u, still);
        if (impact(s, u, v) < -1e-6)
        {
          code = 1;
          break;
        }
      }
      else if (which % 2 == 0)
      {
        s.status[pair] = open;
        whole = idle > 3;
      }
      else if (was == stick)
      {
        s.status[pair] = now.r(s.pairs + pair) > 0 ? backwards : forwards;
        whole = idle > 3;
      }
      if (whole && settle(s, u, v) < -1e-5)
      {
        code = 1;
        break;
      }
      project(s, u, v);
      rates(s, s.status, u, v, now);
      h = std::min(h, longest / 20);
    }
    std::memcpy(x, u.data(), sizeof(double) * s.n);
    std::memcpy(x + s.n, v.data(), sizeof(double) * s.n);
    for (int i = 0; i < s.pairs; ++i) statuses[i] = s.status[i];
    return code;
  }
}
