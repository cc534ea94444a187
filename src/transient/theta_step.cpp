/// One step of the modified theta-method (Charroyer, Chiello, Sinou 2017; header: the equations).
///
/// With M v and A v of the current state at hand, the explicit matrix needs no product of its own,
///     M - h(1-theta) C - h^2 theta(1-theta) K = [M - (1-theta) A]/theta,
/// and A v+ is the right-hand side just solved for. So a step multiplies by M and K once each. The same vectors give
/// the energies and, from (A - M) v_theta = h theta C v_theta + theta^2 h (K u+ - K u), the damping work.
#include "squeal/algebra/multivector.hpp"
#include "squeal/base/free_memory.hpp"
#include "step_contact.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>

namespace squeal
{

namespace
{

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

/// h v_d . r_t over the pairs, v_d its mean over the step by theta.
double drive_work(const OneStep& one)
{
  const auto& [step, interface, factors, work, state, report] = one;
  const PairView reactions(state.reactions, interface.directions);
  const TangentView drive(interface.drive, interface.directions);
  double sum = 0;
  for (std::size_t i = 0; i < reactions.pairs(); ++i) sum += dot(drive.of(i), reactions.tangential(i));
  return step.h * (step.theta * factors.drive_end + (1 - step.theta) * factors.drive_start) * sum;
}

/// h r.B v_theta over the undriven pairs of each contact: what friction takes, and shocks. Empty without such pairs.
/// Collective.
std::vector<double> joint_work(const OneStep& one)
{
  std::vector<double> work;
  const Interface& interface = one.interface;
  if (!has_undriven_pairs(interface)) return work;
  const std::vector<double> velocity = relative(interface, one.work.v_theta);
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
  {
    if (!is_undriven(interface, i)) continue;
    const std::size_t contact = interface.friction.contact_of(i);
    work.resize(std::max(work.size(), contact + 1));
    work[contact] += one.step.h * dot(PairView(one.state.reactions, interface.directions).of(i),
                                      PairView(velocity, interface.directions).of(i));
  }
  return work;
}

/// Moves the slip positions of pairs that do not stick, to those at u_theta. Collective.
void move_slip(const OneStep& one, const std::vector<ContactStatus>& statuses)
{
  const auto& [step, interface, factors, work, state, report] = one;
  if (state.slip.empty()) return;
  check(VecWAXPY(work.f, -step.h * (1 - step.theta), work.v_theta, state.u)); // u_theta
  const std::vector<double> moved = slip_positions(interface, work.f, state.reactions);
  const PairView<double> slip(state.slip, interface.directions);
  for (std::size_t i = 0; i < statuses.size(); ++i)
    if (statuses[i] != ContactStatus::stick) slip.set(i, PairView(moved, interface.directions).vector(i));
}

/// Works of the step from the products at both ends; all reductions in one message.
void account(const OneStep& one, const Structure& structure)
{
  const auto& [step, interface, step_factors, work, state, report] = one;
  const Factors factors = factors_of_works(step, structure, state, work);
  std::array<double, 7> products{};
  for (std::size_t i = 0; i < 7; ++i) check(VecDotBegin(factors[i].first, factors[i].second, &products[i]));
  for (std::size_t i = 0; i < 7; ++i) check(VecDotEnd(factors[i].first, factors[i].second, &products[i]));
  const auto [kinetic, potential, contact, load, damping, dMd, dKd] = products;
  report.energy = (kinetic + potential) / 2;
  report.damping_work = damping / step.theta;
  report.contact_work = contact;
  report.load_work = step.h * step_factors.load * load;
  if (structure.preload.get() && step_factors.load != 1) // no factor scales it
    report.load_work += step.h * (1 - step_factors.load) * dot(structure.preload, work.v_theta);
  report.drive_work = drive_work(one);
  report.joint_work = joint_work(one);
  report.energy_defect = report.energy - work.energy - (0.5 - step.theta) * (dMd + step.h * dKd) + report.damping_work -
                         contact - report.load_work;
}

/// The start of a step: A v_free = [M v - (1-theta) A v]/theta - h K u + h F, into A v_next. `factor`: on F, but for
/// its preload.
void load_free_step(const ThetaStep& step, const Structure& structure, double factor, StepWork& work)
{
  check(VecCopy(work.Mv, work.Av_next));
  check(VecAXPBYPCZ(work.Av_next, (step.theta - 1) / step.theta, -step.h, 1 / step.theta, work.Av, work.Ku));
  check(VecAXPY(work.Av_next, step.h * factor, structure.load));
  if (structure.preload.get()) check(VecAXPY(work.Av_next, step.h * (1 - factor), structure.preload));
}

/// Adds h B'r of the reactions to A v+, and keeps it in f; returns -h r.
std::vector<double> apply_reactions(const OneStep& one)
{
  StepWork& work = one.work;
  check(VecSet(work.f, 0));
  add_reactions(one.interface, one.state.reactions, work.f);
  check(VecScale(work.f, one.step.h));
  check(VecAXPY(work.Av_next, 1, work.f));
  std::vector<double> lambda;
  for (const double reaction : one.state.reactions) lambda.push_back(-one.step.h * reaction);
  return lambda;
}

/// v+ and v_theta from A v_free in Av_next, with contact; Av_next becomes A v+.
void solve_step(const OneStep& one)
{
  const auto& [step, interface, factors, work, state, report] = one;
  const Vec right = work.Av_next, next = work.v_next;
  const std::vector<double> Bv_free = step.factor.forward(std::span(&right, 1));
  std::vector<double> lambda;
  if (interface.pairs > 0)
  {
    find_reactions(one, Bv_free);
    lambda = apply_reactions(one);
  }
  step.factor.backward(lambda, std::span(&next, 1));
  check(VecAXPBYPCZ(work.v_theta, step.theta, 1 - step.theta, 0, next, state.v));
}

/// Whether the gyroscopic part needs another pass: `change` of h G v_theta over A v+ in the last one, `before` in the
/// one before it, after `count` of them. Error: the passes do not converge.
bool needs_another_pass(double change, double before, int count, double h)
{
  constexpr double enough = 1e-15, rounding = 1e-9; // of contact's tolerance; what stays at it does not fall further
  constexpr int most = 60;
  const bool falls = change <= 0.9 * before;
  if (count > 1 && (change <= enough || (!falls && change <= rounding))) return false;
  if (count >= most || (count >= 10 && !falls && change > 1))
    throw Error(format(
        "a step of %g s is too long for the gyroscopic part: its passes do not converge; take more steps a period", h));
  return true;
}

/// |x - before| over |scale|; overwrites `before`.
double relative_change(Vec x, Vec before, Vec scale)
{
  check(VecAXPY(before, -1, x));
  const double change = norm_of(before, NORM_2);
  return change == 0 ? 0 : change / norm_of(scale, NORM_2);
}

} // namespace

void solve_with_gyroscopic_part(const ThetaStep& step, Mat G, const SteppedMotions& motions,
                                const std::function<void()>& solve)
{
  const auto& [v, v_next, Av] = motions;
  std::vector<Owned<Vec>> right, v_theta, Gv, Gv_before;
  for (std::size_t k = 0; k < v.size(); ++k)
  {
    right.push_back(copy_of(Av[k]));
    v_theta.push_back(copy_of(v[k]));
    Gv.push_back(zeros_like(v[k]));
    Gv_before.push_back(zeros_like(v[k]));
  }
  const auto multiply = [&]
  { product(G, std::vector<Vec>(v_theta.begin(), v_theta.end()), std::vector<Vec>(Gv.begin(), Gv.end())); };
  multiply();
  double change = HUGE_VAL, before = HUGE_VAL;
  for (int count = 0; needs_another_pass(change, before, count, step.h); ++count)
  {
    for (std::size_t k = 0; k < v.size(); ++k) check(VecWAXPY(Av[k], -step.h, Gv[k], right[k]));
    solve();
    std::swap(Gv, Gv_before);
    for (std::size_t k = 0; k < v.size(); ++k)
      check(VecAXPBYPCZ(v_theta[k], step.theta, 1 - step.theta, 0, v_next[k], v[k]));
    multiply();
    before = std::exchange(change, 0);
    for (std::size_t k = 0; k < v.size(); ++k)
      change = std::max(change, step.h * relative_change(Gv[k], Gv_before[k], Av[k]));
  }
}

Owned<Mat> step_matrix(const Structure& structure, double h, double theta)
{
  Owned<Mat> A = copy_of(structure.M);
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
  step.contact = options.contact;
  step.factor = factor_held(step_matrix(structure, h, theta), interface, structure.names, options.factor);
  step.factor_seconds = MPI_Wtime() - start;
  std::vector<double> added = compliance_of_rows(interface); // to the diagonal of W
  for (double& c : added) c = compliant_gap(c, theta, h).by_reaction;
  if (interface.pairs > 0)
    step.W = make_contact_operator(step.factor, h, added, interface.pairs, interface.directions, comm_of(interface.B));
  step.matrices = pair_matrices(structure.M, structure.K);
  step.condensed_seconds = MPI_Wtime() - start - step.factor_seconds;
  return_freed_memory(); // fronts of the factor, and what W was added up from
  return step;
}

void multiply_mass_and_stiffness(const ThetaStep& step, const Structure& structure,
                                 const std::array<std::span<const Vec>, 2>& of,
                                 const std::array<std::span<const Vec>, 2>& to)
{
  if (step.matrices && of[0].size() == 1)
    return multiply_both(*step.matrices, {of[0][0], of[1][0]}, {to[0][0], to[1][0]});
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
  work.energy = (dot(state.v, work.Mv) + dot(state.u, work.Ku)) / 2;
  state.reactions.resize(interface.size(), 0);
  if (!has_elastic_slip(interface))
    state.slip.clear();
  else if (state.slip.empty())
    state.slip = slip_positions(interface, state.u, state.reactions);
  else if (state.slip.size() != interface.size())
    throw Error(format("the state has %zu slip positions, contact %zu rows: it was written by another scene",
                       state.slip.size(), interface.size()));
  return work;
}

StepFactors step_factors(const Ramps& ramps, const ThetaStep& step, double time)
{
  const double end = time + step.h, inside = time + step.theta * step.h;
  StepFactors factors;
  factors.load = step.theta * factor_at(ramps.load, end) + (1 - step.theta) * factor_at(ramps.load, time);
  factors.drive_start = factor_at(ramps.speed, time);
  factors.drive_end = factor_at(ramps.speed, end);
  factors.friction_before = factor_at(ramps.friction, inside - step.h);
  factors.friction = factor_at(ramps.friction, inside);
  return factors;
}

StepReport advance(const ThetaStep& step, const Structure& structure, const Interface& interface, StepWork& work,
                   State& state, const StepFactors& factors)
{
  StepReport report;
  const OneStep one{step, interface, factors, work, state, report};
  load_free_step(step, structure, factors.load, work);
  if (structure.G.get())
  {
    // contact is solved in each pass from where the step began
    const auto begun = std::pair{state.reactions, work.memory};
    solve_with_gyroscopic_part(step, structure.G, {{state.v}, {work.v_next}, {work.Av_next}},
                               [&]
                               {
                                 std::tie(state.reactions, work.memory) = begun;
                                 solve_step(one);
                               });
  }
  else
    solve_step(one);
  check(VecAXPY(state.u, step.h, work.v_theta));
  const Vec next = work.v_next, u = state.u, Mv = work.Mv_next, Ku = work.Ku_next;
  multiply_mass_and_stiffness(step, structure, {std::span(&next, 1), {&u, 1}}, {std::span(&Mv, 1), {&Ku, 1}});
  account(one, structure);
  const PairFriction friction = scaled(interface, factors.friction);
  std::vector<double> velocity;
  if (depends_on_speed(friction)) velocity = relative(interface, work.v_next);
  const std::vector<ContactStatus> statuses =
      status_with(interface, friction, factors.drive_end, state.reactions, std::move(velocity));
  for (const ContactStatus status : statuses)
    ++(status == ContactStatus::open ? report.open : status == ContactStatus::stick ? report.stick : report.slip);
  move_slip(one, statuses);
  check(VecCopy(work.v_next, state.v));
  std::swap(work.Mv, work.Mv_next);
  std::swap(work.Av, work.Av_next);
  std::swap(work.Ku, work.Ku_next);
  work.energy = report.energy;
  state.time += step.h;
  return report;
}

StepWork take_steps(const ThetaStep& step, const Structure& structure, const Interface& interface, State& state,
                    long steps, const StepWatch& watch)
{
  StepWork work = begin_steps(step, structure, interface, state);
  for (std::size_t i = 0; i < static_cast<std::size_t>(steps); ++i)
  {
    work.record = i < watch.records.size() ? &watch.records[i] : nullptr;
    const StepFactors factors = watch.factors ? watch.factors(state.time) : StepFactors{};
    const StepReport report = advance(step, structure, interface, work, state, factors);
    if (watch.goes_on && !watch.goes_on(report, work)) break;
  }
  work.record = nullptr;
  return work;
}

} // namespace squeal
