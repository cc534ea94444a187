/// Block Gauss-Seidel.
///
/// Let w = w_0 + dw with w_0 = W r_0 + b from the last product with W, and dw the effect of the changes since. The
/// sweeps update dw alone. It is small, so the near field and single precision suffice. Ranks that share W sweep side
/// by side, turn by turn, each over its own pairs. Where that did not lead to convergence, W itself is swept over. A
/// problem counts as converged only by the residual after a product with W.
#include "contact_work.hpp"

#include "squeal/base/broadcast.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>
#include <limits>
#include <type_traits>

namespace squeal
{

namespace
{

/// A sweep that was made, or the difference of two in succession.
template <class Entry> struct PastSweep
{
  std::vector<double> r, change; // after it, by it
  std::vector<Entry> dw;         // after it
};

/// One problem while it is swept over. `Entry`: float for sweeps over the near field, double for sweeps over W.
template <class Entry> struct SweptProblem
{
  ContactWork& work;
  std::span<const Turn> turns;
  MPI_Comm comm;                                             // ranks that sweep together; MPI_COMM_NULL: this one alone
  std::vector<Entry> dw = std::vector<Entry>(work.b.size()); // valid in the rows of this rank's pairs
  bool changed = false;                                      // dw is not zero
  bool finished = false; // the sweeps have met their target, or no reaction changes any more
  double exact_residual = std::numeric_limits<double>::infinity(); // at the last product with W
  double target = 0;                                               // residual at which the sweeps stop
  PastSweep<Entry> last{};                                         // since the last product with W; empty: none
  std::vector<PastSweep<Entry>> differences{};                     // of sweeps in succession
  int swept = 0;                                                   // since the last product with W
  int failures = 0; // products with W in succession that did not halve the residual after finished sweeps
};

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
  problem.work.W.add_product(pair, change, std::span(problem.dw));
  return problem.changed = true;
}

/// Solves one pair if its law is missed by more than `limit`. The defect before, or 0 if its reaction does not change.
template <class Entry> double visit(SweptProblem<Entry>& problem, std::size_t pair, double limit, const Scales& largest)
{
  const ContactWork& work = problem.work;
  const ContactOperator& W = work.W;
  const PairVector w = velocity_of(problem, pair), last = work.reaction(pair);
  const double defect = defect_of(work, pair, w, largest);
  if (defect <= limit) return 0;
  const PairBlock& A = W.diagonal(pair);
  const PairVector next = solve_pair(A, velocity_without(A, last, w), W.directions(), work.friction.of(pair), last);
  return change_reaction(problem, pair, next) ? defect : 0;
}

/// Gives every rank the reactions of a turn, and dw what those of other ranks add to it. Collective.
template <class Entry> void exchange(SweptProblem<Entry>& problem, const Turn& turn)
{
  if (problem.comm == MPI_COMM_NULL) return;
  const int directions = problem.work.W.directions();
  std::vector<int> counts, starts;
  int total = 0;
  for (const int pairs : turn.counts)
  {
    starts.push_back(total);
    counts.push_back(PairRows<int>(directions).rows_of(pairs));
    total += counts.back();
  }
  std::vector<double> all(static_cast<std::size_t>(total));
  const PairView<double> entries(all, directions);
  for (std::size_t place = turn.begin; place < turn.end; ++place)
    entries.set(place, problem.work.reaction(turn.order[place]));
  MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, all.data(), counts.data(), starts.data(), MPI_DOUBLE,
                 problem.comm);
  for (std::size_t place = 0; place < turn.order.size(); ++place) // own ones are unchanged
    change_reaction(problem, turn.order[place], entries.vector(place));
}

/// The residual by dw, whose rounding it contains, and whether any reaction changed; the most of all ranks.
struct Swept
{
  double residual = 0, moved = 0;
};

