/// Block Gauss-Seidel for problems that share W. Sweeps are the outer loop, pairs the next, problems the inner one. So
/// a pair's rows are read once for all the problems in which it moves.
///
/// Let w = w_0 + dw with w_0 = W r_0 + b from the last product with W, and dw the effect of the changes since. The
/// sweeps update dw alone. It is small, so the near field and single precision suffice; where they did not lead to
/// convergence, W itself is swept over, where it is whole. A problem counts as converged only by the residual after a
/// product with W.
#include "gauss_seidel.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

namespace squeal
{

namespace
{

/// One problem while it is swept over. `Entry`: float for sweeps over the near field, double for sweeps over W.
template <class Entry> struct SweptProblem
{
  ContactWork& work;
  std::vector<Entry> dw;
  bool changed = false;  // dw is not zero
  bool finished = false; // the sweeps have met their target, or no reaction changes any more
  double exact_residual = std::numeric_limits<double>::infinity(); // at the last product with W
  double target = 0;                                               // residual at which the sweeps stop
  double relaxation = 1;                                           // part of each local solution's change that is made
  double residual_before = 0;                                      // 50 sweeps ago
  int failures = 0; // products with W in succession that did not halve the residual after finished sweeps
};

template <class Entry>
void add_product(const ContactOperator& W, std::size_t pair, const PairVector& change, std::vector<Entry>& dw)
{
  if constexpr (std::is_same_v<Entry, float>)
    W.add_near_product(pair, change, dw);
  else
    W.add_product(pair, change, dw);
}

template <class Entry> PairVector velocity_of(const SweptProblem<Entry>& problem, std::size_t pair)
{
  PairVector w = problem.work.velocity(pair);
  const PairVector change = PairView(problem.dw, problem.work.W.directions()).vector(pair);
  for (std::size_t k = 0; k < change.size(); ++k) w[k] += change[k];
  return w;
}

/// Sets the pair's reaction, and dw with it; false if the reaction is that already.
template <class Entry> bool change_reaction(SweptProblem<Entry>& problem, std::size_t pair, const PairVector& next)
{
  const PairVector last = problem.work.reaction(pair);
  if (next == last) return false;
  PairVector change{};
  for (std::size_t k = 0; k < change.size(); ++k) change[k] = next[k] - last[k];
  PairView<double>(problem.work.r, problem.work.W.directions()).set(pair, next);
  add_product<Entry>(problem.work.W, pair, change, problem.dw);
  return problem.changed = true;
}

/// A warm start need not be admissible, nor finite after a failed step.
template <class Entry> void admit(SweptProblem<Entry>& problem)
{
  const ContactWork& work = problem.work;
  for (std::size_t pair = 0; pair < work.W.pairs(); ++pair)
    change_reaction(problem, pair,
                    work.takes_part(pair) ? admissible(work.reaction(pair), velocity_of(problem, pair), work.friction)
                                          : PairVector{});
}

/// Solves one pair if its law is missed by more than `limit`; false if its reaction does not change.
template <class Entry> bool visit(SweptProblem<Entry>& problem, std::size_t pair, double limit, double largest)
{
  const ContactWork& work = problem.work;
  const ContactOperator& W = work.W;
  if (!work.takes_part(pair)) return false;
  const PairVector w = velocity_of(problem, pair), last = work.reaction(pair);
  const double defect = natural_map(last, w, work.friction, W.scale(pair));
  if (defect <= limit * work.scale_of(pair, largest)) return false;
  const PairBlock& A = W.diagonal(pair);
  PairVector next = solve_pair(A, velocity_without(A, last, w), W.directions(), work.friction, last);
  if (problem.relaxation < 1) // stays admissible: the cone is convex
    for (std::size_t k = 0; k < next.size(); ++k) next[k] = last[k] + problem.relaxation * (next[k] - last[k]);
  return change_reaction(problem, pair, next);
}

/// The residual by dw, whose rounding it contains.
template <class Entry> double estimated_residual(SweptProblem<Entry>& problem)
{
  std::vector<double> exact = problem.work.Wr;
  for (std::size_t i = 0; i < exact.size(); ++i) problem.work.Wr[i] += problem.dw[i];
  const double residual = residual_of(problem.work);
  problem.work.Wr = std::move(exact);
  return residual;
}

/// The sweeps stop below the tolerance, or where rounding of dw, which is as large as the residual at first, or what
/// the near field leaves out, hides the rest.
template <class Entry> void set_target(SweptProblem<Entry>& problem, const ContactSettings& settings)
{
  const double digits = 32 * static_cast<double>(std::numeric_limits<Entry>::epsilon());
  const double hidden = std::is_same_v<Entry, float> ? std::max(digits, NearField::left_out / 4) : digits;
  problem.target = std::max(settings.tolerance / 4, hidden * problem.exact_residual);
}

/// After a product with W: sets the result and the next target; returns whether more sweeps may help.
template <class Entry> bool continues(SweptProblem<Entry>& problem, const ContactSettings& settings)
{
  ContactResult& result = problem.work.result;
  const double before = problem.exact_residual;
  result.residual = problem.exact_residual = residual_of(problem.work);
  result.converged = result.residual <= settings.tolerance;
  if (result.converged || !std::isfinite(result.residual) || result.iterations >= settings.max_iterations) return false;
  if (problem.finished) problem.failures = result.residual > before / 2 ? problem.failures + 1 : 0;
  problem.finished = false;
  set_target(problem, settings);
  return problem.failures < 2; // else the residual is that of rounding, or of the near field
}

template <class Entry> void shorten_changes(SweptProblem<Entry>& problem)
{
  // with strong friction sweeps may repeat a cycle of reactions, which shorter changes often end
  const double residual = problem.work.result.residual;
  if (problem.residual_before > 0 && residual > 0.5 * problem.residual_before)
    problem.relaxation = std::max(0.25, problem.relaxation / 2);
  problem.residual_before = residual;
}

/// One sweep over all problems; those that are finished, or due for a product with W, leave the list.
template <class Entry> void sweep_once(std::vector<SweptProblem<Entry>*>& sweeping, const ContactSettings& settings)
{
  std::vector<double> largest;
  for (const SweptProblem<Entry>* problem : sweeping) largest.push_back(largest_reaction(problem->work.r));
  std::vector<char> moved(sweeping.size(), 0);
  const std::size_t pairs = sweeping.front()->work.W.pairs();
  for (std::size_t pair = 0; pair < pairs; ++pair)
    for (std::size_t k = 0; k < sweeping.size(); ++k)
      if (visit(*sweeping[k], pair, sweeping[k]->target / 8, largest[k])) moved[k] = 1;
  std::vector<SweptProblem<Entry>*> remaining;
  for (std::size_t k = 0; k < sweeping.size(); ++k)
  {
    SweptProblem<Entry>& problem = *sweeping[k];
    ContactResult& result = problem.work.result;
    ++result.iterations;
    result.residual = estimated_residual(problem);
    if (result.iterations % 50 == 0) shorten_changes(problem);
    problem.finished = !(result.residual > problem.target) || !moved[k];
    const bool due = result.iterations % 50 == 0 || result.iterations >= settings.max_iterations;
    if (!problem.finished && !due) remaining.push_back(&problem);
  }
  sweeping = std::move(remaining);
}

/// Makes the start admissible; where that changes reactions, their residual is known by dw alone.
template <class Entry> void begin(SweptProblem<Entry>& problem, const ContactSettings& settings)
{
  admit(problem);
  if (!problem.changed) return;
  problem.exact_residual = estimated_residual(problem);
  set_target(problem, settings);
}

/// Forms W r, and sets dw to zero, of the problems whose reactions changed; one product with W for all.
template <class Entry> void update_products(std::span<SweptProblem<Entry>* const> problems)
{
  std::vector<ContactWork*> stale;
  for (SweptProblem<Entry>* problem : problems)
  {
    if (!problem->changed) continue;
    stale.push_back(&problem->work);
    problem->changed = false;
    std::fill(problem->dw.begin(), problem->dw.end(), Entry{0});
  }
  form_products(stale);
}

template <class Entry> void sweep_until_converged(std::span<ContactWork* const> works, const ContactSettings& settings)
{
  std::vector<SweptProblem<Entry>> problems;
  problems.reserve(works.size());
  for (ContactWork* work : works) problems.push_back({*work, std::vector<Entry>(work->b.size())});
  std::vector<SweptProblem<Entry>*> active;
  for (SweptProblem<Entry>& problem : problems)
  {
    begin(problem, settings);
    if (problem.changed || continues(problem, settings)) active.push_back(&problem);
  }
  while (!active.empty())
  {
    std::vector<SweptProblem<Entry>*> sweeping = active;
    while (!sweeping.empty()) sweep_once(sweeping, settings);
    update_products<Entry>(active);
    std::erase_if(active, [&](SweptProblem<Entry>* problem) { return !continues(*problem, settings); });
  }
}

} // namespace

void gauss_seidel(std::span<ContactWork* const> works, const ContactSettings& settings)
{
  if (works.empty()) return;
  std::vector<ContactWork*> left(works.begin(), works.end());
  if (works.front()->W.has_near_field())
  {
    sweep_until_converged<float>(left, settings);
    std::erase_if(left, [&](const ContactWork* work)
                  { return work->result.converged || work->result.iterations >= settings.max_iterations; });
  }
  if (works.front()->W.is_whole()) sweep_until_converged<double>(left, settings);
}

} // namespace squeal
