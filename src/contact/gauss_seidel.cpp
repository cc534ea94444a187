/// Block Gauss-Seidel for problems that share W. Sweeps are the outer loop, pairs the next, problems the inner one, so
/// that a pair's rows are read once for all the problems in which it moves.
///
/// With w = w_0 + dw, w_0 = W r_0 + b exact and dw the effect of the changes since, the sweeps update dw alone: from
/// the near field in single precision, which its smallness affords, or from W in double where that did not converge.
/// The residual is believed only after w was formed afresh.
#include "wide.hpp"
#include "work.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace squeal
{

namespace
{

template <class Real> struct Sweep
{
  ContactWork& work;
  std::vector<Real> dw;
  bool dirty = false; // dw is not zero
  bool done = false;  // the sweeps have met their target, or nothing moves any more
  double fresh_residual = std::numeric_limits<double>::infinity(); // at the last product with W
  double target = 0;                                               // of the sweeps until the next one
  double relaxation = 1, earlier = 0;
  int in_vain = 0; // products with W that told otherwise than the sweeps
};

SQUEAL_WIDE void add_rows(const float* __restrict rows, std::size_t count, std::size_t block, const PairVector& change,
                          float* __restrict target)
{
  const auto x = static_cast<float>(change[0]), y = static_cast<float>(change[1]), z = static_cast<float>(change[2]);
  if (block == 2)
    for (std::size_t j = 0; j < count; ++j) target[j] += x * rows[j] + y * rows[count + j];
  else
    for (std::size_t j = 0; j < count; ++j) target[j] += x * rows[j] + y * rows[count + j] + z * rows[2 * count + j];
}

SQUEAL_WIDE void add_rows(const double* __restrict rows, std::size_t count, std::size_t block, const PairVector& change,
                          double* __restrict target)
{
  if (block == 2)
    for (std::size_t j = 0; j < count; ++j) target[j] += change[0] * rows[j] + change[1] * rows[count + j];
  else
    for (std::size_t j = 0; j < count; ++j)
      target[j] += change[0] * rows[j] + change[1] * rows[count + j] + change[2] * rows[2 * count + j];
}

void spread(const ContactOperator& W, std::size_t pair, const PairVector& change, std::vector<double>& dw)
{
  const std::size_t n = W.size(), block = W.block();
  add_rows(&W.W[pair * block * n], n, block, change, dw.data());
}

void spread(const ContactOperator& W, std::size_t pair, const PairVector& change, std::vector<float>& dw)
{
  const std::size_t block = W.block();
  const float* values = &W.near.values[W.near.values_of[pair]];
  for (std::size_t run = W.near.runs_of[pair]; run < W.near.runs_of[pair + 1]; ++run)
  {
    const auto [first, count] = W.near.runs[run];
    add_rows(values, count, block, change, &dw[first]);
    values += block * count;
  }
}

template <class Real> PairVector velocity_of(const Sweep<Real>& sweep, std::size_t i, std::size_t block)
{
  PairVector w = sweep.work.velocity(i);
  for (std::size_t k = 0; k < block; ++k) w[k] += sweep.dw[i + k];
  return w;
}

/// False if it is the reaction there is.
template <class Real> bool change_reaction(Sweep<Real>& sweep, std::size_t pair, const PairVector& next)
{
  const std::size_t block = sweep.work.W.block(), i = pair * block;
  PairVector change{};
  for (std::size_t k = 0; k < block; ++k)
  {
    change[k] = next[k] - sweep.work.r[i + k];
    sweep.work.r[i + k] = next[k];
  }
  if (change == PairVector{}) return false;
  spread(sweep.work.W, pair, change, sweep.dw);
  return sweep.dirty = true;
}

/// A warm start need not be admissible, nor finite after a failed step.
template <class Real> void admit(Sweep<Real>& sweep)
{
  const ContactWork& work = sweep.work;
  for (std::size_t pair = 0; pair < work.W.diagonal.size(); ++pair)
  {
    PairVector start = pair_of(work.r, pair * work.W.block(), work.W.block());
    if (start[0] < 0 || !work.takes_part(pair)) start = {};
    project_on_disc(start, work.friction);
    change_reaction(sweep, pair, start);
  }
}

/// Solves one pair if its law is missed by more than `limit`; false if it does not move.
template <class Real> bool visit(Sweep<Real>& sweep, std::size_t pair, double limit, double largest)
{
  const ContactWork& work = sweep.work;
  const ContactOperator& W = work.W;
  const std::size_t block = W.block(), i = pair * block;
  if (!work.takes_part(pair)) return false;
  const PairVector w = velocity_of(sweep, i, block), last = pair_of(work.r, i, block);
  const double defect = natural_map(last, w, work.friction, W.rho_n[pair], W.rho_t[pair]);
  if (defect <= limit * work.force_scale(pair, largest)) return false;
  const PairBlock& A = W.diagonal[pair];
  PairVector q = w;
  for (std::size_t k = 0; k < block; ++k)
    for (std::size_t l = 0; l < block; ++l) q[k] -= A[k][l] * last[l];
  PairVector next = solve_pair(A, q, W.directions, work.friction, last);
  if (sweep.relaxation < 1) // stays admissible: the cone is convex
    for (std::size_t k = 0; k < block; ++k) next[k] = last[k] + sweep.relaxation * (next[k] - last[k]);
  return change_reaction(sweep, pair, next);
}

/// The residual as far as the sweeps know it.
template <class Real> double seen_residual(Sweep<Real>& sweep)
{
  std::vector<double> exact = sweep.work.Wr;
  for (std::size_t i = 0; i < exact.size(); ++i) sweep.work.Wr[i] += sweep.dw[i];
  const double residual = residual_of(sweep.work);
  sweep.work.Wr = std::move(exact);
  return residual;
}

/// After a product with W: what the next sweeps aim at, and whether they go on.
template <class Real> bool goes_on(Sweep<Real>& sweep, const ContactSettings& settings)
{
  ContactResult& result = sweep.work.result;
  const double before = sweep.fresh_residual;
  result.residual = sweep.fresh_residual = residual_of(sweep.work);
  result.converged = result.residual <= settings.tolerance;
  if (result.converged || !std::isfinite(result.residual) || result.iterations >= settings.max_iterations) return false;
  if (sweep.done) sweep.in_vain = result.residual > before / 2 ? sweep.in_vain + 1 : 0;
  sweep.done = false;
  // what rounding of dw, which is as large as the residual at first, allows the sweeps to see
  const double digits = 16 * static_cast<double>(std::numeric_limits<Real>::epsilon());
  sweep.target = std::max(settings.tolerance / 4, digits * result.residual);
  return sweep.in_vain < 2; // else this is what rounding, or the near field, allows
}

template <class Real> void relax(Sweep<Real>& sweep)
{
  // strong friction makes sweeps go round in circles, which shorter changes often end
  const double residual = sweep.work.result.residual;
  if (sweep.earlier > 0 && residual > .5 * sweep.earlier) sweep.relaxation = std::max(.25, sweep.relaxation / 2);
  sweep.earlier = residual;
}

/// One sweep of all of them; those that are done, or due for a product with W, leave.
template <class Real> void sweep_once(std::vector<Sweep<Real>*>& moving, const ContactSettings& settings)
{
  std::vector<double> largest;
  for (const Sweep<Real>* sweep : moving) largest.push_back(largest_reaction(sweep->work.r));
  std::vector<char> moved(moving.size(), 0);
  const std::size_t pairs = moving.front()->work.W.diagonal.size();
  for (std::size_t pair = 0; pair < pairs; ++pair)
    for (std::size_t k = 0; k < moving.size(); ++k)
      if (visit(*moving[k], pair, moving[k]->target / 8, largest[k])) moved[k] = 1;
  std::vector<Sweep<Real>*> still;
  for (std::size_t k = 0; k < moving.size(); ++k)
  {
    Sweep<Real>& sweep = *moving[k];
    ContactResult& result = sweep.work.result;
    ++result.iterations;
    result.residual = seen_residual(sweep);
    if (result.iterations % 50 == 0) relax(sweep);
    sweep.done = !(result.residual > sweep.target) || !moved[k];
    const bool due = result.iterations % 50 == 0 || result.iterations >= settings.max_iterations;
    if (!sweep.done && !due) still.push_back(&sweep);
  }
  moving = std::move(still);
}

template <class Real> void solve(std::span<ContactWork* const> works, const ContactSettings& settings)
{
  std::vector<Sweep<Real>> sweeps;
  sweeps.reserve(works.size());
  for (ContactWork* work : works) sweeps.push_back({*work, std::vector<Real>(work->b.size())});
  std::vector<Sweep<Real>*> active;
  for (Sweep<Real>& sweep : sweeps)
  {
    admit(sweep);
    active.push_back(&sweep);
  }
  while (!active.empty())
  {
    std::vector<ContactWork*> stale;
    for (Sweep<Real>* sweep : active)
      if (sweep->dirty) stale.push_back(&sweep->work);
    refresh(stale);
    for (Sweep<Real>* sweep : active)
    {
      sweep->dirty = false;
      std::fill(sweep->dw.begin(), sweep->dw.end(), Real(0));
    }
    std::erase_if(active, [&](Sweep<Real>* sweep) { return !goes_on(*sweep, settings); });
    std::vector<Sweep<Real>*> moving = active;
    while (!moving.empty()) sweep_once(moving, settings);
  }
}

} // namespace

void gauss_seidel(std::span<ContactWork* const> works, const ContactSettings& settings)
{
  if (works.empty()) return;
  std::vector<ContactWork*> left(works.begin(), works.end());
  if (!works.front()->W.near.runs.empty())
  {
    solve<float>(left, settings);
    std::erase_if(left, [&](const ContactWork* work)
                  { return work->result.converged || work->result.iterations >= settings.max_iterations; });
  }
  solve<double>(left, settings);
}

} // namespace squeal