/// Collective.
template <class Entry> Swept agree(const SweptProblem<Entry>& problem, bool moved)
{
  const Scales largest = largest_reactions(problem.work);
  Swept swept{0, moved ? 1. : 0.};
  for (const Turn& turn : problem.turns)
    for (const std::size_t pair : turn.own())
      swept.residual = std::max(swept.residual, defect_of(problem.work, pair, velocity_of(problem, pair), largest));
  if (problem.comm != MPI_COMM_NULL) MPI_Allreduce(MPI_IN_PLACE, &swept, 2, MPI_DOUBLE, MPI_MAX, problem.comm);
  return swept;
}

/// The sweeps stop below the tolerance, or where rounding of dw or what the near field leaves out hides the rest. At
/// first dw is as large as the residual.
template <class Entry> void set_target(SweptProblem<Entry>& problem, const ContactSettings& settings)
{
  const double digits = 32 * static_cast<double>(std::numeric_limits<Entry>::epsilon());
  const double hidden = std::is_same_v<Entry, float>
                            ? std::max(digits, (problem.differences.empty() ? ContactOperator::left_out / 4
                                                                            : 2 * ContactOperator::left_out))
                            : digits;
  problem.target = std::max(settings.tolerance / 4, hidden * problem.exact_residual);
}

/// After a product with W that leaves this residual: sets the result and the next target; returns whether more sweeps
/// may help.
template <class Entry> bool continues(SweptProblem<Entry>& problem, double residual, const ContactSettings& settings)
{
  ContactResult& result = problem.work.result;
  const double before = problem.exact_residual;
  result.residual = problem.exact_residual = residual;
  result.converged = result.residual <= settings.tolerance;
  if (result.converged || !std::isfinite(result.residual) || result.iterations >= settings.max_iterations) return false;
  // what is left may be rounding's, or the near field's; or slices act on each other too strongly
  if (problem.finished || problem.turns.size() > 1) problem.failures = residual > before / 2 ? problem.failures + 1 : 0;
  problem.finished = false;
  set_target(problem, settings);
  return problem.failures < 2;
}

template <class T> auto as_vector(const std::vector<T>& x)
{
  return Eigen::VectorX<T>::Map(x.data(), std::ssize(x));
}

/// x += part y
template <class T> void add(double part, const std::vector<T>& y, std::vector<T>& x)
{
  Eigen::VectorX<T>::Map(x.data(), std::ssize(x)) += static_cast<T>(part) * as_vector(y);
}

/// Takes the past sweeps together that leave the least change (Anderson 1965). Light bodies between contacts, as shims,
/// pass forces on slowly by sweeps alone. Pairs that this leaves outside their cone are solved by the next sweep.
template <class Entry> void combine(SweptProblem<Entry>& problem, const std::vector<double>& before)
{
  constexpr std::size_t kept = 10;
  constexpr double astray = 10; // growth of the change by a combination
  std::vector<double>& r = problem.work.r;
  std::vector<PastSweep<Entry>>& differences = problem.differences;
  PastSweep<Entry> now{r, r, problem.dw};
  add(-1, before, now.change);
  const Eigen::VectorXd change = as_vector(now.change);
  PastSweep<Entry> last = std::exchange(problem.last, now);
  if (!last.r.empty() && change.norm() > astray * as_vector(last.change).norm())
    differences.clear();
  else if (!last.r.empty())
  {
    add(-1, last.r, now.r);
    add(-1, last.change, now.change);
    add(-1, last.dw, now.dw);
    differences.push_back(std::move(now));
    if (differences.size() > kept) differences.erase(differences.begin());
  }
  Eigen::MatrixXd changes(std::ssize(r), std::ssize(differences));
  for (Eigen::Index j = 0; j < changes.cols(); ++j)
    changes.col(j) = as_vector(differences[static_cast<std::size_t>(j)].change);
  Eigen::MatrixXd products = changes.transpose() * changes;
  products.diagonal() *= 1 + 1e-12;
  const Eigen::VectorXd part = products.ldlt().solve(-changes.transpose() * change);
  for (std::size_t j = 0; j < differences.size(); ++j)
  {
    add(part[static_cast<Eigen::Index>(j)], differences[j].r, r);
    add(part[static_cast<Eigen::Index>(j)], differences[j].dw, problem.dw);
  }
}

