#include "squeal/find_motion.hpp"

#include "squeal/algebra/multivector.hpp"
#include "squeal/attractors/attractors.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/cycle/limit_cycle.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <Eigen/QR>
#include <utility>

namespace squeal
{

namespace
{

/// The mode that diverges, where none oscillates, with a frequency that it does not have. A motion that has left the
/// equilibrium far behind is paced by it.
struct PacedDivergence
{
  ComplexMode mode; // its eigenvalue is imaginary
  Estimate none;    // of no amplitude
  State start;      // beside the equilibrium
};

/// The motion that had settled at fewer steps a period.
struct SettledBySteps
{
  MotionKind kind = MotionKind::undecided;
  MeanValue energy;   // [J] fluctuating
  MeanValue exponent; // a period, the largest
};

/// The search as far as it has come.
struct MotionSearch
{
  const SlidingPoint& point;
  const MotionStart& start;
  const Scene& scene;
  const ProgramOptions& options;
  StageRunner run; // which notes whether the run ended
  Motion found{};
  std::optional<Outcome> not_sought{};    // where there is no cycle to seek, why
  std::optional<PacedDivergence> paced{}; // where no unstable mode oscillates
  int begin_steps = first_steps;          // a period, where the scene leaves them open
  bool ended = false;                     // the run, within a stage of the search
  bool answered = false;                  // by the orbit of the checkpoint
  std::optional<GivenStart> resumed{};    // the orbit that the run that is gone on with had reached
  std::optional<GivenStart> settled_on{}; // what the motion settled on, at these steps
  std::optional<SettledBySteps> by_fewer_steps{};

