/// Block Gauss-Seidel.
///
/// Let w = w_0 + dw with w_0 = W r_0 + b from the last product with W, and dw the effect of the changes since. The
/// sweeps update dw alone. It is small, so the near field and single precision suffice, patch by patch where there are
/// several, and by pieces of a large one, whose even and odd pieces take turns. Where that did not lead to convergence,
/// all pairs are one patch, and then W itself is swept over, where it is stored. A problem counts as converged only by
/// the residual after a product with W.
#include "gauss_seidel.hpp"

#include "squeal/base/broadcast.hpp"
#include "swept_pairs.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

namespace squeal
{

namespace
{

// The pins of a brake act on each other by some hundredths of what they do on themselves. Sweeping over one of them for
// longer than to a tenth of its first defects would then be undone by what the others do to it.
constexpr int most_of_a_patch = 8;
constexpr double small_in_a_patch = 0.1;

/// One problem while it is swept over. `Entry`: float for sweeps over the near field, double for sweeps over W.
template <class Entry> struct SweptProblem
{
  ContactWork& work;
  std::vector<Entry> dw;       // valid in the rows of this rank's patches
  bool by_patches = false;     // of several
  std::vector<double> known{}; // reactions whose effect on other patches dw has
  bool changed = false;        // dw is not zero
  bool finished = false;       // the sweeps have met their target, or no reaction changes any more
  double exact_residual = std::numeric_limits<double>::infinity(); // at the last product with W
  double target = 0;                                               // residual at which the sweeps stop
  double relaxation = 1;                                           // part of each local solution's change that is made
  double residual_before = 0;                                      // 50 sweeps ago
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
  const ContactOperator& W = problem.work.W;
  if constexpr (std::is_same_v<Entry, double>)
    W.add_product(pair, change, problem.dw);
  else
    problem.by_patches ? W.add_product_in_patch(pair, change, problem.dw)
                       : W.add_near_product(pair, change, problem.dw);
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
  PairVector next = solve_pair(A, velocity_without(A, last, w), W.directions(), work.friction.of(pair), last);
  if (problem.relaxation < 1) // stays admissible: the cone is convex
    for (std::size_t k = 0; k < next.size(); ++k) next[k] = last[k] + problem.relaxation * (next[k] - last[k]);
  return change_reaction(problem, pair, next) ? defect : 0;
}

/// Gives every rank the reactions of all patches of a turn.
void exchange_reactions(std::vector<double>& r, int directions, const Turn& turn, MPI_Comm comm)
{
  const std::size_t of_a_pair = PairRows<std::size_t>(directions).per_pair();
  std::vector<int> counts, starts;
  int total = 0;
  for (const int pairs : turn.counts)
  {
    starts.push_back(total);
    counts.push_back(pairs * to_int(of_a_pair));
    total += counts.back();
  }
  std::vector<double> all(static_cast<std::size_t>(total));
  const PairView<double> reactions(r, directions), entries(all, directions);
  for (const Turn::Part& part : turn.own)
    for (std::size_t place = part.first; place < part.first + part.count; ++place)
      entries.set(place, reactions.vector(turn.order[place]));
  MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, all.data(), counts.data(), starts.data(), MPI_DOUBLE, comm);
  for (std::size_t place = 0; place < turn.order.size(); ++place)
    reactions.set(turn.order[place], entries.vector(place));
}

/// What the reactions of a turn that changed since the last time add to dw from patch to patch.
void act_on_other_patches(SweptProblem<float>& problem, const SweptPairs& where, const Turn& turn)
{
  if (!where.several) return;
  const ContactWork& work = problem.work;
  if (where.shared()) exchange_reactions(work.r, work.W.directions(), turn, where.comm);
  const PairView<double> known(problem.known, work.W.directions());
  for (const std::size_t pair : turn.order)
  {
    const PairVector now = work.reaction(pair), before = known.vector(pair);
    if (now == before) continue;
    work.W.add_product_beyond_patch(pair, {now[0] - before[0], now[1] - before[1], now[2] - before[2]}, problem.dw);
    known.set(pair, now);
  }
}

/// The near field alone has patches.
void act_on_other_patches(SweptProblem<double>&, const SweptPairs&, const Turn&) {}

/// The residual by dw, whose rounding it contains, in the pairs of this rank.
template <class Entry> double estimated_residual(const SweptProblem<Entry>& problem, const SweptPairs& where)
{
  const Scales largest = largest_reactions(problem.work);
  double residual = 0;
  where.for_each_own(
      [&](std::size_t pair)
      { residual = std::max(residual, defect_of(problem.work, pair, velocity_of(problem, pair), largest)); });
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

/// After a product with W that leaves this residual: sets the result and the next target; returns whether more sweeps
/// may help.
template <class Entry> bool continues(SweptProblem<Entry>& problem, double residual, const ContactSettings& settings)
{
  ContactResult& result = problem.work.result;
  const double before = problem.exact_residual;
  result.residual = problem.exact_residual = residual;
  result.converged = result.residual <= settings.tolerance;
  if (result.converged || !std::isfinite(result.residual) || result.iterations >= settings.max_iterations) return false;
  // what is left may be rounding's, or the near field's; or several patches act on each other too strongly
  if (problem.finished || problem.by_patches) problem.failures = residual > before / 2 ? problem.failures + 1 : 0;
  problem.finished = false;
  set_target(problem, settings);
  return problem.failures < 2;
}

template <class Entry> void shorten_changes(SweptProblem<Entry>& problem)
{
  // with strong friction sweeps may repeat a cycle of reactions, which shorter changes often end
  const double residual = problem.work.result.residual;
  if (problem.residual_before > 0 && residual > 0.5 * problem.residual_before)
    problem.relaxation = std::max(0.25, problem.relaxation / 2);
  problem.residual_before = residual;
}

/// The largest residual and number of sweeps of all patches.
struct Swept
{
  double residual = 0; // estimated
  double sweeps = 0;   // that changed reactions
};

/// Sweeps over one patch, at most so often, until the defects are small beside the first ones.
template <class Entry> void sweep_patch(SweptProblem<Entry>& problem, std::span<const std::size_t> patch, int at_most,
                                        const Scales& largest, Swept& swept)
{
  double at_first = 0, defect = 0;
  for (int sweep = 0; sweep < at_most && (sweep == 0 || defect > small_in_a_patch * at_first); ++sweep)
  {
    defect = 0;
    for (const std::size_t pair : patch) defect = std::max(defect, visit(problem, pair, problem.target / 8, largest));
    if (sweep == 0) at_first = defect;
    if (defect > 0) swept.sweeps = std::max(swept.sweeps, sweep + 1.);
  }
}

/// The most of all ranks.
void agree(Swept& swept, const SweptPairs& where)
{
  if (where.shared()) MPI_Allreduce(MPI_IN_PLACE, &swept, 2, MPI_DOUBLE, MPI_MAX, where.comm);
}

/// Sweeps over all patches. Returns whether to sweep on before a product with W.
template <class Entry>
bool sweep_once(SweptProblem<Entry>& problem, const SweptPairs& where, const ContactSettings& settings)
{
  const Scales largest = largest_reactions(problem.work);
  ContactResult& result = problem.work.result;
  const int before = result.iterations, left = static_cast<int>(settings.max_iterations) - before;
  const int at_most = where.several && !where.by_pieces() ? std::min(most_of_a_patch, left) : 1;
  Swept swept;
  for (const Turn& turn : where.turns)
  {
    for (const Turn::Part& part : turn.own) sweep_patch(problem, turn.pairs(part), at_most, largest, swept);
    act_on_other_patches(problem, where, turn);
  }
  swept.residual = estimated_residual(problem, where);
  agree(swept, where);
  result.iterations += std::max(1, static_cast<int>(swept.sweeps));
  result.residual = swept.residual;
  const bool moved = swept.sweeps > 0, due = result.iterations / 50 > before / 50;
  problem.changed = problem.changed || moved;
  if (due && (!problem.by_patches || where.by_pieces())) shorten_changes(problem);
  problem.finished = !(result.residual > problem.target) || !moved;
  return !problem.finished && !due && result.iterations < settings.max_iterations;
}

/// Makes the start admissible: a warm start need not be, nor finite after a failed step. Where that changes reactions,
/// their residual is known by dw alone.
template <class Entry>
void begin(SweptProblem<Entry>& problem, const SweptPairs& where, const ContactSettings& settings)
{
  ContactWork& work = problem.work;
  problem.known = work.r;
  where.for_each_own(
      [&](std::size_t pair)
      {
        change_reaction(problem, pair,
                        admissible(work.reaction(pair), velocity_of(problem, pair), work.friction.of(pair)));
      });
  for (const Turn& turn : where.turns) act_on_other_patches(problem, where, turn);
  Swept swept{problem.changed ? estimated_residual(problem, where) : 0, problem.changed ? 1. : 0.};
  agree(swept, where);
  problem.changed = swept.sweeps > 0;
  if (!problem.changed) return;
  problem.exact_residual = swept.residual;
  set_target(problem, settings);
}

/// Forms W r, and sets dw to zero, where reactions changed.
template <class Entry> void update_product(SweptProblem<Entry>& problem, const SweptPairs& where)
{
  if (!problem.changed) return;
  ContactWork& work = problem.work;
  problem.changed = false;
  std::fill(problem.dw.begin(), problem.dw.end(), Entry{0});
  if (!where.shared() || rank_of(where.comm) == 0)
    form_product(work);
  else
    work.W.follow_product();
  if (where.shared()) MPI_Bcast(work.Wr.data(), to_int(work.Wr.size()), MPI_DOUBLE, 0, where.comm);
}

/// Whether to sweep on after a product with W, for which dw is zero.
template <class Entry>
bool is_unfinished(SweptProblem<Entry>& problem, const SweptPairs& where, const ContactSettings& settings)
{
  Swept left{estimated_residual(problem, where), 0};
  agree(left, where);
  return continues(problem, left.residual, settings);
}

template <class Entry>
void sweep_until_converged(ContactWork& work, const SweptPairs& where, const ContactSettings& settings)
{
  SweptProblem<Entry> problem{work, std::vector<Entry>(work.b.size()), where.several};
  begin(problem, where, settings);
  bool active = problem.changed || is_unfinished(problem, where, settings);
  while (active)
  {
    while (sweep_once(problem, where, settings))
    {
    }
    update_product(problem, where);
    active = is_unfinished(problem, where, settings);
  }
}

/// Exchanges a problem in one message: the speed, b, r and W r.
void exchange(ContactWork& work, std::vector<double>& b, MPI_Comm comm)
{
  std::vector<double> message;
  if (rank_of(comm) == 0)
  {
    message.push_back(work.speed);
    for (const std::span<const double> entries : {std::span<const double>(work.b), {work.r}, {work.Wr}})
      message.insert(message.end(), entries.begin(), entries.end());
  }
  broadcast(message, comm);
  if (rank_of(comm) == 0) return;
  auto entry = message.begin();
  const auto size = static_cast<std::ptrdiff_t>(work.W.size());
  work.speed = *entry++;
  for (std::vector<double>* entries : {&b, &work.r, &work.Wr})
  {
    entries->assign(entry, entry + size);
    entry += size;
  }
}

/// With the other ranks, which would wait for this one for ever if it left by an exception: that ends the program.
void sweep_together(ContactWork& work, ContactSettings settings) noexcept
{
  const MPI_Comm comm = work.W.shared_by();
  int task = task_of_sweeps;
  MPI_Bcast(&task, 1, MPI_INT, 0, comm);
  static_assert(std::is_trivially_copyable_v<ContactSettings>);
  MPI_Bcast(&settings, sizeof settings, MPI_BYTE, 0, comm);
  (void)announced_friction(work.friction, comm);
  std::vector<double> unread;
  exchange(work, unread, comm);
  sweep_until_converged<float>(work, patches_of(work.W), settings);
}

/// Reactions that sweeps began with, and W times them.
struct SweepStart
{
  std::vector<double> r, Wr;
};

/// Where patches swept by themselves led away from the law, the next sweeps begin where these did.
void begin_as_one(ContactWork& work, const SweepStart& start)
{
  work.result.as_one = true;
  const double reached = residual_of(work);
  SweepStart end{std::exchange(work.r, start.r), std::exchange(work.Wr, start.Wr)};
  if (!(reached < residual_of(work))) return;
  work.r = std::move(end.r);
  work.Wr = std::move(end.Wr);
}

} // namespace

void sweep_along(const ContactOperator& W)
{
  ContactSettings settings;
  MPI_Bcast(&settings, sizeof settings, MPI_BYTE, 0, W.shared_by());
  const PairFriction friction = announced_friction({}, W.shared_by());
  std::vector<double> b, r;
  ContactWork work{W, friction, b, r, {}};
  exchange(work, b, W.shared_by());
  sweep_until_converged<float>(work, patches_of(W), settings);
}

void gauss_seidel(ContactWork& work, const ContactSettings& settings)
{
  const ContactOperator& W = work.W;
  const auto is_open = [&] { return !work.result.converged && work.result.iterations < settings.max_iterations; };
  if (W.patches().size() > 1)
  {
    const SweepStart start{work.r, work.Wr};
    W.shares_patches() ? sweep_together(work, settings) : sweep_until_converged<float>(work, patches_of(W), settings);
    if (is_open()) begin_as_one(work, start);
  }
  if (W.has_near_field() && is_open()) sweep_until_converged<float>(work, one_patch(W), settings);
  if (!is_open() || !W.is_stored()) return;
  W.ask_for_whole();
  sweep_until_converged<double>(work, one_patch(W), settings);
}

} // namespace squeal
