#include "step_contact.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"
#include "squeal/contact/interface.hpp"

#include <algorithm>
#include <array>
#include <string>

namespace squeal
{

namespace
{

/// B ut and B v of a trajectory, and its slip positions.
struct StartOfStep
{
  const std::vector<double>&position, &velocity, &slip;
};

/// From B v_free of a trajectory: normal rows become gap rates (g0 + B_n ut)/h + B_n v_free, tangential ones sliding
/// velocities, rows with a compliance as in section 4.16. Empty where W is not.
std::vector<double> free_contact_velocity(const OneStep& one, const StartOfStep& start, std::vector<double> b)
{
  const auto& [step, interface, factors, work, state, report] = one;
  if (b.empty()) return b;
  const PairRows<std::size_t> rows(interface.directions);
  const PairView velocity(b, interface.directions);
  const TangentView drive(interface.drive, interface.directions);
  for (std::size_t i = 0; i < velocity.pairs(); ++i)
    for (std::size_t k = 0; k < drive.of(i).size(); ++k)
      velocity.tangential(i)[k] -= factors.drive_end * drive.of(i)[k];
  const std::vector<double> compliance = compliance_of_rows(interface);
  for (std::size_t row = 0; row < b.size(); ++row)
  {
    const bool normal = rows.is_normal(row);
    const double c = compliance.empty() ? 0 : compliance[row];
    if (c == 0 && !normal) continue;
    const double distance = start.position[row] + (normal ? interface.gap[rows.pair_of(row)] : -start.slip[row]);
    const CompliantGap law = compliant_gap(c, step.theta, step.h);
    b[row] += c == 0 ? distance / step.h
                     : law.by_gap * (distance - step.h * (1 - step.theta) * start.velocity[row]) +
                           law.by_rate * start.velocity[row];
  }
  return b;
}

/// Holds undriven pairs that stuck in the step before where they began to: sets the anchors of those that are new, and
/// drops the others. `position`: B ut.
void hold_anchors(const Interface& interface, const std::vector<double>& position,
                  const std::vector<ContactStatus>& before, StickAnchors& anchors)
{
  if (!has_undriven_pairs(interface)) return;
  anchors.at.resize(position.size());
  anchors.is_held.resize(before.size(), 0);
  const PairView<double> at(anchors.at, interface.directions);
  for (std::size_t i = 0; i < before.size(); ++i)
  {
    const bool sticks =
        is_undriven(interface, i) && before[i] == ContactStatus::stick && slip_compliance_of(interface, i) == 0;
    if (sticks && !anchors.is_held[i]) at.set(i, PairView(position, interface.directions).vector(i));
    anchors.is_held[i] = sticks;
  }
}

/// Adds (B_t ut - a)/h to the tangential rows of pairs that are held at a. Where W is not, b is empty.
void lead_back(const OneStep& one, const std::vector<double>& position, const StickAnchors& anchors,
               std::vector<double>& b)
{
  const int directions = one.interface.directions;
  const PairView<double> velocity(b, directions);
  for (std::size_t i = 0; i < std::min(velocity.pairs(), anchors.is_held.size()); ++i)
    for (std::size_t k = 0; anchors.is_held[i] && k < velocity.tangential(i).size(); ++k)
      velocity.tangential(i)[k] +=
          (PairView(position, directions).tangential(i)[k] - PairView(anchors.at, directions).tangential(i)[k]) /
          one.step.h;
}

/// The problem of a step: w = W r + free + past.
struct StepProblem
{
  std::vector<double> free; // where W is
  std::vector<double> past; // as interface.hpp says
  PairFriction friction;
};

StepProblem make_problem(const OneStep& one, const std::vector<double>& Bv_free)
{
  const auto& [step, interface, factors, work, state, report] = one;
  const PairFriction law_before = scaled(interface, factors.friction_before);
  std::vector<double> drive = interface.drive;
  for (double& velocity : drive) velocity *= factors.drive_start;
  check(VecWAXPY(work.v_theta, step.h * (1 - step.theta), state.v, state.u)); // ut, for a moment
  const std::vector<std::vector<double>> motion = relative(interface, std::array{work.v_theta.get(), state.v.get()});
  const std::vector<double>&position = motion[0], &velocity = motion[1];
  const auto& known = work.memory.r; // the last solutions
  std::span<const double> earlier;   // where the solutions go on from each other
  if (known.size() > 1 && known[0] == state.reactions) earlier = known[1];
  StepProblem problem{free_contact_velocity(one, {position, velocity, state.slip}, Bv_free),
                      {},
                      at_release(scaled(interface, factors.friction), PairView(state.reactions, interface.directions),
                                 PairView(earlier, interface.directions))};
  std::vector<ContactStatus> before =
      status_with(interface, law_before, factors.drive_start, state.reactions, velocity);
  hold_anchors(interface, position, before, work.anchors);
  lead_back(one, position, work.anchors, problem.free);
  for (std::size_t i = 0; i < before.size(); ++i) // slip positions have no velocity of the step's start
    if (slip_compliance_of(interface, i) > 0) before[i] = ContactStatus::stick;
  problem.past =
      past_sliding(PairView(velocity, interface.directions), TangentView<const double>(drive, interface.directions),
                   before, (1 - step.theta) / step.theta);
  return problem;
}

std::vector<double> sum(const std::vector<double>& a, const std::vector<double>& b)
{
  std::vector<double> result = a;
  for (std::size_t i = 0; i < result.size(); ++i) result[i] += b[i];
  return result;
}

/// The largest |mu'| r_n W_t of a pair, with the steepest fall of mu and the pair's own tangential compliance.
double fall_at_pairs(const ContactOperator& W, const PairFriction& friction, const std::vector<double>& reactions)
{
  double largest = 0;
  for (std::size_t i = 0; depends_on_speed(friction) && i < W.pairs(); ++i)
    largest = std::max(largest, steepest_fall(friction.of(i)) * PairView(reactions, W.directions()).normal(i) /
                                    W.scale(i).tangential);
  return largest;
}

/// Solves the problem; returns whether it is to be solved again, with less past sliding.
bool solve_once(const OneStep& one, const ContactSettings& settings, StepProblem& problem)
{
  const auto& [step, interface, factors, work, state, report] = one;
  const std::vector<double> b = sum(problem.free, problem.past);
  const PairFriction law =
      law_of_step(sliding_on(problem.friction, PairView<const double>(problem.past, interface.directions)), step.theta);
  const ContactResult result = solve_contact(step.W, law, settings, {b, state.reactions, work.memory});
  report.contact_iterations += result.iterations;
  report.contact_residual = result.residual;
  report.contact_converged = result.converged;
  report.fall_of_friction = fall_at_pairs(step.W, law, state.reactions);
  const std::vector<double> w = sum(work.memory.Wr.front(), b);
  if (work.record) work.record->contact_velocity = w;
  return leave_out_where_turned(PairView<const double>(state.reactions, interface.directions),
                                PairView(w, interface.directions), PairView(problem.past, interface.directions));
}

/// Gives every rank what rank 0 found, in one message: latency counts on small models. Collective.
/// Error on every rank: `problem`, unless it is empty.
void share_from_rank_zero(const OneStep& one, const std::string& problem)
{
  const MPI_Comm comm = comm_of(one.interface.B);
  StepReport& report = one.report;
  std::vector<double> message{problem.empty() ? 0. : 1., static_cast<double>(report.contact_iterations),
                              report.contact_residual, report.contact_converged ? 1. : 0., report.fall_of_friction};
  const auto head = static_cast<std::ptrdiff_t>(message.size());
  message.insert(message.end(), one.state.reactions.begin(), one.state.reactions.end());
  MPI_Bcast(message.data(), to_int(message.size()), MPI_DOUBLE, 0, comm);
  if (message[0] != 0) agree(comm, problem);
  report.contact_iterations = static_cast<int>(message[1]);
  report.contact_residual = message[2];
  report.contact_converged = message[3] != 0;
  report.fall_of_friction = message[4];
  one.state.reactions.assign(message.begin() + head, message.end());
}

/// Records the contact just solved for the tangent, on every rank; `past` is rank 0's. Collective.
void record_contact(const Interface& interface, const State& state, const std::vector<double>& past, StepRecord& record)
{
  const MPI_Comm comm = comm_of(interface.B);
  record.reactions = state.reactions;
  record.contact_velocity.resize(interface.size());
  record.opposes_theta.clear();
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
    record.opposes_theta.push_back(opposes_end(PairView(past, interface.directions), i) ? 0 : 1);
  MPI_Bcast(record.contact_velocity.data(), to_int(interface.size()), MPI_DOUBLE, 0, comm);
  MPI_Bcast(record.opposes_theta.data(), interface.pairs, MPI_CHAR, 0, comm);
}

/// Solves the problem, again where pairs turned. Joints take many sweeps: a first solution of low accuracy tells which
/// of their pairs do.
void solve_again(const OneStep& one, StepProblem& problem)
{
  ContactMemory& memory = one.work.memory;
  ContactSettings loose = one.step.contact;
  loose.tolerance = std::max(loose.tolerance, 1e-4);
  bool solved = has_undriven_pairs(one.interface);
  if (solved) solve_once(one, loose, problem);
  for (bool again = true; again; solved = true)
  {
    again = solve_once(one, one.step.contact, problem);
    if (!solved) continue;
    // the solution before is none of the past
    memory.r.erase(memory.r.begin() + 1);
    memory.Wr.erase(memory.Wr.begin() + 1);
  }
}

/// Solves contact on rank 0, or on the ranks that share W. Returns the text of an error.
std::string solve(const OneStep& one, StepProblem& problem)
{
  if (one.step.W.shared_by() == MPI_COMM_NULL && rank_of(comm_of(one.interface.B)) != 0) return {};
  try
  {
    solve_again(one, problem);
  }
  catch (const std::exception& error)
  {
    return error.what();
  }
  return {};
}

} // namespace

PairFriction scaled(const Interface& interface, double factor)
{
  if (factor == 1) return interface.friction;
  const auto scale = [factor](FrictionLaw& law) { law.coefficient *= factor, law.static_coefficient *= factor; };
  return changed(interface.friction, interface.gap.size(), scale,
                 [&](std::size_t pair) { return !is_undriven(interface, pair); });
}

std::vector<ContactStatus> status_with(const Interface& interface, const PairFriction& friction, double drive,
                                       const std::vector<double>& reactions, std::vector<double> velocity)
{
  if (depends_on_speed(friction))
  {
    const PairView<double> w(velocity, interface.directions);
    const TangentView v_d(interface.drive, interface.directions);
    for (std::size_t i = 0; i < w.pairs(); ++i)
      for (std::size_t k = 0; k < v_d.of(i).size(); ++k) w.tangential(i)[k] -= drive * v_d.of(i)[k];
  }
  return contact_status(PairView(reactions, interface.directions), PairView(velocity, interface.directions), friction);
}

void find_reactions(const OneStep& one, std::vector<double> Bv_free)
{
  if (const MPI_Comm sharing = one.step.W.shared_by(); sharing != MPI_COMM_NULL) broadcast(Bv_free, sharing);
  StepProblem problem = make_problem(one, Bv_free);
  share_from_rank_zero(one, solve(one, problem));
  if (one.work.record) record_contact(one.interface, one.state, problem.past, *one.work.record);
}

} // namespace squeal