  FidelityRequest request() const { return {scene.fidelity, scene.accuracy, begin_steps}; }
};

/// One way to find what vibrates.
struct Way
{
  const char* name;
  bool (*applies)(const MotionSearch& search);
  void (*run)(MotionSearch& search, const char* name); // leaves result and attempts in search.found
};

/// Why the search for the cycle cannot run; nothing if it can.
std::optional<Outcome> cycle_not_sought(const SlidingPoint& point, const MotionStart& start, const Scene& scene)
{
  if (const std::string off = why_off(Stage::cycle, point, scene); !off.empty()) return Outcome{OutcomeKind::off, off};
  std::string reason = no_mode_among(point, followed_modes(point, scene));
  if (reason.empty()) reason = start.missing;
  if (reason.empty()) return {};
  return Outcome{OutcomeKind::skipped, reason};
}

UnstableModes modes_sought(const MotionSearch& search)
{
  const SlidingPoint& point = search.point;
  const auto& [index, estimate] = search.found.followed;
  if (search.paced) return {std::span(&search.paced->mode, 1), std::span(&search.paced->none, 1)};
  if (estimate) return {std::span(point.modes.modes).subspan(index, 1), std::span(&*estimate, 1)};
  return {followed_modes(point, search.scene), point.estimates};
}

/// The start of the search for a cycle, the first that there is: the settled motion, the checkpoint's orbit, the
/// scene's state (a file or the transient's end), a state beside the equilibrium where modes only diverge. Else the
/// unstable modes at their estimates' amplitudes; nothing where contact limits none.
std::optional<GivenStart> cycle_start(const MotionSearch& search, const CycleSettings& settings)
{
  const auto copied = [](const GivenStart& known) {
    return GivenStart{copy_of(known.state), known.period, known.rounds, known.resumed};
  };
  if (search.settled_on) return copied(*search.settled_on);
  if (search.resumed) return copied(*search.resumed);
  if (search.start.given) return GivenStart{copy_of(*search.start.given)};
  if (search.paced) return GivenStart{copy_of(search.paced->start)};
  std::optional<State> state = state_on_modes(search.point.sliding(), modes_sought(search), settings);
  return state ? std::optional(GivenStart{std::move(*state)}) : std::nullopt;
}

CycleProblem cycle_problem(const MotionSearch& search, const CycleSettings& settings, const GivenStart* start)
{
  const SlidingPoint& point = search.point;
  return {point.sliding(),
          *point.linearised,
          point.modes.modes,
          modes_sought(search),
          settings,
          search.options.step,
          search.options.modes,
          point.model->probes,
          start};
}

/// Paces the mode that diverges by its rate of growth, and starts beside the equilibrium.
PacedDivergence paced_divergence(const SlidingPoint& point)
{
  constexpr double part = 0.01; // of the equilibrium's own displacement, in the norm of its energy
  const ComplexMode& diverging = point.modes.modes.front();
  const Equilibrium& equilibrium = point.equilibrium;
  const Structure& structure = point.model->structure;
  double amplitude =
      part * std::sqrt(potential_energy(structure, equilibrium.u) / potential_energy(structure, diverging.real));
  if (!std::isfinite(amplitude)) amplitude = part;
  PacedDivergence paced;
  paced.mode = {{0, diverging.growth_rate()},
                copy_of(diverging.real.get()),
                zeros_like(equilibrium.u),
                diverging.reactions,
                diverging.backward_error};
  paced.none.outcome = {OutcomeKind::skipped, "the mode grows without vibrating", 0, 0};
  paced.none.lift_off_amplitude = paced.none.reversal_amplitude = amplitude; // what grows from there is not at rest
  paced.start = mode_state(equilibrium, diverging, amplitude, 0);
  return paced;
}

/// Energy of the part of a motion that is along a mode. [J] `momentum`: M v, `force`: K (u - u0).
double energy_along(const ComplexMode& mode, const Structure& structure, Vec momentum, Vec force)
{
  const MultiVector shapes = columns_of(std::array{mode.real.get(), mode.imaginary.get()});
  double energy = 0;
  for (const auto& [matrix, image] : {std::pair{structure.M.get(), momentum}, {structure.K.get(), force}})
  {
    const Eigen::MatrixXd gram = inner_products(shapes, product(matrix, shapes));
    const Eigen::VectorXd along = inner_products(shapes, columns_of(std::array{image})).col(0);
    energy += along.dot(gram.completeOrthogonalDecomposition().solve(along)) / 2; // both parts may be parallel
  }
  return energy;
}

/// The mode that a start has most of. By the period of another one a search may find several turns of a cycle for one,
/// in steps as few as of one.
FollowedMode mode_of_start(const SlidingPoint& point, const State& start)
{
  const Structure& structure = point.model->structure;
  const Owned<Vec> moved = copy_of(start.u.get());
  check(VecAXPY(moved, -1, point.equilibrium.u));
  const Owned<Vec> momentum = product(structure.M, start.v), force = product(structure.K, moved);
  std::vector<double> energies;
  for (const ComplexMode& mode : point.modes.modes)
    energies.push_back(mode.frequency_hz() > 0 ? energy_along(mode, structure, momentum, force) : 0);
  const auto most = std::ranges::max_element(energies) - energies.begin(); // the first of equal ones
  const auto index = static_cast<std::size_t>(most);
  if (index == 0) return {};
  return {index, estimate_of(point, point.modes.modes[index])};
}

/// Finds the cycle, and notes each attempt.
FittedCycle find_noted(MotionSearch& search, const std::string& name, const CycleSettings& settings)
{
  const std::optional<GivenStart> start = cycle_start(search, settings);
  FittedCycle fitted = find_fitted_cycle(cycle_problem(search, settings, start ? &*start : nullptr), search.request(),
                                         search.options.cycle);
  const auto note = [&](const char* model, const Outcome& outcome) {
    search.found.attempts.push_back({name + model, fitted.fidelity.verdict_steps, outcome});
  };
  if (fitted.on_reduced) note(", reduced model", *fitted.on_reduced);
  note(fitted.fidelity.used == CycleModel::reduced ? ", reduced model" : ", full model", fitted.cycle.outcome);
  return fitted;
}

/// Seeks the cycle as a stage, and keeps it for a restart.
FittedCycle seek_cycle(MotionSearch& search, const char* name, const CycleSettings& settings)
{
  FittedCycle fitted;
  const LimitCycle& cycle = fitted.cycle;
  const auto work = [&]
  {
    fitted = find_noted(search, name, settings);
    const Structure& structure = search.point.model->structure;
    if (cycle.outcome.kind == OutcomeKind::converged &&
        (cycle.cut_short || checkpoint_is_worth_it(comm_of(structure.load))))
      keep_cycle(structure, cycle.orbit.state, cycle.orbit.period);
    return cycle.cut_short;
  };
  const std::string left_out = search.run(Stage::cycle, work);
  if (!left_out.empty()) fitted.cycle = not_run<LimitCycle>(OutcomeKind::skipped, left_out);
  return fitted;
}

/// Takes the cycle. One that was left out leaves what fewer steps had given.
void take(FittedCycle fitted, Motion& motion)
{
  if (has_run(motion.cycle.outcome) && !has_run(fitted.cycle.outcome)) return;
  motion.cycle = std::move(fitted.cycle);
  motion.fidelity = std::move(fitted.fidelity);
  motion.settled = {};
}

/// Goes on from the orbit that the run that is gone on with had reached. Where it leads to no cycle, the search begins
/// as in a run in one go.
void seek_from_checkpoint(MotionSearch& search, const char* name)
{
  if (rank_of(comm_of(search.point.model->structure.load)) == 0)
    std::printf("  goes on from the checkpoint of the cycle\n");
  FittedCycle fitted = seek_cycle(search, name, search.scene.cycle);
  search.resumed.reset();
  search.answered = fitted.cycle.outcome.kind == OutcomeKind::converged || fitted.cycle.cut_short;
  if (search.answered) take(std::move(fitted), search.found);
}

void seek_from_start(MotionSearch& search, const char* name)
{
  if (const std::optional<Outcome>& why = search.not_sought)
    search.found.cycle = not_run<LimitCycle>(why->kind, why->reason);
  else
    take(seek_cycle(search, name, search.scene.cycle), search.found);
}

/// Whether the search for a cycle ended without one that attracts, on a free motion that goes on. Beside an unstable
/// equilibrium it grows again from however little is left.
bool motion_goes_on(const LimitCycle& cycle, int unstable)
{
  return cycle.free.state.get() && (cycle.outcome.kind != OutcomeKind::collapsed_to_equilibrium || unstable > 0);
}

SettledMotion settled_motion(const MotionSearch& search)
{
  const LimitCycle& cycle = search.found.cycle;
  if (succeeded(cycle.outcome)) return not_run<SettledMotion>(OutcomeKind::skipped, "the cycle is the answer");
  if (!motion_goes_on(cycle, search.point.modes.unstable_count))
    return not_run<SettledMotion>(OutcomeKind::skipped, "there is no motion to go on from");
  return find_settled_motion(cycle_problem(search, search.scene.cycle, nullptr), cycle, search.options.settled);
}

/// Once the run is to end, there may be a settled motion that belongs to the cycle there.
bool may_settle(const MotionSearch& search)
{
  return !search.ended || !has_run(search.found.settled.outcome);
}

void seek_settled_motion(MotionSearch& search, const char* name)
{
  SettledMotion& settled = search.found.settled;
  const std::string off = has_run(search.found.cycle.outcome) ? "" : "no cycle was sought";
  settled = run_stage(search.run, Stage::settled, off, [&] { return settled_motion(search); });
  if (has_run(settled.outcome)) search.found.attempts.push_back({name, settled.steps_per_period, settled.outcome});
}

/// Whether the motion has settled on a cycle that is not the one found.
bool settles_on_another_cycle(const MotionSearch& search)
{
  const SettledMotion& settled = search.found.settled;
  const MotionKind kind = settled.examined.verdict.kind;
  const bool is_steady = settled.fluctuating_energy.error <= 0.005 * settled.fluctuating_energy.value;
  if (settled.outcome.kind != OutcomeKind::settled ||
      !(kind == MotionKind::periodic || (kind == MotionKind::undecided && is_steady)))
    return false;
  constexpr double fewest = 8; // steps in a period
  const double period = period_of(settled.examined.base), step = settled.examined.period / settled.steps_per_period;
  if (!std::isfinite(period) || period < fewest * step) return false; // rounding has lines, too
  const LimitCycle& cycle = search.found.cycle;
  const ReachedMotion found{
      ReachedKind::steady, {cycle.measured.mean_fluctuating_energy, 0}, {1 / cycle.orbit.period, 0}, {}};
  const ReachedMotion seen{ReachedKind::steady, settled.fluctuating_energy, {1 / period, 0}, {}};
  return !agree(found, seen);
}

/// Seeks the cycle from the end of the settled motion. One that has converged answers in its stead.
void seek_from_settled(MotionSearch& search, const char* name)
{
  Motion& motion = search.found;
  const SettledMotion& settled = motion.settled;
  const double period = period_of(settled.examined.base);
  search.settled_on = GivenStart{copy_of(settled.end), period, std::max(settled.examined.base.closes_after, 1)};
  if (search.paced) search.paced->mode.lambda = {0, two_pi / period};
  CycleSettings settings = search.scene.cycle;
  if (settings.steps_per_period > 0) // the steps that it was seen at
    settings.steps_per_period =
        static_cast<int>(std::lround(period / settled.examined.period * settled.steps_per_period));
  FittedCycle fitted = seek_cycle(search, name, settings);
  LimitCycle& cycle = fitted.cycle;
  if (cycle.cut_short) motion.cycle.cut_short = true; // whether it attracts is not known: the settled motion is
  const OutcomeKind kind = cycle.outcome.kind;
  if (kind == OutcomeKind::unstable_cycle || kind == OutcomeKind::not_periodic) // what has settled there is no cycle
    leave_to_finer_steps(motion.settled, cycle.outcome.reason);
  if (cycle.cut_short || kind != OutcomeKind::converged) return;
  cycle.convergence.periods += motion.cycle.convergence.periods + static_cast<int>(settled.examined.periods());
  take(std::move(fitted), motion);
  motion.settled = not_run<SettledMotion>(OutcomeKind::skipped, "it is the cycle, which is the answer");
}

/// The ways, in their order. Each decides whether it has the answer:
/// - A cycle: its verdict is that of `judge` (shooting/verdict.cpp), by its multipliers and motions beside it. One that
/// attracts has converged. One that repels is an unstable cycle, and the search goes on from its free motion.
/// - A settled motion: its kind is that of `judge_motion` (settled/motion.cpp), by exponents, spectrum and energies.
constexpr std::array ways = {
    Way{"cycle from the checkpoint", [](const MotionSearch& search) { return search.resumed.has_value(); },
        seek_from_checkpoint},
    Way{"cycle", [](const MotionSearch& search) { return !search.answered; }, seek_from_start},
    Way{"settled motion", may_settle, seek_settled_motion},
    Way{"cycle from the settled motion", settles_on_another_cycle, seek_from_settled},
};

constexpr int finer = 4; // times as many steps a period

SettledBySteps by_steps(const SettledMotion& settled)
{
  const std::vector<MeanValue>& exponents = settled.examined.exponents;
  return {settled.examined.verdict.kind, settled.fluctuating_energy,
          exponents.empty() ? MeanValue{} : exponents.front()};
}

bool alike(const MeanValue& a, const MeanValue& b)
{
  return std::abs(a.value - b.value) <= a.error + b.error;
}

/// Whether a cycle is known at its own steps alone, and whether motions settle there is not.
bool is_open(const Motion& motion)
{
  const Fidelity& fidelity = motion.fidelity;
  return succeeded(motion.cycle.outcome) && motion.cycle.multipliers.stability == Stability::undecided &&
         !(std::max(fidelity.step_frequency_error, fidelity.step_energy_error) <= fidelity.accuracy / 2);
}

constexpr int finest = 1024; // steps a period

/// Whether more steps a period may change the answer. They may where "auto" chooses them and a settled motion is
/// affordable. The search ends when a motion without a cycle does as it did at the steps before. The grid of time alone
/// can make a motion of impacts wander; it then diverges by the step, not by the period.
bool steps_may_decide(const MotionSearch& search)
{
  constexpr double of_settling = 512; // periods
  const Scene& scene = search.scene;
  const SettledMotion& settled = search.found.settled;
  const bool open = scene.fidelity == CycleModel::automatic && scene.cycle.steps_per_period == 0;
  const double of_period = finer * search.found.cycle.steps_per_period * work_of_step(search.point.model->structure);
  if (!open || of_settling * of_period > affordable_work) return false;
  if (!has_run(settled.outcome)) return is_open(search.found) && finer * search.found.cycle.steps_per_period <= finest;
  const SettledBySteps now = by_steps(settled);
  if (const std::optional<SettledBySteps>& before = search.by_fewer_steps)
    return before->kind != now.kind || !alike(before->energy, now.energy) || !alike(before->exponent, now.exponent);
  return now.kind != MotionKind::quasi_periodic || depends_on_steps(settled); // nor a cycle that shooting missed
}

/// Notes what the motion settled on, and takes four times the steps a period; false where the search has ended. A kind
/// of the last two numbers of steps stands, and the change of the energy between them is its error.
bool takes_finer_steps(MotionSearch& search)
{
  SettledMotion& settled = search.found.settled;
  if (search.ended || !steps_may_decide(search)) return false;
  search.begin_steps = finer * search.found.cycle.steps_per_period;
  const SettledBySteps now = by_steps(settled), unknown{MotionKind::undecided, now.energy, {}},
                       before = std::exchange(search.by_fewer_steps, now).value_or(unknown);
  if (search.begin_steps <= finest) return true;
  settled.step_error = std::max(settled.step_error, std::abs(now.energy.value - before.energy.value));
  if (before.kind != now.kind) leave_to_finer_steps(settled);
  return false;
}

/// Tries each way that applies.
void try_in_order(MotionSearch& search)
{
  search.answered = false;
  search.settled_on.reset();
  for (const Way& way : ways)
    if (way.applies(search)) way.run(search, way.name);
}

/// Decides which mode is followed, and whether there is an orbit to go on from.
void begin(MotionSearch& search, const StageRunner& run)
{
  search.run = [&search, run](Stage which, const std::function<bool()>& work)
  {
    const std::string left_out = run(which, [&] { return search.ended = work(); });
    if (!left_out.empty()) search.ended = true;
    return left_out;
  };
  const SlidingPoint& point = search.point;
  search.not_sought = cycle_not_sought(point, search.start, search.scene);
  if (search.not_sought) return;
  if (only_diverges(followed_modes(point, search.scene))) search.paced = paced_divergence(point);
  if (point.modes.unstable_count == 0 && search.start.given)
    search.found.followed = mode_of_start(point, *search.start.given);
  search.resumed = kept_cycle(point.model->structure);
}

} // namespace

MotionStart motion_start(const SlidingPoint& point, const Scene& scene, const Trajectory& transient)
{
  const CycleStartKind kind = scene.cycle.start.kind;
  MotionStart start;
  if (!scene.cycle.enabled) return start;
  if (kind == CycleStartKind::file)
    start.given = read_state(scene.cycle.start.file, point.model->structure);
  else if (kind == CycleStartKind::transient && transient.outcome.kind == OutcomeKind::completed)
    start.given = copy_of(transient.end);
  else if (kind == CycleStartKind::transient)
    start.missing = "the transient that it starts from the end of was not completed";
  return start;
}

Motion find_motion(const SlidingPoint& point, const MotionStart& start, const Scene& scene,
                   const ProgramOptions& options, const StageRunner& run)
{
  MotionSearch search{point, start, scene, options, {}};
  begin(search, run);
  do try_in_order(search);
  while (takes_finer_steps(search));
  take_as_answer(search.found.settled, search.found.cycle.outcome);
  return std::move(search.found);
}

} // namespace squeal
