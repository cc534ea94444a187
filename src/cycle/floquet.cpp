#include "squeal/cycle/floquet.hpp"
#include "reduced_flow.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/free_memory.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <span>
#include <utility>

namespace squeal
{

namespace
{

// parts of a change on other steps that are taken for the error
constexpr double of_order_2 = 4. / 3, of_order_1 = 2;

/// The statuses that a pair had over recorded periods.
struct PairHistory
{
  bool opened = false, closed = false, stuck = false;
  bool turned = false; // slid otherwise than along the drive
  double reaction = 0; // [N] sum of r_n
};

std::vector<PairHistory> histories(const Interface& interface, std::span<const std::vector<StepRecord>> periods)
{
  std::vector<PairHistory> pairs(static_cast<std::size_t>(interface.pairs));
  const TangentView drive(interface.drive, interface.directions);
  for (const std::vector<StepRecord>& records : periods)
    for (const StepRecord& record : records)
    {
      const std::vector<ContactStatus> status = contact_status(interface, record.reactions, record.contact_velocity);
      const PairView r(record.reactions, interface.directions), w(record.contact_velocity, interface.directions);
      for (std::size_t i = 0; i < pairs.size(); ++i)
      {
        PairHistory& pair = pairs[i];
        (status[i] == ContactStatus::open ? pair.opened : pair.closed) = true;
        pair.stuck = pair.stuck || status[i] == ContactStatus::stick;
        pair.turned = pair.turned || (status[i] == ContactStatus::slip && dot(w.tangential(i), drive.of(i)) >= 0);
        pair.reaction += r.normal(i);
      }
    }
  return pairs;
}

/// Whether the pair came to rest or slid otherwise than it does at the equilibrium.
bool leaves_drive(const PairHistory& pair, bool undriven)
{
  return pair.turned || (pair.stuck && !undriven);
}

/// Pairs whose status changes are active, those that always slide, or stick without a drive, are eliminated.
PairRoles roles_of(const std::vector<PairHistory>& pairs, const Interface& interface, std::size_t steps)
{
  PairRoles roles{{}, std::vector<char>(pairs.size(), 0), std::vector<double>(interface.size(), 0.)};
  const PairView reactions(roles.reactions, interface.directions);
  for (std::size_t i = 0; i < pairs.size(); ++i)
  {
    reactions.normal(i) = pairs[i].reaction / static_cast<double>(steps);
    if (!pairs[i].closed) continue;
    if (pairs[i].opened || leaves_drive(pairs[i], is_undriven(interface, i)))
      roles.active.push_back(static_cast<int>(i));
    else
      roles.sliding[i] = 1;
  }
  return roles;
}

/// Whether the model's pairs may do what these did.
bool holds(const ReducedModel& model, const std::vector<PairHistory>& pairs, const Interface& interface)
{
  for (std::size_t i = 0; i < pairs.size(); ++i)
  {
    const PairHistory& pair = pairs[i];
    const bool changes = leaves_drive(pair, is_undriven(interface, i)),
               active = std::ranges::binary_search(model.active, static_cast<int>(i));
    const bool fits = active             ? model.directions > 0 || !changes
                      : model.sliding[i] ? !pair.opened && !changes
                                         : !pair.closed;
    if (!fits) return false;
  }
  return true;
}

/// The recorded periods of a cycle: its own, one on a grid moved by half a step, one of other steps, which may be
/// empty.
constexpr std::size_t at_own = 0, at_moved = 1, at_other = 2;
using RecordedPeriods = std::array<std::vector<StepRecord>, 3>;

/// Leaves the map with its own period recorded, which the shooting may have done already.
RecordedPeriods record_periods(PeriodMap& map, int other_steps, double period, Vec start)
{
  RecordedPeriods result;
  if (other_steps > 0)
  {
    PeriodMap other{map.sliding, map.options, other_steps, map.theta};
    other.reactions = map.reactions;
    record_period(other, period, start, {});
    result[at_other] = std::move(other.records);
  }
  record_period(map, period, start, {});
  result[at_own] = map.records;
  std::vector<StepRecord> own = std::exchange(map.records, {});
  record_period(map, period, start, {0.5});
  result[at_moved] = std::exchange(map.records, std::move(own));
  map.recorded_start = copy_of(start);
  map.recorded_step = map.step.h;
  return result;
}

/// Real modes where the band of the complex ones ends too near the cycle's frequency for its multipliers.
RealModes modes_beyond_band(const CycleProblem& problem)
{
  constexpr double near = 2, far = 3; // times the followed mode's frequency
  const double frequency = problem.unstable.modes.front().frequency_hz();
  if (highest_frequency(problem.modes) > near * frequency) return {};
  return real_modes_beyond(problem, far * frequency);
}

/// Why a model of so many shapes is not made; empty: it fits the free memory.
std::string lack_of_memory(const Structure& structure, Index shapes)
{
  const double needed = memory_of_reduction(entry_count(structure.load), static_cast<double>(shapes)),
               free = free_memory(comm_of(structure.load));
  if (needed <= free) return {};
  return format("a reduced model of %ld shapes takes %.3g GB, and %.3g GB are free: a larger machine would decide",
                static_cast<long>(shapes), 1e-9 * needed, 1e-9 * free);
}

} // namespace

std::shared_ptr<const ReducedModel>
recorded_model(const CycleProblem& problem, std::span<const std::vector<StepRecord>> periods, std::string& missing)
{
  const Interface& interface = problem.sliding.interface;
  const std::vector<PairHistory> pairs = histories(interface, periods);
  if (problem.reduced && holds(*problem.reduced, pairs, interface)) return problem.reduced;
  std::size_t steps = 0;
  for (const auto& records : periods) steps += records.size();
  const PairRoles roles = roles_of(pairs, interface, steps);
  const bool slide = std::ranges::none_of(roles.active,
                                          [&](int pair)
                                          {
                                            const PairHistory& history = pairs[static_cast<std::size_t>(pair)];
                                            return history.stuck || history.turned;
                                          });
  const std::size_t rows = PairRows<std::size_t>(interface.directions).rows_of(roles.active.size());
  const bool follow =
      slide && static_cast<int>(2 * rows) > attachments_on_recorded_contact; // friction the normal force
  const RealModes beyond = modes_beyond_band(problem);
  const std::size_t forces =
      std::min(follow ? roles.active.size() : rows, static_cast<std::size_t>(attachments_on_recorded_contact));
  missing = lack_of_memory(problem.sliding.structure,
                           static_cast<Index>(2 * problem.modes.size() + beyond.shapes.size() + forces));
  if (!missing.empty()) return nullptr;
  auto model =
      std::make_shared<ReducedModel>(reduce(problem.sliding, problem.modes, roles,
                                            {static_cast<int>(problem.modes.size()), 1e-5,
                                             attachments_on_recorded_contact, follow, &beyond, problem.step.factor}));
  return_freed_memory(); // of the factor that gave the attachments
  return model;
}

namespace
{

/// Sets the errors of the spectrum's moduli by the grid of time: what one moved by half a step changes, and one of
/// other steps.
void set_grid_errors(const ReducedSpectrum& spectrum, ReducedMap& map, const OtherSteps& other, double period,
                     const std::function<std::vector<StepRecord>(std::size_t)>& contacts, SlowMotions& slow)
{
  add_changes(multipliers_along(spectrum, map, period, contacts(at_moved)), 1, slow);
  if (other.steps == 0) return;
  ReducedMap finer{map.model, other.steps, map.theta, map.comm};
  add_changes(multipliers_along(spectrum, finer, period, contacts(at_other)), other.part, slow);
}

SlowMotions slow_motions_along(const CycleProblem& problem, PeriodMap& map, const OtherSteps& other, double period,
                               Vec start)
{
  const MPI_Comm comm = comm_of(problem.sliding.structure.load);
  const RecordedPeriods periods = record_periods(map, other.steps, period, start);
  SlowMotions none;
  none.periods = other.steps > 0 ? 3 : 2;
  const auto model = recorded_model(problem, periods, none.missing);
  if (!model) return none;
  const auto contacts = [&](std::size_t grid)
  { return recorded_contacts(*model, problem.sliding.interface.directions, periods[grid]); };
  ReducedMap own{*model, map.steps, map.theta, comm};
  const auto recorded = contacts(at_own);
  const ReducedSpectrum spectrum = large_multipliers(own, period, recorded);
  // no motion beside a cycle that shooting finds doubles in a period: shapes that do not fit friction do
  if (!spectrum.values.empty() && std::abs(spectrum.values.front()) > 2)
  {
    none.missing = "the reduced model on the recorded contact has motions that the full one lacks";
    return none;
  }
  const ReducedCoordinates coordinates{*model, problem.sliding.structure};
  SlowMotions slow = slow_motions_of(spectrum, *model, coordinates, start);
  slow.periods = none.periods;
  set_grid_errors(spectrum, own, other, period, contacts, slow);
  slow.without_known = taking_out_known(spectrum, coordinates);
  slow.correct = [model, correct = std::move(slow.correct)](Complex m, Vec real, Vec imaginary)
  { correct(m, real, imaginary); };
  return slow;
}

} // namespace

void add_slow_motions(const CycleProblem& problem, PeriodMap& map, const OtherSteps& other, Flow& flow)
{
  flow.slow_motions = [&problem, &map, other](double period, Vec start)
  { return slow_motions_along(problem, map, other, period, start); };
}

OtherSteps steps_to_compare(const Structure& structure, int steps)
{
  if (!is_dear(steps * work_of_step(structure))) return {2 * steps + 1, of_order_1};
  return steps <= enough_steps ? OtherSteps{2 * steps, of_order_2} : OtherSteps{};
}

int steps_of_verdict(const Structure& structure, int steps)
{
  return is_dear(steps * work_of_step(structure)) ? std::min(steps, enough_steps) : steps;
}

Verdict examine(const CycleProblem& problem, const CycleOptions& options, const LimitCycle& cycle)
{
  const int steps = cycle.steps_per_period, judged = steps_of_verdict(problem.sliding.structure, steps);
  PeriodMap map{problem.sliding, problem.step, judged, cycle.theta};
  map.reactions = problem.sliding.equilibrium.reactions;
  Flow flow = flow_of(map);
  const OtherSteps other =
      steps > judged ? OtherSteps{steps, of_order_2} : steps_to_compare(problem.sliding.structure, steps);
  add_slow_motions(problem, map, other, flow);
  const Orbit& orbit = cycle.orbit;
  const Preconditioner none;
  const OrbitProblem found = problem_of(flow, none, {problem.sliding.equilibrium.u, nullptr, nullptr, orbit.period},
                                        problem.settings.tolerance);
  Progress progress(comm_of(orbit.state), "cycle, verdict", 1);
  ConvergenceLog log{progress};
  return judge(found, options.shooting, log, orbit);
}

namespace
{

/// The correction and the function that applies P^-1 by it.
struct RecordedInverse
{
  std::shared_ptr<const ReducedModel> model; // whose coordinates these are
  MonodromyCorrection correction{};
  Preconditioner apply{}; // borrows both; empty: none
};

/// From the period that the map recorded last. Integrated once more, it gives the flow.
void make(CycleProblem& problem, PeriodMap& map, RecordedInverse& inverse)
{
  if (!map.recorded_start.get() || problem.modes.empty()) return;
  if (!(problem.modes.front().frequency_hz() > 0)) return; // a mode that only diverges is no scale of a basis
  const Owned<Vec> start = copy_of(map.recorded_start.get()), end = copy_of(start.get()), rate = zeros_like(start);
  const double period = map.steps * map.recorded_step;
  flow_of(map).integrate(period, start, end, rate);
  try
  {
    std::string missing;
    inverse.model = recorded_model(problem, std::span(&map.records, 1), missing);
    if (!inverse.model) return;
    const ReducedModel& model = *inverse.model;
    ReducedMap own{model, map.steps, map.theta, comm_of(problem.sliding.structure.load)};
    const auto contacts = recorded_contacts(model, problem.sliding.interface.directions, map.records);
    const ReducedState flow = coordinates(model, problem.sliding.structure, displacement(rate), velocity(rate));
    inverse.correction = monodromy_correction(model, monodromy(own, period, contacts), flow);
    inverse.apply = preconditioner_of(inverse.correction, {model, problem.sliding.structure});
    problem.reduced = inverse.model;
  }
  catch (const Error&) // on every rank alike: none can be made
  {
  }
}

} // namespace

RealModes real_modes_beyond(const CycleProblem& problem, double highest)
{
  constexpr double far = 0.9;
  const double end = highest_frequency(problem.modes);
  if (end >= far * highest) return {};
  return find_real_modes_between(problem.linearised, end, highest, problem.modes_options);
}

Preconditioner recorded_preconditioner(CycleProblem& problem, PeriodMap& map)
{
  return [&problem, &map, inverse = std::shared_ptr<RecordedInverse>()](double period, Vec x, Vec y) mutable
  {
    if (!inverse)
    {
      inverse = std::make_shared<RecordedInverse>();
      make(problem, map, *inverse);
    }
    apply(inverse->apply, period, x, y);
  };
}

} // namespace squeal
