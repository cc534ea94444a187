/// One step of the modified theta-method (Charroyer, Chiello, Sinou 2017; header: the equations).
///
/// With M v and A v of the current state at hand, the explicit matrix needs no product of its own,
///     M - h(1-theta) C - h^2 theta(1-theta) K = [M - (1-theta) A]/theta,
/// and A v+ is the right-hand side just solved for: a step multiplies by M and K once each. The same vectors give the
/// energies and, from (A - M) v_theta = h theta C v_theta + theta^2 h (K u+ - K u), the damping work.
#include "squeal/analysis/transient.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

namespace squeal
{

namespace
{

/// What the options mean is said in the program's option table.
void read_options(ThetaStep& step)
{
  const std::array<const char*, 2> laws = {"displacement", "velocity"};
  const std::array<const char*, 2> solvers = {"gauss_seidel", "fixed_point"};
  PetscInt law = 0, solver = 0, max_it = step.contact.max_iterations;
  PetscBool extrapolate = step.extrapolate ? PETSC_TRUE : PETSC_FALSE;
  const char* prefix = "transient_";
  check(PetscOptionsGetEList(nullptr, prefix, "-contact_law", laws.data(), 2, &law, nullptr));
  check(PetscOptionsGetEList(nullptr, prefix, "-contact_solver", solvers.data(), 2, &solver, nullptr));
  check(PetscOptionsGetReal(nullptr, prefix, "-contact_tolerance", &step.contact.tolerance, nullptr));
  check(PetscOptionsGetInt(nullptr, prefix, "-contact_max_it", &max_it, nullptr));
  check(PetscOptionsGetReal(nullptr, prefix, "-contact_rho", &step.contact.rho, nullptr));
  check(PetscOptionsGetBool(nullptr, prefix, "-contact_extrapolate", &extrapolate, nullptr));
  if (!(step.contact.tolerance > 0)) throw Error("-transient_contact_tolerance must be above 0");
  if (max_it < 1) throw Error("-transient_contact_max_it must be at least 1");
  if (!(step.contact.rho >= 0 && step.contact.rho < 2))
    throw Error("-transient_contact_rho must be at least 0 and below 2: the fixed point contracts nowhere else");
  step.law = law == 0 ? ContactLaw::displacement : ContactLaw::velocity;
  step.contact.solver = solvers[static_cast<std::size_t>(solver)];
  step.contact.max_iterations = static_cast<int>(max_it);
  step.extrapolate = extrapolate == PETSC_TRUE;
}

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

/// Contact among the pairs whose b is finite; the others open.
ContactResult solve_active(const ThetaStep& step, const Interface& interface, const std::vector<double>& b,
                           std::vector<double>& r)
{
  const auto block = static_cast<std::size_t>(interface.block());
  std::vector<std::size_t> active;
  for (std::size_t i = 0; i < b.size(); ++i)
    if (std::isfinite(b[i - i % block])) active.push_back(i);
  const std::vector<double>& W = step.condensed.W;
  if (active.size() == b.size())
    return solve_contact(W, b, interface.pairs, interface.directions, interface.friction, step.contact, r);

  const std::size_t n = active.size();
  std::vector<double> W_active(n * n), b_active(n), r_active(n);
  for (std::size_t i = 0; i < n; ++i)
  {
    b_active[i] = b[active[i]];
    r_active[i] = r[active[i]];
    for (std::size_t j = 0; j < n; ++j) W_active[i * n + j] = W[active[i] * b.size() + active[j]];
  }
  const ContactResult result = solve_contact(W_active, b_active, static_cast<int>(n / block), interface.directions,
                                             interface.friction, step.contact, r_active);
  std::fill(r.begin(), r.end(), 0.);
  for (std::size_t i = 0; i < n; ++i) r[active[i]] = r_active[i];
  return result;
}

/// Solves contact on rank 0, where W is, and hands r to every rank.
ContactResult find_reactions(const ThetaStep& step, const Interface& interface, const std::vector<double>& b,
                             StepWork& work, std::vector<double>& r, MPI_Comm comm)
{
  std::vector<double> guess = r;
  if (step.extrapolate && work.r_before.size() == r.size())
    for (std::size_t i = 0; i < r.size(); ++i) guess[i] = 2 * r[i] - work.r_before[i];
  std::swap(work.r_before, r);
  r = std::move(guess);

  // One message: iterations, residual, converged, r. Latency counts on small models.
  ContactResult result;
  std::string problem;
  std::vector<double> told(r.size() + 3, -1);
  if (rank_of(comm) == 0)
  {
    try
    {
      result = solve_active(step, interface, b, r);
      told = {static_cast<double>(result.iterations), result.residual, result.converged ? 1. : 0.};
      told.insert(told.end(), r.begin(), r.end());
    }
    catch (const std::exception& error)
    {
      problem = error.what();
    }
  }
  MPI_Bcast(told.data(), static_cast<int>(told.size()), MPI_DOUBLE, 0, comm);
  if (told[0] < 0) agree(comm, problem);
  std::copy(told.begin() + 3, told.end(), r.begin());
  return {static_cast<int>(told[0]), told[1], told[2] > 0};
}

/// Works of the step from the products at both ends; reductions are gathered into one message.
void account(const ThetaStep& step, const Structure& structure, const State& state, StepWork& work, StepReport& report)
{
  const double h = step.h, theta = step.theta;
  double kinetic = 0, potential = 0, contact = 0, load = 0, damping = 0, dMd = 0, dKd = 0;
  check(VecDotBegin(work.v_next, work.Mv_next, &kinetic));
  check(VecDotBegin(state.u, work.Ku_next, &potential));
  check(VecDotBegin(work.v_theta, work.f, &contact));
  check(VecDotBegin(work.v_theta, structure.load, &load));

  // M v, A v and K u of the start are no longer needed once their part is taken
  Vec dv = work.dv, change = work.Ku, d = work.Mv;
  check(VecWAXPY(dv, -1, state.v, work.v_next));
  check(VecAYPX(change, -1, work.Ku_next)); // K du
  // theta h C v_theta = A v_theta - M v_theta - theta^2 h K du
  check(VecAXPBYPCZ(work.Av, theta, -theta, 1 - theta, work.Av_next, work.Mv_next));
  check(VecAXPY(work.Av, theta - 1, work.Mv));
  check(VecAXPY(work.Av, -theta * theta * step.h, change));
  check(VecAYPX(d, -1, work.Mv_next)); // M dv
  check(VecDotBegin(work.v_theta, work.Av, &damping));
  check(VecDotBegin(dv, d, &dMd));
  check(VecDotBegin(work.v_theta, change, &dKd));

  check(VecDotEnd(work.v_next, work.Mv_next, &kinetic));
  check(VecDotEnd(state.u, work.Ku_next, &potential));
  check(VecDotEnd(work.v_theta, work.f, &contact));
  check(VecDotEnd(work.v_theta, structure.load, &load));
  check(VecDotEnd(work.v_theta, work.Av, &damping));
  check(VecDotEnd(dv, d, &dMd));
  check(VecDotEnd(work.v_theta, change, &dKd));

  report.energy = (kinetic + potential) / 2;
  report.damping_work = damping / theta;
  report.contact_work = contact;
  report.load_work = h * load;
  report.energy_defect =
      report.energy - work.energy - (0.5 - theta) * (dMd + h * dKd) + report.damping_work - contact - report.load_work;
}

} // namespace

ThetaStep make_theta_step(const Structure& structure, const Interface& interface, double h, double theta)
{
  if (!(h > 0) || !std::isfinite(h)) throw Error("the time step must be above 0, not " + std::to_string(h) + " s");
  if (!(theta > 0 && theta <= 1)) throw Error("theta must be in (0, 1], not " + std::to_string(theta));
  const double start = MPI_Wtime();
  ThetaStep step;
  step.h = h;
  step.theta = theta;
  read_options(step);
  check(MatDuplicate(structure.M, MAT_COPY_VALUES, step.A.put()));
  check(MatAXPY(step.A, h * theta, structure.C, SAME_NONZERO_PATTERN));
  check(MatAXPY(step.A, h * h * theta * theta, structure.K, SAME_NONZERO_PATTERN));
  check(MatSetOption(step.A, MAT_SYMMETRIC, PETSC_TRUE));
  step.condensed = condense(step.A, interface, h, structure.names);
  step.seconds = MPI_Wtime() - start;
  return step;
}

StepWork begin_steps(const ThetaStep& step, const Structure& structure, const Interface& interface, State& state)
{
  StepWork work;
  for (Owned<Vec>* x : {&work.Mv, &work.Av, &work.Ku, &work.Mv_next, &work.Av_next, &work.Ku_next, &work.dv,
                        &work.v_next, &work.v_theta, &work.f})
    *x = zeros_like(structure.load);
  check(MatMult(structure.M, state.v, work.Mv));
  check(MatMult(step.A, state.v, work.Av));
  check(MatMult(structure.K, state.u, work.Ku));
  double kinetic = 0, potential = 0;
  check(VecDot(state.v, work.Mv, &kinetic));
  check(VecDot(state.u, work.Ku, &potential));
  work.energy = (kinetic + potential) / 2;
  state.reactions.resize(interface.size(), 0);
  return work;
}

StepReport advance(const ThetaStep& step, const Structure& structure, const Interface& interface, StepWork& work,
                   State& state)
{
  const double h = step.h, theta = step.theta;
  StepReport report;

  // A v_free = [M v - (1-theta) A v]/theta - h K u + h F
  check(VecCopy(work.Mv, work.Av_next));
  check(VecAXPBYPCZ(work.Av_next, (theta - 1) / theta, -h, 1 / theta, work.Av, work.Ku));
  check(VecAXPY(work.Av_next, h, structure.load));
  const Factor& factor = step.condensed.factor;
  std::vector<double> b = factor.forward(std::array<Vec, 1>{work.Av_next}), lambda; // B v_free

  check(VecSet(work.f, 0));
  if (interface.pairs > 0)
  {
    b = free_contact_velocity(step, interface, state, work, std::move(b));
    const MPI_Comm comm = PetscObjectComm(reinterpret_cast<PetscObject>(structure.load.get()));
    const ContactResult contact = find_reactions(step, interface, b, work, state.reactions, comm);
    report.contact_iterations = contact.iterations;
    report.contact_residual = contact.residual;
    report.contact_converged = contact.converged;
    add_reactions(interface, state.reactions, work.f);
    check(VecScale(work.f, h));
    lambda = state.reactions;
    for (double& value : lambda) value *= -h;
  }
  for (const ContactStatus status : contact_status(interface, state.reactions))
    ++(status == ContactStatus::open ? report.open : status == ContactStatus::stick ? report.stick : report.slip);
  factor.backward(lambda, std::array<Vec, 1>{work.v_next});
  check(VecAXPY(work.Av_next, 1, work.f));

  check(VecAXPBYPCZ(work.v_theta, theta, 1 - theta, 0, work.v_next, state.v));
  check(VecAXPY(state.u, h, work.v_theta));
  check(MatMult(structure.M, work.v_next, work.Mv_next));
  check(MatMult(structure.K, state.u, work.Ku_next));
  account(step, structure, state, work, report);

  check(VecCopy(work.v_next, state.v));
  std::swap(work.Mv, work.Mv_next);
  std::swap(work.Av, work.Av_next);
  std::swap(work.Ku, work.Ku_next);
  work.energy = report.energy;
  state.time += h;
  return report;
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
