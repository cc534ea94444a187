/// Block Gauss-Seidel for problems that share W. Sweeps are the outer loop, pairs the next, problems the inner one, so
/// that a pair's rows are read once for all the problems in which it moves.
///
/// With w = w_0 + dw, w_0 = W r_0 + b exact and dw the effect of the changes since, the sweeps update dw alone: from
/// the near field, both in single precision, which dw's smallness affords, or from W where that did not converge.
/// The residual is believed only after w was formed afresh.
#include "contact_work.hpp"
#include "squeal/algebra/simd.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

namespace squeal
{

namespace
{

/// In the precision of the target.
template <class Entry, class Sum> SQUEAL_INLINE void add_block(const Entry* __restrict rows, std::size_t count,
                                                               std::size_t block, const PairVector& change,
                                                               Sum* __restrict target)
{
  const auto x = static_cast<Sum>(change[0]), y = static_cast<Sum>(change[1]), z = static_cast<Sum>(change[2]);
  const Entry *const second = rows + count, *const third = second + count;
  if (block == 1)
    for (std::size_t j = 0; j < count; ++j) target[j] += x * rows[j];
  else if (block == 2)
    for (std::size_t j = 0; j < count; ++j) target[j] += x * rows[j] + y * second[j];
  else
    for (std::size_t j = 0; j < count; ++j) target[j] += x * rows[j] + y * second[j] + z * third[j];
}

} // namespace

SQUEAL_SIMD void add_rows(const float* rows, std::size_t count, std::size_t block, const PairVector& change,
                          float* target)
{
  add_block(rows, count, block, change, target);
}

namespace
{

/// `Entry`: of what is swept over, float for the near field and double for W itself.
template <class Entry> struct Sweep
{
  ContactWork& work;
  std::vector<Entry> dw;
  bool dirty = false; // dw is not zero
  bool done = false;  // the sweeps have met their target, or nothing moves any more
  double fresh_residual = std::numeric_limits<double>::infinity(); // at the last product with W
  double target = 0;                                               // of the sweeps until the next one
  double relaxation = 1, earlier = 0;
  int in_vain = 0; // products with W that told otherwise than the sweeps
};

SQUEAL_SIMD void add_whole_rows(const double* rows, std::size_t count, std::size_t block, const PairVector& change,
                                double* target)
{
  add_block(rows, count, block, change, target);
}

SQUEAL_SIMD void add_runs(const NearField& near, std::size_t pair, std::size_t block, const PairVector& change,
                          float* target)
{
  const float* values = &near.values[near.values_of[pair]];
  for (std::size_t run = near.runs_of[pair]; run < near.runs_of[pair + 1]; ++run)
  {
    const auto [first, count] = near.runs[run];
    add_block(values, count, block, change, target + first);
    values += block * count;
  }
}

template <class Entry>
void spread(const ContactOperator& W, std::size_t pair, const PairVector& change, std::vector<Entry>& dw)
{
  if constexpr (std::is_same_v<Entry, float>)
    add_runs(W.near, pair, W.block(), change, dw.data());
  else
    add_whole_rows(&W.W[pair * W.block() * W.size()], W.size(), W.block(), change, dw.data());
}

template <class Entry> PairVector velocity_of(const Sweep<Entry>& sweep, std::size_t i, std::size_t block)
{
  PairVector w = sweep.work.velocity(i);
  for (std::size_t k = 0; k < block; ++k) w[k] += sweep.dw[i + k];
  return w;
}

/// False if it is the reaction there is.
template <class Entry> bool change_reaction(Sweep<Entry>& sweep, std::size_t pair, const PairVector& next)
{
  const std::size_t block = sweep.work.W.block(), i = pair * block;
  PairVector change{};
  for (std::size_t k = 0; k < block; ++k)
  {
    change[k] = next[k] - sweep.work.r[i + k];
    sweep.work.r[i + k] = next[k];
  }
  if (change == PairVector{}) return false;
  spread<Entry>(sweep.work.W, pair, change, sweep.dw);
  return sweep.dirty = true;
}

/// A warm start need not be admissible, nor finite after a failed step.
template <class Entry> void admit(Sweep<Entry>& sweep)
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
template <class Entry> bool visit(Sweep<Entry>& sweep, std::size_t pair, double limit, double largest)
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
template <class Entry> double seen_residual(Sweep<Entry>& sweep)
{
  std::vector<double> exact = sweep.work.Wr;
  for (std::size_t i = 0; i < exact.size(); ++i) sweep.work.Wr[i] += sweep.dw[i];
  const double residual = residual_of(sweep.work);
  sweep.work.Wr = std::move(exact);
  return residual;
}

/// What rounding of the entries and of their sums allows the sweeps to see of dw, which is as large as the residual at
/// first.
template <class Entry> void aim(Sweep<Entry>& sweep, const ContactSettings& settings)
{
  const double digits = 32 * static_cast<double>(std::numeric_limits<Entry>::epsilon());
  sweep.target = std::max(settings.tolerance / 4, digits * sweep.fresh_residual);
}

/// After a product with W: whether the sweeps go on, and what they aim at.
template <class Entry> bool goes_on(Sweep<Entry>& sweep, const ContactSettings& settings)
{
  ContactResult& result = sweep.work.result;
  const double before = sweep.fresh_residual;
  result.residual = sweep.fresh_residual = residual_of(sweep.work);
  result.converged = result.residual <= settings.tolerance;
  if (result.converged || !std::isfinite(result.residual) || result.iterations >= settings.max_iterations) return false;
  if (sweep.done) sweep.in_vain = result.residual > before / 2 ? sweep.in_vain + 1 : 0;
  sweep.done = false;
  aim(sweep, settings);
  return sweep.in_vain < 2; // else this is what rounding, or the near field, allows
}

template <class Entry> void relax(Sweep<Entry>& sweep)
{
  // strong friction makes sweeps go round in circles, which shorter changes often end
  const double residual = sweep.work.result.residual;
  if (sweep.earlier > 0 && residual > .5 * sweep.earlier) sweep.relaxation = std::max(.25, sweep.relaxation / 2);
  sweep.earlier = residual;
}

/// One sweep of all of them; those that are done, or due for a product with W, leave.
template <class Entry> void sweep_once(std::vector<Sweep<Entry>*>& moving, const ContactSettings& settings)
{
  std::vector<double> largest;
  for (const Sweep<Entry>* sweep : moving) largest.push_back(largest_reaction(sweep->work.r));
  std::vector<char> moved(moving.size(), 0);
  const std::size_t pairs = moving.front()->work.W.diagonal.size();
  for (std::size_t pair = 0; pair < pairs; ++pair)
    for (std::size_t k = 0; k < moving.size(); ++k)
      if (visit(*moving[k], pair, moving[k]->target / 8, largest[k])) moved[k] = 1;
  std::vector<Sweep<Entry>*> still;
  for (std::size_t k = 0; k < moving.size(); ++k)
  {
    Sweep<Entry>& sweep = *moving[k];
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

/// Where the sweeps begin: an admissible start, whose residual is as yet seen through the entries swept over.
template <class Entry> void begin(Sweep<Entry>& sweep, const ContactSettings& settings)
{
  admit(sweep);
  if (!sweep.dirty) return;
  sweep.fresh_residual = seen_residual(sweep);
  aim(sweep, settings);
}

/// One product with W for all that need it.
template <class Entry> void refresh(std::span<Sweep<Entry>* const> sweeps)
{
  std::vector<ContactWork*> stale;
  for (Sweep<Entry>* sweep : sweeps)
  {
    if (!sweep->dirty) continue;
    stale.push_back(&sweep->work);
    sweep->dirty = false;
    std::fill(sweep->dw.begin(), sweep->dw.end(), Entry{0});
  }
  squeal::refresh(stale);
}

template <class Entry> void solve(std::span<ContactWork* const> works, const ContactSettings& settings)
{
  std::vector<Sweep<Entry>> sweeps;
  sweeps.reserve(works.size());
  for (ContactWork* work : works) sweeps.push_back({*work, std::vector<Entry>(work->b.size())});
  std::vector<Sweep<Entry>*> active;
  for (Sweep<Entry>& sweep : sweeps)
  {
    begin(sweep, settings);
    if (sweep.dirty || goes_on(sweep, settings)) active.push_back(&sweep);
  }
  while (!active.empty())
  {
    std::vector<Sweep<Entry>*> moving = active;
    while (!moving.empty()) sweep_once(moving, settings);
    refresh<Entry>(active);
    std::erase_if(active, [&](Sweep<Entry>* sweep) { return !goes_on(*sweep, settings); });
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
