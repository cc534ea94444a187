#include "squeal/modes/pair_search.hpp"

#include "squeal/base/constants.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/modes/passes.hpp"
#include "squeal/modes/real_modes.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace squeal
{

namespace
{

constexpr double reach_of_count = 1.05;                 // over the band
constexpr int most_passes = 16;                         // of residual correction
constexpr double pair_tolerance = 1e-12, sharp = 1e-14; // backward errors of pairs, and of nearly critical ones
constexpr double loss_tolerance = 1e-13;                // the same with losses
constexpr double spurious_pair = 1e-8;                  // backward error of what is no pair
constexpr double guards_of_pairs = 0.3; // neighbours in a space, over its modes: most of what ends are corrected by
constexpr double residual_share = 1e-2; // a pass divides residuals by about ten: a quarter of them stay
constexpr double near_end = 0.98;       // of |lambda|: from there on pairs may leave

PairSearch empty_search(double top)
{
  return {{{OutcomeKind::converged, "", 0, 0}}, top};
}

/// The pairs of a window by passes; without P, those on the span of the basis.
QuadraticSolution correct(const PairProblem& problem, Mat K_loss, MultiVector basis, const PencilFactor* P,
                          const Window& window)
{
  QuadraticSolution found = solve_on_subspace(problem.sliding, K_loss, std::move(basis), P,
                                              {.window = window,
                                               .passes = P ? most_passes : 0,
                                               .pairs = std::numeric_limits<std::size_t>::max(),
                                               .tolerance = K_loss ? loss_tolerance : pair_tolerance,
                                               .sharp = K_loss ? loss_tolerance : sharp,
                                               .share = residual_share});
  if (P) std::erase_if(found.pairs, [](const Eigenpair& pair) { return pair.backward_error > spurious_pair; });
  return found;
}

/// Adds the pairs of a window, from a basis near their vectors.
void add_pairs(const PairProblem& problem, MultiVector basis, const PencilFactor* P, const Window& window,
               PairSearch& search)
{
  QuadraticSolution found = correct(problem, nullptr, std::move(basis), P, window);
  for (const Eigenpair& pair : found.pairs) search.moduli.push_back(std::abs(pair.lambda));
  if (problem.K_loss)
  {
    basis = span_of(found.pairs, problem.K_z);
    const auto number = [&](const QuadraticSolution& solution)
    {
      return std::ranges::count_if(solution.pairs, [&](const Eigenpair& pair)
                                   { return std::norm(pair.lambda) < near_end * near_end * window.limit; });
    };
    const auto expected = number(correct(problem, problem.K_loss, basis, nullptr, window));
    found = correct(problem, problem.K_loss, std::move(basis), P, window);
    if (number(found) < expected)
    {
      found.outcome.kind = OutcomeKind::not_converged;
      found.outcome.reason = format("with loss factors %td modes were found of %td", number(found), expected);
    }
  }
  Outcome& outcome = search.solution.outcome;
  outcome.iterations += found.outcome.iterations;
  if (found.outcome.kind == OutcomeKind::not_converged) outcome = found.outcome;
  std::ranges::move(found.pairs, std::back_inserter(search.solution.pairs));
}

/// All pairs of a small problem.
void search_whole(const PairProblem& problem, double floor, PairSearch& search)
{
  const Window window{floor * floor, search.top * search.top};
  search.solution = solve_whole(problem.sliding, nullptr, window);
  for (const Eigenpair& pair : search.solution.pairs) search.moduli.push_back(std::abs(pair.lambda));
  if (problem.K_loss) search.solution = solve_whole(problem.sliding, problem.K_loss, window);
}

/// All pairs slice by slice of |lambda|, of equal width, each from the undamped problem with friction about its middle:
/// unsymmetric, so that its spaces and its factor know friction. A space holds all theta that friction turns by the
/// usual angle.
void search_slices(const PairProblem& problem, double floor, const PencilOptions& options, PairSearch& search)
{
  constexpr int in_slice = 75;                // pairs
  constexpr double usual_angle = 0.06;        // [rad] by which friction turns theta
  constexpr double subspace_tolerance = 1e-9; // for a space to be invariant
  constexpr double rigid_share = 1e-6;        // theta below this part of the largest may be a free body's
  const double limit = search.top * search.top;
  const EliminationOrder order = elimination_order(problem.K_z);
  search.expected = inertia_at(limit, problem.M_z, problem.K_z, options, order).below;
  const int slices = std::max(1, (search.expected + in_slice - 1) / in_slice);
  Progress progress(comm_of(problem.K_z), "modes", search.top);
  ShiftInvert pencil = make_shift_invert(problem.sliding.K, problem.sliding.M, Keep::lu, options, &order);
  double smallest = HUGE_VAL;
  for (int k = 0; k < slices; ++k)
  {
    const double least = std::max(floor * floor, limit * std::pow(1. * k / slices, 2)),
                 end = limit * std::pow((k + 1.) / slices, 2);
    move_to(pencil, (least + end) / 2);
    const double radius = std::abs(std::polar(end, usual_angle) - pencil.shift);
    Nearest nearest = solve_nearest(pencil, search.expected / slices, radius, subspace_tolerance, guards_of_pairs);
    if (!nearest.converged) continue; // the count shows that pairs are missing
    for (const double theta : nearest.theta) smallest = std::min(smallest, std::abs(theta));
    add_pairs(problem, std::move(nearest.space), pencil.factor.get(), {least, end}, search);
    progress.update(std::sqrt(end), format("below %.4g Hz", std::sqrt(end) / two_pi));
  }
  pencil = {}; // before a count that needs a factor as well
  if (smallest < rigid_share * limit)
    search.expected -= inertia_at(floor * floor, problem.M_z, problem.K_z, options, order).below;
}

/// All pairs by SLEPc, corrected for losses.
void search_by_toar(const PairProblem& problem, double floor, const ModesOptions& options, PairSearch& search)
{
  const double shift = std::sqrt(-shift_below_zero(problem.M_z, problem.K_z));
  QuadraticSolution found = solve_quadratic(
      problem.sliding, {search.top / two_pi, shift / search.top, static_cast<int>(search.omega.size())});
  if (!problem.K_loss)
  {
    for (const Eigenpair& pair : found.pairs) search.moduli.push_back(std::abs(pair.lambda));
    search.solution = std::move(found);
    return;
  }
  ShiftInvert pencil = make_shift_invert(problem.K_z, problem.M_z, Keep::factor, options.pencil);
  move_to(pencil, search.top * search.top / 2);
  add_pairs(problem, span_of(found.pairs, problem.K_z), pencil.factor.get(), {floor * floor, search.top * search.top},
            search);
}

} // namespace

PairSearch search_pairs(const PairProblem& problem, ModesMethod method, double band, const ModesOptions& options)
{
  PetscInt n = 0;
  check(MatGetSize(problem.K_z, &n, nullptr));
  const double floor = std::sqrt(vibration_floor(norms_of(problem.sliding)));
  const bool by_slices = n > options.dense_limit && method != ModesMethod::toar;
  PairSearch search = empty_search(two_pi * band * (by_slices ? reach_of_count : 1));
  const auto find_real = [&]
  { search.omega = solve_real_modes_below(problem.M_z, problem.K_z, search.top / two_pi, options).omega; };
  if (by_slices)
  {
    search_slices(problem, floor, options.pencil, search);
    if (search.expected != std::ssize(search.moduli)) find_real(); // for a lower edge
  }
  else
  {
    find_real();
    n > options.dense_limit ? search_by_toar(problem, floor, options, search) : search_whole(problem, floor, search);
  }
  sort_and_measure(search.solution);
  return search;
}

ModeCount count_pairs(const PairSearch& search, double floor, double least)
{
  const auto& [solution, top, unsorted, omega, counted] = search;
  std::vector<double> moduli = unsorted;
  std::ranges::sort(moduli, std::greater{});
  const auto number = [](const std::vector<double>& values, double from, double end) {
    return static_cast<int>(std::ranges::count_if(values, [&](double value) { return value >= from && value < end; }));
  };
  const auto below = [&](double edge)
  {
    const int expected = number(omega, floor, edge), found = number(moduli, 0, edge);
    return ModeCount{expected == found ? Certificate::inertia : Certificate::none, edge / two_pi, expected, found};
  };
  if (omega.empty() && counted == std::ssize(moduli)) return {Certificate::inertia, top / two_pi, counted, counted};
  const ModeCount whole = below(top);
  if (whole.expected == whole.found) return whole;
  for (std::size_t k = 1; k < moduli.size() && moduli[k - 1] > least; ++k)
  {
    const double edge = std::max(least, (moduli[k - 1] + moduli[k]) / 2);
    if (edge >= top) continue;
    if (const ModeCount count = below(edge); count.certified_by != Certificate::none) return count;
  }
  return whole;
}

} // namespace squeal