/// Sweeps over all pairs. Returns whether to sweep on before a product with W.
template <class Entry> bool sweep_once(SweptProblem<Entry>& problem, const ContactSettings& settings)
{
  constexpr int plain = 4; // sweeps that most problems take
  const Scales largest = largest_reactions(problem.work);
  const std::vector<double> before = problem.work.r;
  ContactResult& result = problem.work.result;
  bool moved = false;
  for (const Turn& turn : problem.turns)
  {
    for (const std::size_t pair : turn.own())
      if (visit(problem, pair, problem.target / 8, largest) > 0) moved = true;
    exchange(problem, turn);
  }
  const Swept swept = agree(problem, moved);
  result.residual = swept.residual;
  const bool due = ++problem.swept == 50;
  ++result.iterations;
  problem.changed = problem.changed || swept.moved > 0;
  problem.finished = !(result.residual > problem.target) || swept.moved == 0;
  if (problem.finished || due || result.iterations >= settings.max_iterations) return false;
  if (result.iterations > plain) combine(problem, before);
  return true;
}

/// Makes the start admissible: a warm start need not be, nor finite after a failed step. Where that changes reactions,
/// their residual is known by dw alone.
template <class Entry> void begin(SweptProblem<Entry>& problem, const ContactSettings& settings)
{
  const ContactWork& work = problem.work;
  for (const Turn& turn : problem.turns)
  {
    for (const std::size_t pair : turn.own())
      change_reaction(problem, pair,
                      first_reaction(work.W.diagonal(pair), work.reaction(pair), velocity_of(problem, pair),
                                     work.W.directions(), work.friction.of(pair)));
    exchange(problem, turn);
  }
  const Swept swept = agree(problem, problem.changed);
  problem.changed = swept.moved > 0;
  if (!problem.changed) return;
  problem.exact_residual = swept.residual;
  set_target(problem, settings);
}

/// Forms W r, and sets dw to zero, where reactions changed.
template <class Entry> void update_product(SweptProblem<Entry>& problem)
{
  if (!problem.changed) return;
  problem.changed = false;
  problem.last = {};
  problem.swept = 0;
  std::fill(problem.dw.begin(), problem.dw.end(), Entry{0});
  if constexpr (std::is_same_v<Entry, float>)
    form_product(problem.work);
  else
    problem.work.W.multiply_alone(problem.work.r, problem.work.Wr);
}

template <class Entry> void sweep_until_converged(SweptProblem<Entry> problem, const ContactSettings& settings)
{
  // after a product with W, for which dw is zero
  const auto is_unfinished = [&] { return continues(problem, agree(problem, false).residual, settings); };
  begin(problem, settings);
  bool active = problem.changed || is_unfinished();
  while (active)
  {
    while (sweep_once(problem, settings))
    {
    }
    update_product(problem);
    active = is_unfinished();
  }
}

/// Sweeps over W itself, on rank 0.
void sweep_over_whole(ContactWork& work, const ContactSettings& settings)
{
  const MPI_Comm comm = work.W.shared_by();
  work.W.hold_whole();
  const Turn all = all_pairs(work.W.pairs());
  if (comm == MPI_COMM_NULL || rank_of(comm) == 0)
    sweep_until_converged<double>({work, std::span(&all, 1), MPI_COMM_NULL}, settings);
  if (comm == MPI_COMM_NULL) return;
  broadcast(work.r, comm);
  broadcast(work.Wr, comm);
  MPI_Bcast(&work.result, sizeof work.result, MPI_BYTE, 0, comm);
}

} // namespace

void gauss_seidel(ContactWork& work, const ContactSettings& settings)
{
  if (work.W.has_near_field()) sweep_until_converged<float>({work, work.W.turns(), work.W.shared_by()}, settings);
  if (!work.result.converged && work.result.iterations < settings.max_iterations) sweep_over_whole(work, settings);
}

} // namespace squeal
