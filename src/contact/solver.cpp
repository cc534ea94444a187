#include "squeal/contact/solver.hpp"

#include "squeal/base/error.hpp"
#include "squeal/contact/local.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace squeal
{

namespace
{

/// The problem of one call: block = 1 + directions, n = pairs * block.
struct Problem
{
  const std::vector<double>& W;
  const std::vector<double>& b;
  int pairs, directions;
  double friction;
  std::size_t block, n;
  std::vector<double> rho_n, rho_t; // per pair, of the natural map
  double speed = 0;                 // the largest free velocity

  /// What a pair's error is compared with, where `largest` is the largest reaction: also the force that would give the
  /// pair the largest free velocity, so that a light pair beside heavy ones is not passed over.
  double force_scale(std::size_t pair, double largest) const
  {
    const double own = speed * std::min(rho_n[pair], rho_t[pair]);
    return own == 0 ? largest : largest == 0 ? own : std::min(own, largest);
  }

  const double* row(std::size_t i) const { return W.data() + i * n; }
  double diagonal(std::size_t i) const { return W[i * n + i]; }
};

Problem make_problem(const std::vector<double>& W, const std::vector<double>& b, int pairs, int directions,
                     double friction)
{
  const auto block = static_cast<std::size_t>(1 + directions);
  const std::size_t n = static_cast<std::size_t>(pairs) * block;
  if (W.size() != n * n || b.size() != n)
    throw Error("contact: " + std::to_string(pairs) + " pairs of " + std::to_string(block) + " rows need " +
                std::to_string(n * n) + " entries of W, not " + std::to_string(W.size()));
  Problem problem{W, b, pairs, directions, friction, block, n, {}, {}};
  for (const double velocity : b) problem.speed = std::max(problem.speed, std::abs(velocity));
  double largest = 0;
  for (std::size_t i = 0; i < n; ++i) largest = std::max(largest, problem.diagonal(i));
  for (std::size_t i = 0; i < n; i += block)
  {
    // a pair that cannot move takes the scale of the others, so that a gap it cannot close is not passed over
    const double normal = problem.diagonal(i) > 0 ? problem.diagonal(i) : largest;
    const double tangential =
        std::max(problem.diagonal(i + 1), directions == 2 ? problem.diagonal(i + 2) : problem.diagonal(i + 1));
    problem.rho_n.push_back(normal > 0 ? 1 / normal : 1);
    problem.rho_t.push_back(tangential > 0 ? 1 / tangential : problem.rho_n.back());
  }
  return problem;
}

PairVector pair_of(const std::vector<double>& values, std::size_t i, std::size_t block)
{
  return {values[i], values[i + 1], block == 3 ? values[i + 2] : 0.};
}

/// Largest entry of the reactions.
double largest_reaction(const std::vector<double>& r)
{
  double largest = 0;
  for (const double value : r) largest = std::max(largest, std::abs(value));
  return largest;
}

double residual_of(const Problem& problem, const std::vector<double>& w, const std::vector<double>& r)
{
  const double largest = largest_reaction(r);
  double residual = 0;
  for (std::size_t pair = 0; pair < problem.rho_n.size(); ++pair)
  {
    const std::size_t i = pair * problem.block;
    const PairVector mine = pair_of(r, i, problem.block), sliding = pair_of(w, i, problem.block);
    const double defect = natural_map(mine, sliding, problem.friction, problem.rho_n[pair], problem.rho_t[pair]);
    if (!std::isfinite(defect + sliding[0] + sliding[1] + sliding[2])) return std::numeric_limits<double>::infinity();
    if (defect > 0) residual = std::max(residual, defect / problem.force_scale(pair, largest));
  }
  return residual;
}

/// target += sum of `count` rows of W, each times its change; contiguous, so that the compiler vectorises it.
void add_rows(const double* __restrict rows, std::size_t n, std::size_t count, const double* change,
              double* __restrict target)
{
  const double x = change[0], y = count > 1 ? change[1] : 0, z = count > 2 ? change[2] : 0;
  if (y == 0 && z == 0)
    for (std::size_t j = 0; j < n; ++j) target[j] += x * rows[j];
  else if (count == 2)
    for (std::size_t j = 0; j < n; ++j) target[j] += x * rows[j] + y * rows[n + j];
  else
    for (std::size_t j = 0; j < n; ++j) target[j] += x * rows[j] + y * rows[n + j] + z * rows[2 * n + j];
}

void refresh(const Problem& problem, const std::vector<double>& r, std::vector<double>& w)
{
  w = problem.b;
  for (std::size_t i = 0; i < problem.n; i += problem.block)
    if (std::any_of(r.begin() + static_cast<std::ptrdiff_t>(i),
                    r.begin() + static_cast<std::ptrdiff_t>(i + problem.block), [](double x) { return x != 0; }))
      add_rows(problem.row(i), problem.n, problem.block, &r[i], w.data());
}

/// One sweep of block Gauss-Seidel, each change times `relaxation`; a change below `negligible` of the pair's force
/// scale is not made, which spares reading its rows. Returns the sum of the changes, which bounds the rounding that w
/// gathers.
double sweep(const Problem& problem, double relaxation, double negligible, std::vector<double>& r,
             std::vector<double>& w)
{
  const double largest = negligible > 0 ? largest_reaction(r) : 0;
  double moved = 0;
  for (std::size_t i = 0; i < problem.n; i += problem.block)
  {
    const PairVector last = pair_of(r, i, problem.block);
    PairBlock A{};
    PairVector q = pair_of(w, i, problem.block);
    for (std::size_t k = 0; k < problem.block; ++k)
      for (std::size_t l = 0; l < problem.block; ++l)
      {
        A[k][l] = problem.row(i + k)[i + l];
        q[k] -= A[k][l] * last[l];
      }
    PairVector next = solve_pair(A, q, problem.directions, problem.friction, last);
    if (relaxation < 1) // stays admissible: the cone is convex
      for (std::size_t k = 0; k < problem.block; ++k) next[k] = last[k] + relaxation * (next[k] - last[k]);
    const PairVector change = {next[0] - last[0], next[1] - last[1], next[2] - last[2]};
    const double size = std::abs(change[0]) + std::abs(change[1]) + std::abs(change[2]);
    if (size == 0 || size <= negligible * problem.force_scale(i / problem.block, largest)) continue;
    moved += size;
    for (std::size_t k = 0; k < problem.block; ++k) r[i + k] = next[k];
    add_rows(problem.row(i), problem.n, problem.block, change.data(), w.data());
  }
  return moved;
}

ContactResult gauss_seidel(const Problem& problem, const ContactSettings& settings, std::vector<double>& r)
{
  ContactResult result;
  std::vector<double> w;
  refresh(problem, r, w);
  result.residual = residual_of(problem, w, r);
  double largest_W = 0, largest_rho = 0, moved = 0;
  for (std::size_t i = 0; i < problem.n; ++i) largest_W = std::max(largest_W, problem.diagonal(i));
  for (std::size_t pair = 0; pair < problem.rho_n.size(); ++pair)
    largest_rho = std::max({largest_rho, problem.rho_n[pair], problem.rho_t[pair]});
  double negligible = 0, relaxation = 1, earlier = result.residual;
  while (!(result.residual <= settings.tolerance) && result.iterations < settings.max_iterations)
  {
    const double change = sweep(problem, relaxation, negligible, r, w);
    ++result.iterations;
    moved += change;
    result.residual = residual_of(problem, w, r);
    if (!std::isfinite(result.residual)) break;
    const double scale = *std::max_element(r.begin(), r.end());
    const double rounding = std::numeric_limits<double>::epsilon() * largest_rho * largest_W * moved;
    const bool due = result.iterations % 50 == 0 || result.residual <= settings.tolerance || change == 0;
    if (due && rounding > .01 * settings.tolerance * scale)
    {
      refresh(problem, r, w);
      moved = 0;
      result.residual = residual_of(problem, w, r);
    }
    if (change == 0 && negligible == 0) break; // no pair moves any more: this is what rounding allows
    if (result.iterations % 50 == 0)
    {
      // strong friction makes sweeps go round in circles, which shorter changes often end
      if (result.residual > .5 * earlier) relaxation = std::max(.25, relaxation / 2);
      earlier = result.residual;
    }
    negligible = change == 0 ? 0 : .02 * settings.tolerance;
  }
  result.converged = result.residual <= settings.tolerance;
  return result;
}

/// Largest eigenvalue of W from a few power iterations: a lower bound, close enough for a step that adapts.
double largest_eigenvalue(const Problem& problem)
{
  std::vector<double> x(problem.n), y(problem.n);
  for (std::size_t i = 0; i < problem.n; ++i) x[i] = 1 + .5 * std::sin(static_cast<double>(7 * i + 1));
  double eigenvalue = 0;
  for (int iteration = 0; iteration < 12; ++iteration)
  {
    double size = 0;
    for (const double value : x) size += value * value;
    if (size == 0) return eigenvalue;
    for (double& value : x) value /= std::sqrt(size);
    std::fill(y.begin(), y.end(), 0.);
    for (std::size_t i = 0; i < problem.n; i += problem.block)
      add_rows(problem.row(i), problem.n, problem.block, &x[i], y.data());
    eigenvalue = 0;
    for (std::size_t i = 0; i < problem.n; ++i) eigenvalue += x[i] * y[i];
    x.swap(y);
  }
  return eigenvalue;
}

ContactResult fixed_point(const Problem& problem, const ContactSettings& settings, std::vector<double>& r)
{
  ContactResult result;
  std::vector<double> w;
  refresh(problem, r, w);
  result.residual = residual_of(problem, w, r);
  if (result.residual <= settings.tolerance) return {0, result.residual, true};
  const double lambda = largest_eigenvalue(problem);
  double rho = (settings.rho > 0 ? settings.rho : 1.5) / (lambda > 0 ? lambda : 1);
  double best = result.residual;
  while (!(result.residual <= settings.tolerance) && result.iterations < settings.max_iterations)
  {
    for (std::size_t i = 0; i < problem.n; i += problem.block)
    {
      r[i] = std::max(0., r[i] - rho * w[i]);
      PairVector next = pair_of(r, i, problem.block);
      for (std::size_t k = 1; k < problem.block; ++k) next[k] -= rho * w[i + k];
      project_on_disc(next, problem.friction);
      for (std::size_t k = 1; k < problem.block; ++k) r[i + k] = next[k];
    }
    refresh(problem, r, w);
    ++result.iterations;
    result.residual = residual_of(problem, w, r);
    if (!std::isfinite(result.residual)) break;
    best = std::min(best, result.residual);
    if (settings.rho == 0 && result.iterations % 20 == 0 && !(result.residual < 10 * best)) rho /= 2;
  }
  result.converged = result.residual <= settings.tolerance;
  return result;
}

} // namespace

std::vector<double> relative_velocity(const std::vector<double>& W, const std::vector<double>& b,
                                      const std::vector<double>& r)
{
  const std::size_t n = b.size();
  std::vector<double> w = b;
  for (std::size_t i = 0; i < n; ++i)
    if (r[i] != 0) add_rows(W.data() + i * n, n, 1, &r[i], w.data());
  return w;
}

double contact_residual(const std::vector<double>& W, const std::vector<double>& w, int pairs, int directions,
                        double friction, const std::vector<double>& r)
{
  std::vector<double> opposite = r;
  for (double& value : opposite) value = -value;
  const std::vector<double> b = relative_velocity(W, w, opposite);
  return residual_of(make_problem(W, b, pairs, directions, friction), w, r);
}

ContactResult solve_contact(const std::vector<double>& W, const std::vector<double>& b, int pairs, int directions,
                            double friction, const ContactSettings& settings, std::vector<double>& r)
{
  const Problem problem = make_problem(W, b, pairs, directions, friction);
  r.resize(problem.n, 0.);
  if (pairs == 0) return {0, 0, true};
  for (std::size_t i = 0; i < problem.n; i += problem.block)
  {
    // a warm start need not be admissible, nor finite after a failed step
    PairVector start = pair_of(r, i, problem.block);
    if (!std::isfinite(start[0] + start[1] + start[2]) || start[0] < 0) start = {};
    project_on_disc(start, friction);
    for (std::size_t k = 0; k < problem.block; ++k) r[i + k] = start[k];
  }
  if (settings.solver == "gauss_seidel") return gauss_seidel(problem, settings, r);
  if (settings.solver == "fixed_point") return fixed_point(problem, settings, r);
  throw Error("contact solver \"" + settings.solver + "\" is not known: gauss_seidel or fixed_point");
}

} // namespace squeal
