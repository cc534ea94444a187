/// Block Gauss-Seidel for problems that share W. Sweeps are the outer loop, pairs the next, problems the inner one. So
/// a pair's rows are read once for all the problems in which it moves.
///
/// Let w = w_0 + dw with w_0 = W r_0 + b from the last product with W, and dw the effect of the changes since. The
/// sweeps update dw alone. It is small, so the near field and single precision suffice; where they did not lead to
/// convergence, W itself is swept over, where it is whole. A problem counts as converged only by the residual after a
/// product with W.
#include "gauss_seidel.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/integers.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <type_traits>

namespace squeal
{

namespace
{

constexpr int most_of_a_patch = 8; // sweeps before its reactions act on the others

/// The pairs of a sweep, patch after patch. Patches are swept each by itself, for the same answer on any number of
/// ranks: reactions act on the other patches when all have been swept.
struct Ground
{
  struct Part
  {
    std::size_t first, count; // of `order`
  };
  std::vector<std::size_t> order{}; // all pairs, rank by rank
  std::vector<Part> own{};          // patches of this rank
  bool several = false;             // patches, on all ranks
  MPI_Comm comm = MPI_COMM_NULL;    // ranks that sweep side by side
  std::vector<int> counts{};        // pairs of each of them

  std::span<const std::size_t> pairs(const Part& part) const
  {
    return std::span(order).subspan(part.first, part.count);
  }
  bool shared() const { return comm != MPI_COMM_NULL; }
  bool decides() const { return !shared() || rank_of(comm) == 0; }
};

Ground one_patch(const ContactOperator& W)
{
  Ground ground;
  ground.order.resize(W.pairs());
  std::iota(ground.order.begin(), ground.order.end(), 0);
  ground.own = {{0, W.pairs()}};
  return ground;
}

Ground patches_of(const ContactOperator& W)
{
  if (W.patches().size() < 2) return one_patch(W);
  Ground ground;
  ground.several = true;
  if (W.shares_patches()) ground.comm = W.shared_by();
  const int ranks = ground.shared() ? ranks_of(ground.comm) : 1, me = ground.shared() ? rank_of(ground.comm) : 0;
  for (int rank = 0; rank < ranks; ++rank)
  {
    const std::size_t before = ground.order.size();
    for (std::size_t patch = 0; patch < W.patches().size(); ++patch)
    {
      if (W.owner(patch) != rank) continue;
      const std::vector<std::size_t>& pairs = W.patches()[patch];
      if (rank == me) ground.own.push_back({ground.order.size(), pairs.size()});
      ground.order.insert(ground.order.end(), pairs.begin(), pairs.end());
    }
    ground.counts.push_back(to_int(ground.order.size() - before));
  }
  return ground;
}

/// One problem while it is swept over. `Entry`: float for sweeps over the near field, double for sweeps over W.
template <class Entry> struct SweptProblem
{
  ContactWork& work;
  std::vector<Entry> dw;       // in the rows of this rank's patches
  std::vector<double> known{}; // reactions whose effect on other patches dw has
  bool changed = false;        // dw is not zero
  bool finished = false;       // the sweeps have met their target, or no reaction changes any more
  double exact_residual = std::numeric_limits<double>::infinity(); // at the last product with W
  double target = 0;                                               // residual at which the sweeps stop
  double relaxation = 1;                                           // part of each local solution's change that is made
  double residual_before = 0;                                      // 50 sweeps ago
  int failures = 0; // products with W in succession that did not halve the residual after finished sweeps
};

template <class Entry> using Problems = std::vector<SweptProblem<Entry>*>;

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

/// By how much the law of a pair is missed, over the scale of its forces; `largest`: reaction of all.
template <class Entry>
double defect_of(const SweptProblem<Entry>& problem, std::size_t pair, const PairVector& w, double largest)
{
  const ContactWork& work = problem.work;
  const double defect = natural_map(work.reaction(pair), w, work.friction, work.W.scale(pair));
  if (!std::isfinite(defect + w[0] + w[1] + w[2])) return std::numeric_limits<double>::infinity();
  return defect > 0 ? defect / work.scale_of(pair, largest) : 0;
}

/// Solves one pair if its law is missed by more than `limit`. The defect before, or 0 if its reaction does not change.
template <class Entry> double visit(SweptProblem<Entry>& problem, std::size_t pair, double limit, double largest)
{
  const ContactWork& work = problem.work;
  const ContactOperator& W = work.W;
  if (!work.takes_part(pair)) return 0;
  const PairVector w = velocity_of(problem, pair), last = work.reaction(pair);
  const double defect = defect_of(problem, pair, w, largest);
  if (defect <= limit) return 0;
  const PairBlock& A = W.diagonal(pair);
  PairVector next = solve_pair(A, velocity_without(A, last, w), W.directions(), work.friction, last);
  if (problem.relaxation < 1) // stays admissible: the cone is convex
    for (std::size_t k = 0; k < next.size(); ++k) next[k] = last[k] + problem.relaxation * (next[k] - last[k]);
  return change_reaction(problem, pair, next) ? defect : 0;
}

/// Gives every rank the reactions of all patches.
template <class Entry> void exchange_reactions(const Problems<Entry>& problems, const Ground& ground)
{
  const int directions = problems.front()->work.W.directions();
  const std::size_t of_a_pair = problems.size() * PairRows<std::size_t>(directions).per_pair();
  std::vector<int> counts, starts;
  int total = 0;
  for (const int pairs : ground.counts)
  {
    starts.push_back(total);
    counts.push_back(pairs * to_int(of_a_pair));
    total += counts.back();
  }
  std::vector<double> all(static_cast<std::size_t>(total));
  const auto for_each_entry = [&](const Ground::Part& part, auto take)
  {
    double* entry = all.data() + part.first * of_a_pair;
    for (const std::size_t pair : ground.pairs(part))
      for (SweptProblem<Entry>* problem : problems)
        for (double& reaction : PairView<double>(problem->work.r, directions).of(pair)) take(reaction, *entry++);
  };
  for (const Ground::Part& part : ground.own)
    for_each_entry(part, [](double reaction, double& entry) { entry = reaction; });
  MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, all.data(), counts.data(), starts.data(), MPI_DOUBLE, ground.comm);
  for_each_entry({0, ground.order.size()}, [](double& reaction, double entry) { reaction = entry; });
}

/// What the reactions that changed since the last time add to dw from patch to patch.
void act_on_other_patches(const Problems<float>& problems, const Ground& ground)
{
  if (!ground.several) return;
  if (ground.shared()) exchange_reactions(problems, ground);
  for (SweptProblem<float>* problem : problems)
  {
    const ContactWork& work = problem->work;
    const PairView<double> known(problem->known, work.W.directions());
    for (std::size_t pair = 0; pair < work.W.pairs(); ++pair)
    {
      const PairVector now = work.reaction(pair), before = known.vector(pair);
      if (now == before) continue;
      work.W.add_product_outside(pair, {now[0] - before[0], now[1] - before[1], now[2] - before[2]}, problem->dw);
      known.set(pair, now);
    }
  }
}

/// The near field alone has patches.
void act_on_other_patches(const Problems<double>&, const Ground&) {}

/// The residual by dw, whose rounding it contains, in the pairs of this rank.
template <class Entry> double estimated_residual(const SweptProblem<Entry>& problem, const Ground& ground)
{
  const double largest = largest_reaction(problem.work.r);
  double residual = 0;
  for (const Ground::Part& part : ground.own)
    for (const std::size_t pair : ground.pairs(part))
      if (problem.work.takes_part(pair))
        residual = std::max(residual, defect_of(problem, pair, velocity_of(problem, pair), largest));
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
template <class Entry>
bool continues(SweptProblem<Entry>& problem, const Ground& ground, const ContactSettings& settings)
{
  ContactResult& result = problem.work.result;
  const double before = problem.exact_residual;
  if (ground.decides()) result.residual = residual_of(problem.work);
  if (ground.shared()) MPI_Bcast(&result.residual, 1, MPI_DOUBLE, 0, ground.comm);
  problem.exact_residual = result.residual;
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

/// What sweeps did to a problem, the most of all patches.
struct Swept
{
  double residual = 0; // estimated
  double sweeps = 0;   // that changed reactions
};

/// Sweeps over one patch, until the changes are small beside the first ones.
template <class Entry> void sweep_patch(const Problems<Entry>& problems, std::span<const std::size_t> patch,
                                        int at_most, const std::vector<double>& largest, std::vector<Swept>& swept)
{
  constexpr double small = 0.1;
  std::vector<double> at_first(problems.size(), 0);
  bool continues = true;
  for (int sweep = 0; continues && sweep < at_most; ++sweep)
  {
    std::vector<double> defects(problems.size(), 0);
    for (const std::size_t pair : patch)
      for (std::size_t k = 0; k < problems.size(); ++k)
        defects[k] = std::max(defects[k], visit(*problems[k], pair, problems[k]->target / 8, largest[k]));
    if (sweep == 0) at_first = defects;
    continues = false;
    for (std::size_t k = 0; k < problems.size(); ++k)
    {
      if (defects[k] > 0) swept[k].sweeps = std::max(swept[k].sweeps, sweep + 1.);
      if (defects[k] > small * at_first[k]) continues = true;
    }
  }
}

/// The most of all ranks.
void agree(std::vector<Swept>& swept, const Ground& ground)
{
  if (ground.shared())
    MPI_Allreduce(MPI_IN_PLACE, swept.data(), to_int(2 * swept.size()), MPI_DOUBLE, MPI_MAX, ground.comm);
}

/// Sweeps over all patches; problems that are finished, or due for a product with W, leave the list.
template <class Entry> void sweep_once(Problems<Entry>& sweeping, const Ground& ground, const ContactSettings& settings)
{
  std::vector<double> largest;
  for (const SweptProblem<Entry>* problem : sweeping) largest.push_back(largest_reaction(problem->work.r));
  std::vector<Swept> swept(sweeping.size());
  for (const Ground::Part& part : ground.own)
    sweep_patch(sweeping, ground.pairs(part), ground.several ? most_of_a_patch : 1, largest, swept);
  act_on_other_patches(sweeping, ground);
  for (std::size_t k = 0; k < sweeping.size(); ++k) swept[k].residual = estimated_residual(*sweeping[k], ground);
  agree(swept, ground);
  Problems<Entry> remaining;
  for (std::size_t k = 0; k < sweeping.size(); ++k)
  {
    SweptProblem<Entry>& problem = *sweeping[k];
    ContactResult& result = problem.work.result;
    const int before = result.iterations;
    result.iterations += std::max(1, static_cast<int>(swept[k].sweeps));
    result.residual = swept[k].residual;
    const bool moved = swept[k].sweeps > 0, due = result.iterations / 50 > before / 50;
    problem.changed = problem.changed || moved;
    if (due) shorten_changes(problem);
    problem.finished = !(result.residual > problem.target) || !moved;
    if (!problem.finished && !due && result.iterations < settings.max_iterations) remaining.push_back(&problem);
  }
  sweeping = std::move(remaining);
}

/// Makes the starts admissible: a warm start need not be, nor finite after a failed step. Where that changes reactions,
/// their residual is known by dw alone.
template <class Entry>
void begin(const Problems<Entry>& problems, const Ground& ground, const ContactSettings& settings)
{
  for (SweptProblem<Entry>* problem : problems)
  {
    ContactWork& work = problem->work;
    problem->known = work.r;
    for (const Ground::Part& part : ground.own)
      for (const std::size_t pair : ground.pairs(part))
        change_reaction(*problem, pair,
                        work.takes_part(pair)
                            ? admissible(work.reaction(pair), velocity_of(*problem, pair), work.friction)
                            : PairVector{});
  }
  act_on_other_patches(problems, ground);
  std::vector<Swept> swept;
  for (const SweptProblem<Entry>* problem : problems)
    swept.push_back({problem->changed ? estimated_residual(*problem, ground) : 0, problem->changed ? 1. : 0.});
  agree(swept, ground);
  for (std::size_t k = 0; k < problems.size(); ++k)
  {
    problems[k]->changed = swept[k].sweeps > 0;
    if (!problems[k]->changed) continue;
    problems[k]->exact_residual = swept[k].residual;
    set_target(*problems[k], settings);
  }
}

/// Forms W r, and sets dw to zero, of the problems whose reactions changed; one product with W for all.
template <class Entry> void update_products(const Problems<Entry>& problems, const Ground& ground)
{
  std::vector<ContactWork*> stale;
  for (SweptProblem<Entry>* problem : problems)
  {
    if (!problem->changed) continue;
    stale.push_back(&problem->work);
    problem->changed = false;
    std::fill(problem->dw.begin(), problem->dw.end(), Entry{0});
  }
  if (ground.decides())
    form_products(stale);
  else if (!stale.empty())
    stale.front()->W.follow_product(stale.size());
  if (ground.shared())
    for (ContactWork* work : stale) MPI_Bcast(work->Wr.data(), to_int(work->Wr.size()), MPI_DOUBLE, 0, ground.comm);
}

template <class Entry>
void sweep_until_converged(std::span<ContactWork* const> works, const Ground& ground, const ContactSettings& settings)
{
  std::vector<SweptProblem<Entry>> problems;
  problems.reserve(works.size());
  for (ContactWork* work : works) problems.push_back({*work, std::vector<Entry>(work->b.size())});
  Problems<Entry> all, active;
  for (SweptProblem<Entry>& problem : problems) all.push_back(&problem);
  begin(all, ground, settings);
  for (SweptProblem<Entry>* problem : all)
    if (problem->changed || continues(*problem, ground, settings)) active.push_back(problem);
  while (!active.empty())
  {
    Problems<Entry> sweeping = active;
    while (!sweeping.empty()) sweep_once(sweeping, ground, settings);
    update_products<Entry>(active, ground);
    std::erase_if(active, [&](SweptProblem<Entry>* problem) { return !continues(*problem, ground, settings); });
  }
}

/// What rank 0 tells the others of the problems.
struct Announced
{
  std::size_t problems = 0;
  ContactSettings settings{};
  FrictionLaw friction{};
};
static_assert(std::is_trivially_copyable_v<Announced>);

/// Of one problem.
void share(std::vector<double>& b, std::vector<double>& r, std::vector<double>& Wr, double& speed, MPI_Comm comm)
{
  for (std::vector<double>* entries : {&b, &r, &Wr}) broadcast(*entries, comm);
  MPI_Bcast(&speed, 1, MPI_DOUBLE, 0, comm);
}

void announce(std::span<ContactWork* const> works, const ContactSettings& settings)
{
  const ContactWork& first = *works.front();
  const MPI_Comm comm = first.W.shared_by();
  int task = sweeps;
  MPI_Bcast(&task, 1, MPI_INT, 0, comm);
  Announced announced{works.size(), settings, first.friction};
  MPI_Bcast(&announced, sizeof announced, MPI_BYTE, 0, comm);
  for (ContactWork* work : works)
  {
    std::vector<double> b = work->b;
    share(b, work->r, work->Wr, work->speed, comm);
  }
}

} // namespace

void sweep_along(const ContactOperator& W)
{
  Announced announced;
  MPI_Bcast(&announced, sizeof announced, MPI_BYTE, 0, W.shared_by());
  std::vector<std::vector<double>> b(announced.problems), r(announced.problems);
  std::vector<ContactWork> works;
  works.reserve(announced.problems);
  std::vector<ContactWork*> all;
  for (std::size_t k = 0; k < announced.problems; ++k)
  {
    ContactWork& work = works.emplace_back(ContactWork{W, announced.friction, b[k], r[k], {}});
    share(b[k], work.r, work.Wr, work.speed, W.shared_by());
    all.push_back(&work);
  }
  sweep_until_converged<float>(all, patches_of(W), announced.settings);
}

void gauss_seidel(std::span<ContactWork* const> works, const ContactSettings& settings)
{
  if (works.empty()) return;
  const ContactOperator& W = works.front()->W;
  std::vector<ContactWork*> left(works.begin(), works.end());
  if (W.has_near_field())
  {
    if (W.shares_patches()) announce(left, settings);
    sweep_until_converged<float>(left, patches_of(W), settings);
    std::erase_if(left, [&](const ContactWork* work)
                  { return work->result.converged || work->result.iterations >= settings.max_iterations; });
  }
  if (W.is_whole()) sweep_until_converged<double>(left, one_patch(W), settings);
}

} // namespace squeal
