/// One step of the modified theta-method (Charroyer, Chiello, Sinou 2017; header: the equations).
///
/// With M v and A v of the current state at hand, the explicit matrix needs no product of its own,
///     M - h(1-theta) C - h^2 theta(1-theta) K = [M - (1-theta) A]/theta,
/// and A v+ is the right-hand side just solved for: a step multiplies by M and K once each. The same vectors give the
/// energies and, from (A - M) v_theta = h theta C v_theta + theta^2 h (K u+ - K u), the damping work.
#include "squeal/algebra/multivector.hpp"
#include "squeal/transient/transient.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

namespace squeal
{

namespace
{

/// b of w = W r + b, from the free velocity's B v: normal rows are gap rates (g + B_n ut)/h + B_n v, tangential ones s.
/// Collective; the result is on rank 0.
std::vector<double> free_contact_velocity(const ThetaStep& step, const Interface& interface, const State& state,
                                          StepWork& work, std::vector<double> b)
{
  check(VecWAXPY(work.v_theta, step.h * (1 - step.theta), state.v, state.u)); // ut, for a moment
  const std::vector<double> position = relative(interface, work.v_theta);
  double rounding = 0;
  if (step.law == ContactLaw::velocity) check(VecNorm(work.v_theta, NORM_INFINITY, &rounding));
  if (b.empty()) return b;
  const auto block = static_cast<std::size_t>(interface.block()), directions = block - 1;
  // A gap at rounding is closed: against the displacements it was rounded from, or a free step's own motion.
  for (std::size_t i = 0; i < b.size(); i += block) rounding = std::max(rounding, step.h * std::abs(b[i]));
  rounding *= 1e-10;
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
  {
    const double gap = interface.gap[i] + position[i * block];
    if (step.law == ContactLaw::displacement)
      b[i * block] += gap / step.h;
    else if (gap > rounding)
      b[i * block] = std::numeric_limits<double>::infinity(); // takes no part: r = 0
    for (std::size_t k = 0; k < directions; ++k) b[i * block + 1 + k] -= interface.drive[i * directions + k];
  }
  return b;
}

/// (1-theta)/theta s of the state's sliding velocity s, on tangential rows: friction opposes s+ and that. Nothing for
/// pairs that stuck, whose s is rounding. Collective; the result is on rank 0.
std::vector<double> earlier_sliding(const ThetaStep& step, const Interface& interface, const State& state)
{
  std::vector<double> s = relative(interface, state.v);
  const auto block = static_cast<std::size_t>(interface.block()), directions = block - 1;
  const double part = step.opposed == Opposed::theta ? (1 - step.theta) / step.theta : 0;
  const std::vector<ContactStatus> status = contact_status(interface, state.reactions);
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
  {
    s[i * block] = 0;
    for (std::size_t k = 0; k < directions; ++k)
      s[i * block + 1 + k] =
          status[i] == ContactStatus::stick ? 0 : part * (s[i * block + 1 + k] - interface.drive[i * directions + k]);
  }
  return s;
}

/// Takes the earlier sliding away from closed pairs that it would bring to rest or turn back: friction does neither by
/// itself, and a pair at rest must not be one that swings about it. Returns whether there were any. w = W r + b, b with
/// it.
bool forget_where_turned(const Interface& interface, const std::vector<double>& r, const std::vector<double>& w,
                         double* earlier)
{
  bool any = false;
  const auto block = static_cast<std::size_t>(interface.block());
  for (std::size_t i = 0; i < r.size(); i += block)
  {
    double along = 0;
    for (std::size_t k = i + 1; k < i + block; ++k) along += (w[k] - earlier[k]) * earlier[k];
    if (r[i] <= 0 || along >= 0) continue;
    std::fill_n(earlier + i, block, 0.);
    any = true;
  }
  return any;
}

/// Solves contact on rank 0, where W is, and hands each r to every rank. `b`, `earlier`: one problem's after the
/// other's.
void find_reactions(const ThetaStep& step, const Interface& interface, const std::vector<double>& b,
                    std::vector<double>& earlier, std::span<StepWork> works, std::span<State> states,
                    std::span<StepReport> reports, MPI_Comm comm)
{
  // One message: iterations, residual, converged, r of each. Latency counts on small models.
  const std::size_t size = interface.size(), length = size + 3;
  std::string problem;
  std::vector<double> told(length * states.size(), -1);
  const auto solve_all = [&]
  {
    std::vector<std::size_t> open(states.size()); // problems
    std::iota(open.begin(), open.end(), 0);
    while (!open.empty())
    {
      std::vector<std::vector<double>> mine;
      std::vector<ContactProblem> problems;
      for (const std::size_t k : open)
      {
        mine.emplace_back(size);
        std::transform(&b[k * size], &b[k * size] + size, &earlier[k * size], mine.back().begin(), std::plus<>());
      }
      for (std::size_t j = 0; j < open.size(); ++j)
        problems.push_back({mine[j], states[open[j]].reactions, works[open[j]].memory});
      const auto results = solve_contacts(step.W, interface.friction, step.contact, problems);
      std::vector<std::size_t> again;
      for (std::size_t j = 0; j < open.size(); ++j)
      {
        const std::size_t k = open[j];
        double* const entries = &told[k * length];
        entries[0] = std::max(entries[0], 0.) + results[j].iterations;
        entries[1] = results[j].residual;
        entries[2] = results[j].converged ? 1 : 0;
        const std::vector<double>& Wr = works[k].memory.Wr.front();
        std::transform(Wr.begin(), Wr.end(), mine[j].begin(), mine[j].begin(), std::plus<>());
        if (works[k].record) works[k].record->contact_velocity = mine[j];
        if (forget_where_turned(interface, states[k].reactions, mine[j], &earlier[k * size])) again.push_back(k);
      }
      open = std::move(again);
    }
    for (std::size_t k = 0; k < states.size(); ++k)
      std::copy(states[k].reactions.begin(), states[k].reactions.end(), &told[k * length] + 3);
  };
  if (rank_of(comm) == 0)
  {
    try
    {
      solve_all();
    }
    catch (const std::exception& error)
    {
      problem = error.what();
    }
  }
  MPI_Bcast(told.data(), static_cast<int>(told.size()), MPI_DOUBLE, 0, comm);
  if (told[0] < 0) agree(comm, problem);
  for (std::size_t k = 0; k < states.size(); ++k)
  {
    const double* const entries = &told[k * length];
    reports[k].contact_iterations = static_cast<int>(entries[0]);
    reports[k].contact_residual = entries[1];
    reports[k].contact_converged = entries[2] > 0;
    std::copy(entries + 3, entries + length, states[k].reactions.begin());
  }
}

/// The products whose sums over the ranks make up the works. Overwrites M v, A v and K u of the start.
using Factors = std::array<std::pair<Vec, Vec>, 7>;

Factors factors_of_works(const ThetaStep& step, const Structure& structure, const State& state, StepWork& work)
{
  const double theta = step.theta;
  Vec dv = work.dv, change = work.Ku, d = work.Mv;
  check(VecWAXPY(dv, -1, state.v, work.v_next));
  check(VecAYPX(change, -1, work.Ku_next)); // K du
  // theta h C v_theta = A v_theta - M v_theta - theta^2 h K du
  check(VecAXPBYPCZ(work.Av, theta, -theta, 1 - theta, work.Av_next, work.Mv_next));
  check(VecAXPY(work.Av, theta - 1, work.Mv));
  check(VecAXPY(work.Av, -theta * theta * step.h, change));
  check(VecAYPX(d, -1, work.Mv_next)); // M dv
  return {{{work.v_next, work.Mv_next},
           {state.u, work.Ku_next},
           {work.v_theta, work.f},
           {work.v_theta, structure.load},
           {work.v_theta, work.Av},
           {dv, d},
           {work.v_theta, change}}};
}

/// Works of each step from the products at both ends; all reductions in one message.
void account(const ThetaStep& step, const Structure& structure, std::span<const State> states,
             std::span<StepWork> works, std::span<StepReport> reports)
{
  std::vector<Factors> factors;
  std::vector<std::array<double, 7>> products(states.size());
  for (std::size_t k = 0; k < states.size(); ++k)
    factors.push_back(factors_of_works(step, structure, states[k], works[k]));
  for (std::size_t k = 0; k < states.size(); ++k)
    for (std::size_t i = 0; i < 7; ++i) check(VecDotBegin(factors[k][i].first, factors[k][i].second, &products[k][i]));
  for (std::size_t k = 0; k < states.size(); ++k)
  {
    for (std::size_t i = 0; i < 7; ++i) check(VecDotEnd(factors[k][i].first, factors[k][i].second, &products[k][i]));
    const auto [kinetic, potential, contact, load, damping, dMd, dKd] = products[k];
    StepReport& report = reports[k];
    report.energy = (kinetic + potential) / 2;
    report.damping_work = damping / step.theta;
    report.contact_work = contact;
    report.load_work = step.h * load;
    report.energy_defect = report.energy - works[k].energy - (0.5 - step.theta) * (dMd + step.h * dKd) +
                           report.damping_work - contact - report.load_work;
  }
}

/// The start of a step: A v_free = [M v - (1-theta) A v]/theta - h K u + h F, into A v_next.
void load_free_step(const ThetaStep& step, const Structure& structure, StepWork& work)
{
  check(VecCopy(work.Mv, work.Av_next));
  check(VecAXPBYPCZ(work.Av_next, (step.theta - 1) / step.theta, -step.h, 1 / step.theta, work.Av, work.Ku));
  check(VecAXPY(work.Av_next, step.h, structure.load));
}

/// What the tangent needs of the contact just solved, on every rank. `earlier`: the problem's entries, on rank 0.
void record_contact(const Interface& interface, const State& state, const double* earlier, StepRecord& record,
                    MPI_Comm comm)
{
  const auto block = static_cast<std::size_t>(interface.block()), pairs = static_cast<std::size_t>(interface.pairs);
  record.reactions = state.reactions;
  record.contact_velocity.resize(interface.size());
  record.opposes_theta.assign(pairs, 0);
  for (std::size_t i = 0; earlier && i < interface.size(); ++i)
    if (earlier[i] != 0) record.opposes_theta[i / block] = 1;
  MPI_Bcast(record.contact_velocity.data(), static_cast<int>(interface.size()), MPI_DOUBLE, 0, comm);
  MPI_Bcast(record.opposes_theta.data(), interface.pairs, MPI_CHAR, 0, comm);
  if (record.wanted == Recorded::contact) return;
  record.gap = interface.gap;
  const std::vector<double> position = relative(interface, state.u);
  for (std::size_t i = 0; i < pairs; ++i) record.gap[i] += position[i * block];
}

/// The rates of h, from a step that is complete: `account` left M dv and K du in Mv and Ku.
void record_rates(const ThetaStep& step, const StepWork& work)
{
  StepRecord& record = *work.record;
  if (record.wanted == Recorded::contact) return;
  record.v_theta = copy_of(work.v_theta.get());
  record.force = copy_of(work.Mv.get());
  check(VecAXPBY(record.force, -step.theta, 1 / step.h, work.Ku));
}

/// The contact of all of them: reactions into the states and reports, h B'r into f and A v_next; returns -h r.
std::vector<double> push_apart(const ThetaStep& step, const Interface& interface, const std::vector<double>& Bv_free,
                               std::span<StepWork> works, std::span<State> states, std::span<StepReport> reports,
                               MPI_Comm comm)
{
  std::vector<double> b, earlier, lambda;
  const std::size_t size = interface.size();
  for (std::size_t k = 0; k < states.size(); ++k)
  {
    const auto first = Bv_free.begin() + static_cast<std::ptrdiff_t>(Bv_free.empty() ? 0 : k * size);
    const auto mine =
        free_contact_velocity(step, interface, states[k], works[k],
                              {first, Bv_free.empty() ? first : first + static_cast<std::ptrdiff_t>(size)});
    b.insert(b.end(), mine.begin(), mine.end());
    const std::vector<double> s = earlier_sliding(step, interface, states[k]);
    earlier.insert(earlier.end(), s.begin(), s.end());
  }
  find_reactions(step, interface, b, earlier, works, states, reports, comm);
  for (std::size_t k = 0; k < states.size(); ++k)
  {
    if (works[k].record)
      record_contact(interface, states[k], rank_of(comm) == 0 ? &earlier[k * size] : nullptr, *works[k].record, comm);
    check(VecSet(works[k].f, 0));
    add_reactions(interface, states[k].reactions, works[k].f);
    check(VecScale(works[k].f, step.h));
    check(VecAXPY(works[k].Av_next, 1, works[k].f));
    for (const double reaction : states[k].reactions) lambda.push_back(-step.h * reaction);
  }
  return lambda;
}

} // namespace

OptionList options_of(StepOptions& options)
{
  OptionList list = {
      {"-transient_friction", choice_of(options.opposed), Range::any,
       "opposes the sliding velocity at theta, or at the end of the step (end)"},
      {"-transient_contact_law", choice_of(options.law), Range::any,
       "contact on displacements, or on velocities (velocity)"},
      {"-transient_refuse", &options.refuse, Range::any,
       "false: march even where theta and the step give misleading growth rates"},
  };
  for (Option& option : options_of(options.contact)) list.push_back(std::move(option));
  return list;
}

Owned<Mat> step_matrix(const Structure& structure, double h, double theta)
{
  Owned<Mat> A;
  check(MatDuplicate(structure.M, MAT_COPY_VALUES, A.put()));
  check(MatAXPY(A, h * theta, structure.C, SAME_NONZERO_PATTERN));
  check(MatAXPY(A, h * h * theta * theta, structure.K, SAME_NONZERO_PATTERN));
  check(MatSetOption(A, MAT_SYMMETRIC, PETSC_TRUE));
  return A;
}

ThetaStep make_theta_step(const Structure& structure, const Interface& interface, double h, double theta,
                          const StepOptions& options)
{
  if (!(h > 0) || !std::isfinite(h)) throw Error("the time step must be above 0, not " + std::to_string(h) + " s");
  if (!(theta > 0 && theta <= 1)) throw Error("theta must be in (0, 1], not " + std::to_string(theta));
  const double start = MPI_Wtime();
  ThetaStep step;
  step.h = h;
  step.theta = theta;
  step.law = options.law;
  step.opposed = options.opposed;
  step.contact = options.contact;
  CondensedOperator condensed = condense(step_matrix(structure, h, theta), interface, h, structure.names);
  step.factor = std::move(condensed.factor);
  step.factor_seconds = MPI_Wtime() - start;
  if (rank_of(comm_of(structure.load)) == 0)
    step.W = make_contact_operator(std::move(condensed.W), interface.pairs, interface.directions);
  step.matrices = pair_matrices(structure.M, structure.K);
  step.condensed_seconds = MPI_Wtime() - start - step.factor_seconds;
  return step;
}

void multiply_mass_and_stiffness(const ThetaStep& step, const Structure& structure,
                                 const std::array<std::span<const Vec>, 2>& of,
                                 const std::array<std::span<const Vec>, 2>& to)
{
  if (step.matrices) return multiply_both(*step.matrices, of[0], of[1], to[0], to[1]);
  product(structure.M, of[0], to[0]);
  product(structure.K, of[1], to[1]);
}

StepWork begin_steps(const ThetaStep& step, const Structure& structure, const Interface& interface, State& state)
{
  StepWork work;
  for (Owned<Vec>* x : {&work.Mv, &work.Av, &work.Ku, &work.Mv_next, &work.Av_next, &work.Ku_next, &work.dv,
                        &work.v_next, &work.v_theta, &work.f})
    *x = zeros_like(structure.load);
  check(MatMult(structure.M, state.v, work.Mv));
  check(MatMult(structure.C, state.v, work.Av));
  check(VecAYPX(work.Av, step.h * step.theta, work.Mv));
  check(MatMult(structure.K, state.v, work.dv));
  check(VecAXPY(work.Av, step.h * step.h * step.theta * step.theta, work.dv));
  check(MatMult(structure.K, state.u, work.Ku));
  double kinetic = 0, potential = 0;
  check(VecDot(state.v, work.Mv, &kinetic));
  check(VecDot(state.u, work.Ku, &potential));
  work.energy = (kinetic + potential) / 2;
  state.reactions.resize(interface.size(), 0);
  return work;
}

std::vector<StepReport> advance(const ThetaStep& step, const Structure& structure, const Interface& interface,
                                std::span<StepWork> works, std::span<State> states)
{
  const double h = step.h, theta = step.theta;
  std::vector<StepReport> reports(states.size());
  std::vector<Vec> right, next;
  for (StepWork& work : works)
  {
    load_free_step(step, structure, work);
    right.push_back(work.Av_next);
    next.push_back(work.v_next);
  }
  const std::vector<double> Bv_free = step.factor.forward(right);
  std::vector<double> lambda;
  const MPI_Comm comm = comm_of(structure.load);
  if (interface.pairs > 0) lambda = push_apart(step, interface, Bv_free, works, states, reports, comm);
  step.factor.backward(lambda, next);
  std::vector<Vec> u, Mv, Ku;
  for (std::size_t k = 0; k < states.size(); ++k)
  {
    StepWork& work = works[k];
    check(VecAXPBYPCZ(work.v_theta, theta, 1 - theta, 0, work.v_next, states[k].v));
    check(VecAXPY(states[k].u, h, work.v_theta));
    u.push_back(states[k].u);
    Mv.push_back(work.Mv_next);
    Ku.push_back(work.Ku_next);
  }
  multiply_mass_and_stiffness(step, structure, {next, u}, {Mv, Ku});
  account(step, structure, states, works, reports);
  for (std::size_t k = 0; k < states.size(); ++k)
  {
    StepWork& work = works[k];
    for (const ContactStatus status : contact_status(interface, states[k].reactions))
      ++(status == ContactStatus::open    ? reports[k].open
         : status == ContactStatus::stick ? reports[k].stick
                                          : reports[k].slip);
    if (work.record) record_rates(step, work);
    check(VecCopy(work.v_next, states[k].v));
    std::swap(work.Mv, work.Mv_next);
    std::swap(work.Av, work.Av_next);
    std::swap(work.Ku, work.Ku_next);
    work.energy = reports[k].energy;
    states[k].time += h;
  }
  return reports;
}

StepReport advance(const ThetaStep& step, const Structure& structure, const Interface& interface, StepWork& work,
                   State& state)
{
  return advance(step, structure, interface, std::span(&work, 1), std::span(&state, 1))[0];
}

std::vector<ContactStatus> contact_status(const Interface& interface, const std::vector<double>& reactions)
{
  const auto block = static_cast<std::size_t>(interface.block());
  double largest = 0;
  for (std::size_t i = 0; i < reactions.size(); i += block) largest = std::max(largest, reactions[i]);
  std::vector<ContactStatus> status(static_cast<std::size_t>(interface.pairs), ContactStatus::open);
  for (std::size_t i = 0; i < status.size(); ++i)
  {
    const double* r = &reactions[i * block];
    if (r[0] <= 0) continue;
    const double friction = block == 2 ? std::abs(r[1]) : std::hypot(r[1], r[2]);
    status[i] = interface.friction * r[0] - friction > 1e-8 * largest ? ContactStatus::stick : ContactStatus::slip;
  }
  return status;
}

} // namespace squeal
