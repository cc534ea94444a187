#include "squeal/contact/solver.hpp"

#include "contact_work.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace squeal
{

namespace
{

/// One iteration r <- proj(r - rho w) of every pair; W r is then no longer that of r.
void project(ContactWork& work, double rho)
{
  const PairView<double> r(work.r, work.W.directions());
  for (std::size_t pair = 0; pair < work.W.pairs(); ++pair)
  {
    const PairVector w = work.velocity(pair);
    PairVector next = r.vector(pair);
    for (std::size_t k = 0; k < next.size(); ++k) next[k] -= rho * w[k];
    r.set(pair, admissible(next, w, work.friction.of(pair)));
  }
}

void fixed_point(ContactWork& work, const ContactSettings& settings)
{
  ContactResult& result = work.result;
  form_product(work);
  result.residual = residual_of(work);
  // a lower bound, close enough for a step that adapts
  const std::vector<double> ones(work.W.size(), 1.);
  const double lambda = result.residual > settings.tolerance ? work.W.largest_eigenvalue(ones, 12) : 0;
  double rho = (settings.rho > 0 ? settings.rho : 1.5) / (lambda > 0 ? lambda : 1);
  double best = result.residual;
  while (result.residual > settings.tolerance && std::isfinite(result.residual) &&
         result.iterations < settings.max_iterations)
  {
    project(work, rho);
    form_product(work);
    ++result.iterations;
    result.residual = residual_of(work);
    best = std::min(best, result.residual);
    if (settings.rho == 0 && result.iterations % 20 == 0 && !(result.residual < 10 * best)) rho /= 2;
  }
  result.converged = result.residual <= settings.tolerance;
}

ContactWork start(const ContactOperator& W, const PairFriction& friction, const ContactProblem& problem)
{
  if (problem.b.size() != W.size())
    throw Error("contact: " + std::to_string(problem.b.size()) + " velocities for " + std::to_string(W.size()) +
                " rows of W");
  ContactWork work{W, friction, problem.b, problem.r, {}};
  problem.r.resize(W.size(), 0.);
  if (!std::all_of(work.r.begin(), work.r.end(), [](double value) { return std::isfinite(value); }))
    std::fill(work.r.begin(), work.r.end(), 0.);
  for (const double velocity : problem.b) work.speed = std::max(work.speed, std::abs(velocity));
  return work;
}

/// r(t+h) = sum of c_k r(t - k h): constant, linear, quadratic in time.
constexpr std::size_t kept = 3; // solutions of the past
constexpr double extrapolation[kept][kept] = {{1, 0, 0}, {2, -1, 0}, {3, -3, 1}};
constexpr int unread_at_most = 20; // extrapolated products gather rounding

/// Puts the extrapolation of least residual into r and W r; false if nothing is remembered that belongs to r.
bool start_warm(ContactWork& work, const ContactMemory& memory)
{
  if (memory.r.empty() || memory.r[0] != work.r || memory.since_read >= unread_at_most) return false;
  std::vector<double> best_r, best_Wr;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t order = 0; order < memory.r.size(); ++order)
  {
    work.r.assign(work.b.size(), 0.);
    work.Wr.assign(work.b.size(), 0.);
    for (std::size_t k = 0; k <= order; ++k)
      for (std::size_t i = 0; i < work.b.size(); ++i)
      {
        work.r[i] += extrapolation[order][k] * memory.r[k][i];
        work.Wr[i] += extrapolation[order][k] * memory.Wr[k][i];
      }
    const double residual = residual_of(work);
    if (order > 0 && !(residual < least)) continue;
    least = residual;
    best_r = work.r;
    best_Wr = work.Wr;
  }
  work.r = best_r;
  work.Wr = best_Wr;
  return true;
}

void remember(const ContactWork& work, ContactMemory& memory)
{
  memory.since_read = work.reads > 0 ? 0 : memory.since_read + 1;
  memory.r.insert(memory.r.begin(), work.r);
  memory.Wr.insert(memory.Wr.begin(), work.Wr);
  if (memory.r.size() > kept) memory.r.pop_back(), memory.Wr.pop_back();
}

} // namespace

ContactResult solve_contact(const ContactOperator& W, const PairFriction& friction, const ContactSettings& settings,
                            const ContactProblem& problem)
{
  ContactWork work = start(W, friction, problem);
  if (W.pairs() == 0) return {0, 0, true};
  if (settings.solver == ContactSolver::gauss_seidel)
  {
    if (!start_warm(work, problem.memory)) form_product(work);
    gauss_seidel(work, settings);
  }
  else
    fixed_point(work, settings);
  remember(work, problem.memory);
  return work.result;
}

} // namespace squeal
