#include "squeal/contact/solver.hpp"

#include "contact_work.hpp"
#include "squeal/algebra/panel.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/contact/complementarity.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace squeal
{

double ContactWork::force_scale(std::size_t pair, double largest) const
{
  const double own = speed * std::min(W.rho_n[pair], W.rho_t[pair]);
  return own == 0 ? largest : largest == 0 ? own : std::min(own, largest);
}

bool ContactWork::takes_part(std::size_t pair) const
{
  return b[pair * W.block()] != std::numeric_limits<double>::infinity();
}

PairVector ContactWork::velocity(std::size_t i) const
{
  PairVector w{};
  for (std::size_t k = 0; k < W.block(); ++k) w[k] = b[i + k] + Wr[i + k];
  return w;
}

PairVector pair_of(const std::vector<double>& values, std::size_t i, std::size_t block)
{
  return {values[i], values[i + 1], block == 3 ? values[i + 2] : 0.};
}

double largest_reaction(const std::vector<double>& r)
{
  double largest = 0;
  for (const double value : r) largest = std::max(largest, std::abs(value));
  return largest;
}

double residual_of(const ContactWork& work)
{
  const ContactOperator& W = work.W;
  const double largest = largest_reaction(work.r);
  double residual = 0;
  for (std::size_t pair = 0; pair < W.diagonal.size(); ++pair)
  {
    if (!work.takes_part(pair)) continue;
    const std::size_t i = pair * W.block();
    const PairVector r = pair_of(work.r, i, W.block()), w = work.velocity(i);
    const double defect = natural_map(r, w, work.friction, W.rho_n[pair], W.rho_t[pair]);
    if (!std::isfinite(defect + w[0] + w[1] + w[2])) return std::numeric_limits<double>::infinity();
    if (defect > 0) residual = std::max(residual, defect / work.force_scale(pair, largest));
  }
  return residual;
}

namespace
{

void fixed_point(ContactWork& work, const ContactSettings& settings)
{
  const std::size_t block = work.W.block();
  ContactResult& result = work.result;
  for (std::size_t pair = 0; pair < work.W.diagonal.size(); ++pair)
    if (!work.takes_part(pair)) std::fill_n(work.r.begin() + static_cast<std::ptrdiff_t>(pair * block), block, 0.);
  ContactWork* const alone[] = {&work};
  refresh(alone);
  result.residual = residual_of(work);
  // a lower bound, close enough for a step that adapts
  const double lambda = result.residual > settings.tolerance ? largest_eigenvalue(work.W.W, work.W.size(), 12) : 0;
  double rho = (settings.rho > 0 ? settings.rho : 1.5) / (lambda > 0 ? lambda : 1);
  double best = result.residual;
  while (result.residual > settings.tolerance && std::isfinite(result.residual) &&
         result.iterations < settings.max_iterations)
  {
    for (std::size_t pair = 0; pair < work.W.diagonal.size(); ++pair)
    {
      if (!work.takes_part(pair)) continue;
      const PairVector w = work.velocity(pair * block);
      PairVector next = pair_of(work.r, pair * block, block);
      next[0] = std::max(0., next[0] - rho * w[0]);
      for (std::size_t k = 1; k < block; ++k) next[k] -= rho * w[k];
      project_on_disc(next, work.friction);
      std::copy_n(next.begin(), block, work.r.begin() + static_cast<std::ptrdiff_t>(pair * block));
    }
    refresh(alone);
    ++result.iterations;
    result.residual = residual_of(work);
    best = std::min(best, result.residual);
    if (settings.rho == 0 && result.iterations % 20 == 0 && !(result.residual < 10 * best)) rho /= 2;
  }
  result.converged = result.residual <= settings.tolerance;
}

ContactWork start(const ContactOperator& W, double friction, const ContactProblem& problem)
{
  if (problem.b.size() != W.size())
    throw Error("contact: " + std::to_string(problem.b.size()) + " velocities for " + std::to_string(W.size()) +
                " rows of W");
  ContactWork work{W, friction, problem.b, problem.r, {}};
  problem.r.resize(W.size(), 0.);
  if (!std::all_of(work.r.begin(), work.r.end(), [](double value) { return std::isfinite(value); }))
    std::fill(work.r.begin(), work.r.end(), 0.);
  for (const double velocity : problem.b)
    if (velocity != std::numeric_limits<double>::infinity()) work.speed = std::max(work.speed, std::abs(velocity));
  return work;
}

/// r(t+h) = sum of c_k r(t - k h): constant, linear, quadratic in time.
constexpr double extrapolation[3][3] = {{1, 0, 0}, {2, -1, 0}, {3, -3, 1}};
constexpr int unread_at_most = 20; // extrapolated products gather rounding

/// Puts the extrapolation of least residual into r and W r; false if nothing is remembered that belongs to r.
bool start_warm(ContactWork& work, const ContactMemory& memory, int highest_order)
{
  if (memory.r.empty() || memory.r[0] != work.r || memory.unread >= unread_at_most) return false;
  std::vector<double> best_r, best_Wr;
  double least = std::numeric_limits<double>::infinity();
  const auto orders = std::min(memory.r.size(), static_cast<std::size_t>(highest_order) + 1);
  for (std::size_t order = 0; order < orders; ++order)
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
  memory.unread = work.reads > 0 ? 0 : memory.unread + 1;
  memory.r.insert(memory.r.begin(), work.r);
  memory.Wr.insert(memory.Wr.begin(), work.Wr);
  if (memory.r.size() > 3) memory.r.pop_back(), memory.Wr.pop_back();
}

} // namespace

OptionList options_of(ContactSettings& settings)
{
  return {
      {"-transient_contact_solver", choice_of(settings.solver), Range::any,
       "block Gauss-Seidel, or the projection fixed point (fixed_point)"},
      {"-transient_contact_tolerance", &settings.tolerance, Range::positive,
       "largest natural map of a pair over the largest reaction"},
      {"-transient_contact_max_it", &settings.max_iterations, Range::natural,
       "contact iterations (sweeps) allowed a step"},
      {"-transient_contact_rho", &settings.rho, Range::below_two,
       "of the fixed point, over 1/lambda_max(W); 0: chosen; it contracts below 2 only"},
      {"-transient_contact_extrapolation", &settings.extrapolation, Range::up_to_two,
       "highest order in time of the warm start; the best one is taken"},
  };
}

void refresh(std::span<ContactWork* const> works)
{
  if (works.empty()) return;
  const ContactOperator& W = works.front()->W;
  const std::size_t n = W.size(), lanes = lanes_for(works.size());
  std::vector<double> r(n * lanes), Wr(n * lanes);
  for (std::size_t k = 0; k < works.size(); ++k)
    for (std::size_t i = 0; i < n; ++i) r[i * lanes + k] = works[k]->r[i];
  if (lanes == 1)
    symmetric_product(W.W.data(), n, r.data(), Wr.data());
  else
    dense_product(W.W.data(), n, lanes, r.data(), Wr.data());
  for (std::size_t k = 0; k < works.size(); ++k)
  {
    works[k]->Wr.resize(n);
    for (std::size_t i = 0; i < n; ++i) works[k]->Wr[i] = Wr[i * lanes + k];
    ++works[k]->reads;
  }
}

std::vector<ContactResult> solve_contacts(const ContactOperator& W, double friction, const ContactSettings& settings,
                                          std::span<const ContactProblem> problems)
{
  std::vector<ContactWork> works;
  for (const ContactProblem& problem : problems) works.push_back(start(W, friction, problem));
  if (W.pairs == 0) return std::vector<ContactResult>(problems.size(), {0, 0, true});
  if (settings.solver == ContactSolver::gauss_seidel)
  {
    std::vector<ContactWork*> all, cold;
    for (std::size_t k = 0; k < works.size(); ++k)
    {
      all.push_back(&works[k]);
      if (!start_warm(works[k], problems[k].memory, settings.extrapolation)) cold.push_back(&works[k]);
    }
    refresh(cold);
    gauss_seidel(all, settings);
  }
  else
    for (ContactWork& work : works) fixed_point(work, settings);
  std::vector<ContactResult> results;
  for (std::size_t k = 0; k < works.size(); ++k)
  {
    remember(works[k], problems[k].memory);
    results.push_back(works[k].result);
  }
  return results;
}

ContactResult solve_contact(const std::vector<double>& W, const std::vector<double>& b, int pairs, int directions,
                            double friction, const ContactSettings& settings, std::vector<double>& r)
{
  ContactMemory nothing;
  const ContactProblem problem{b, r, nothing};
  return solve_contacts(make_contact_operator(W, pairs, directions), friction, settings, std::span(&problem, 1))[0];
}

std::vector<double> relative_velocity(const std::vector<double>& W, const std::vector<double>& b,
                                      const std::vector<double>& r)
{
  const std::size_t n = b.size();
  std::vector<double> w = b;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) w[i] += W[i * n + j] * r[j];
  return w;
}

double contact_residual(const std::vector<double>& W, const std::vector<double>& w, int pairs, int directions,
                        double friction, const std::vector<double>& r)
{
  const ContactOperator op = make_contact_operator(W, pairs, directions);
  std::vector<double> opposite = r, reactions = r;
  for (double& value : opposite) value = -value;
  const std::vector<double> b = relative_velocity(W, w, opposite);
  ContactMemory nothing;
  ContactWork work = start(op, friction, {b, reactions, nothing});
  ContactWork* const alone[] = {&work};
  refresh(alone);
  return residual_of(work);
}

} // namespace squeal
