#include "squeal/chain.hpp"

#include "squeal/algebra/multivector.hpp"
#include "squeal/attractors/reached.hpp"
#include "squeal/base/checkpoint.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/cycle/cycle_checkpoint.hpp"
#include "squeal/modes/modes_checkpoint.hpp"

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

bool starts_without_a_mode(const TransientSettings& settings)
{
  return settings.start.kind != StartKind::mode && settings.start.kind != StartKind::estimate;
}

/// The state that the cycle's search starts from, where it is none of the modes'.
const State* given_start(const Chain& chain)
{
  if (chain.carried) return &chain.carried->state;
  if (chain.cycle_file) return &*chain.cycle_file;
  if (chain.scene.cycle.start.kind == CycleStartKind::transient) return &chain.report.transient.end;
  return chain.paced ? &chain.paced->start : nullptr;
}

std::string no_mode_among(const Report& report, std::span<const ComplexMode> modes)
{
  if (report.equilibrium.outcome.kind != OutcomeKind::converged) return "there is no equilibrium to start from";
  if (report.modes.modes.empty()) return "no mode was found in the band";
  if (modes.empty()) return "the equilibrium is stable: no mode grows in the band";
  return {};
}

/// Unstable modes that oscillate come first.
bool only_diverges(std::span<const ComplexMode> unstable)
{
  return !unstable.empty() && unstable.front().lambda.real() > 0 && unstable.front().frequency_hz() == 0;
}

std::string no_oscillation_among(const Report& report, std::span<const ComplexMode> modes)
{
  const std::string reason = no_mode_among(report, modes);
  return reason.empty() && only_diverges(modes) ? "the equilibrium diverges without oscillating" : reason;
}

/// Paces the mode that diverges by its rate of growth, and starts beside the equilibrium.
void pace(Chain& chain)
{
  constexpr double part = 0.01; // of the equilibrium's own displacement, in the norm of its energy
  const ComplexMode& diverging = chain.report.modes.modes.front();
  const Equilibrium& equilibrium = chain.report.equilibrium;
  const Structure& structure = chain.model.structure;
  double amplitude =
      part * std::sqrt(potential_energy(structure, equilibrium.u) / potential_energy(structure, diverging.real));
  if (!std::isfinite(amplitude)) amplitude = part;
  chain.paced.emplace();
  PacedDivergence& paced = *chain.paced;
  paced.mode = {{0, diverging.growth_rate()},
                copy_of(diverging.real.get()),
                zeros_like(equilibrium.u),
                diverging.reactions,
                diverging.backward_error};
  paced.none.outcome = {OutcomeKind::skipped, "the mode grows without vibrating", 0, 0};
  paced.none.lift_off_amplitude = paced.none.reversal_amplitude = amplitude; // what grows from there is not at rest
  paced.start = mode_state(equilibrium, diverging, amplitude, 0);
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

/// Puts the mode that the given start has most of first, the place of the followed one. By the period of another one a
/// search may find several turns of a cycle for one, in steps as few as of one.
void follow_start(Chain& chain)
{
  const State& start = *given_start(chain);
  const Structure& structure = chain.model.structure;
  std::vector<ComplexMode>& modes = chain.report.modes.modes;
  const Owned<Vec> moved = copy_of(start.u.get()), momentum = zeros_like(start.v), force = zeros_like(start.v);
  check(VecAXPY(moved, -1, chain.report.equilibrium.u));
  check(MatMult(structure.M, start.v, momentum));
  check(MatMult(structure.K, moved, force));
  std::vector<double> energies;
  for (const ComplexMode& mode : modes)
    energies.push_back(mode.frequency_hz() > 0 ? energy_along(mode, structure, momentum, force) : 0);
  const auto most = std::ranges::max_element(energies) - energies.begin(); // the first of equal ones
  if (most == 0) return;
  std::rotate(modes.begin(), modes.begin() + most, modes.begin() + most + 1);
  chain.report.estimates = run_estimates(chain);
}

/// Why the search for the cycle cannot run; empty if it can.
std::string no_cycle_start(const Chain& chain)
{
  const std::string reason = no_mode_among(chain.report, followed_modes(chain.report, chain.scene));
  if (reason.empty() && chain.coarse && !chain.carried)
    return "no cycle to start from was found on the coarse mesh: take a finer one, or start = \"estimate\"";
  if (!reason.empty() || chain.scene.cycle.start.kind != CycleStartKind::transient) return reason;
  const bool ended = chain.report.transient.outcome.kind == OutcomeKind::completed;
  return ended ? "" : "the transient that it starts from the end of was not completed";
}

CycleProblem cycle_problem(const Chain& chain)
{
  return {chain.sliding(),
          *chain.linearised,
          chain.report.modes.modes,
          chain.unstable(),
          chain.scene.cycle,
          chain.options.step,
          chain.options.modes,
          chain.model.probes,
          given_start(chain),
          chain.carried ? chain.carried->period : 0,
          chain.carried ? chain.carried->rounds : 1,
          chain.resumed ? &*chain.resumed : nullptr};
}

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

/// Whether the search for a cycle ended without one that attracts, on a free motion that goes on: beside an equilibrium
/// that is unstable it grows again from however little is left.
bool motion_goes_on(const Report& report)
{
  const LimitCycle& cycle = report.cycle;
  return cycle.free.state.get() &&
         (cycle.outcome.kind != OutcomeKind::collapsed_to_equilibrium || report.modes.unstable_count > 0);
}

} // namespace

bool is_small(const Chain& chain)
{
  PetscInt dofs = 0;
  check(VecGetSize(chain.model.structure.load, &dofs));
  return dofs <= small_model;
}

bool follows_a_mode(const TransientSettings& settings)
{
  return settings.enabled && (!starts_without_a_mode(settings) || settings.steps == 0);
}

std::span<const ComplexMode> followed_modes(const Report& report, const Scene& scene)
{
  const CycleStartKind start = scene.cycle.start.kind;
  const bool given = scene.cycle.enabled && (start == CycleStartKind::file || start == CycleStartKind::transient);
  if (report.modes.unstable_count > 0 || !given || report.modes.modes.empty()) return report.modes.unstable();
  return std::span(report.modes.modes).first(1);
}

std::string no_unstable_mode(const Report& report)
{
  return no_oscillation_among(report, report.modes.unstable());
}

std::string no_mode_to_follow(const Report& report, const Scene& scene)
{
  return no_oscillation_among(report, followed_modes(report, scene));
}

Modes run_modes(Chain& chain)
{
  const Scene& scene = chain.scene;
  if (chain.report.equilibrium.outcome.kind != OutcomeKind::converged)
    return not_run<Modes>(OutcomeKind::skipped, "there is no equilibrium to linearise about");
  if (!scene.modes.enabled && !scene.cycle.enabled && !follows_a_mode(scene.transient))
    return not_run<Modes>(OutcomeKind::off, "the scene turns it off");
  chain.linearised = linearise(chain.sliding());
  if (auto kept = kept_modes(chain.model.structure)) return std::move(*kept);
  Modes modes = find_modes(chain.sliding(), *chain.linearised, scene.modes, chain.options.modes);
  if (checkpoint_is_worth_it(comm_of(chain.model.structure.load))) keep_modes(modes, chain.model.structure);
  return modes;
}

Response run_response(Chain& chain)
{
  const Scene& scene = chain.scene;
  if (!scene.response) return not_run<Response>(OutcomeKind::off, "the scene has no [response]");
  if (chain.report.equilibrium.outcome.kind != OutcomeKind::converged)
    return not_run<Response>(OutcomeKind::skipped, "there is no equilibrium to linearise about");
  if (!chain.linearised) chain.linearised = linearise(chain.sliding());
  std::vector<int> excitations;
  for (std::size_t i = 0; i < scene.probes.size(); ++i)
    if (scene.response->excitation.empty() || std::ranges::count(scene.response->excitation, scene.probes[i].name) > 0)
      excitations.push_back(static_cast<int>(i));
  return find_response({chain.model.structure, *chain.linearised, chain.report.modes.modes, chain.model.probes,
                        excitations, frequencies_of(*scene.response), chain.options.response,
                        chain.options.modes.pencil});
}

std::vector<Estimate> run_estimates(const Chain& chain)
{
  const Scene& scene = chain.scene;
  std::vector<Estimate> estimates;
  const std::string reason = no_mode_to_follow(chain.report, chain.scene);
  if (!scene.estimate.enabled && !scene.cycle.enabled && !follows_a_mode(scene.transient))
    estimates.push_back(not_run<Estimate>(OutcomeKind::off, "the scene turns it off"));
  else if (!reason.empty())
    estimates.push_back(not_run<Estimate>(OutcomeKind::skipped, reason));
  else if (chain.model.interface.pairs == 0)
    estimates.push_back(not_run<Estimate>(OutcomeKind::skipped, "there is no contact that would limit the growth"));
  else
    for (const ComplexMode& mode : followed_modes(chain.report, chain.scene))
      estimates.push_back(mode.frequency_hz() > 0
                              ? estimate_amplitude(chain.sliding(), *chain.linearised, mode)
                              : not_run<Estimate>(OutcomeKind::skipped, "the mode does not oscillate"));
  return estimates;
}

Trajectory run_transient(const Chain& chain)
{
  const TransientSettings& settings = chain.scene.transient;
  const std::string reason = no_mode_to_follow(chain.report, chain.scene);
  if (!settings.enabled) return not_run<Trajectory>(OutcomeKind::off, "the scene has no [transient], or turns it off");
  if (chain.report.equilibrium.outcome.kind != OutcomeKind::converged ||
      (!reason.empty() && !starts_without_a_mode(settings)))
    return not_run<Trajectory>(OutcomeKind::skipped, reason);
  const ComplexMode* followed = reason.empty() ? &chain.report.modes.modes.front() : nullptr;
  return integrate(chain.sliding(), followed, settings, chain.options.step,
                   transient_start(chain.sliding(), chain.unstable(), settings), chain.model.probes);
}

namespace
{

FittedCycle find_cycle(const Chain& chain)
{
  return find_fitted_cycle(cycle_problem(chain), {chain.scene.fidelity, chain.scene.accuracy, chain.begin_steps},
                           chain.options.cycle);
}

/// The cycle from the orbit that the run that is gone on with had reached. Nothing where there is none, or where it
/// leads to no cycle: the search then begins as in a run in one go.
std::optional<FittedCycle> resumed_cycle(Chain& chain)
{
  if (!std::exchange(chain.resumes, false)) return {};
  chain.resumed = kept_cycle(chain.model.structure);
  if (!chain.resumed) return {};
  if (rank_of(comm_of(chain.model.structure.load)) == 0) std::printf("  goes on from the checkpoint of the cycle\n");
  FittedCycle found = find_cycle(chain);
  chain.resumed.reset();
  if (found.cycle.outcome.kind == OutcomeKind::converged || found.cycle.cut_short) return found;
  return {};
}

} // namespace

FittedCycle run_cycle(Chain& chain)
{
  const Scene& scene = chain.scene;
  FittedCycle result;
  const std::string reason = no_cycle_start(chain);
  if (!scene.cycle.enabled)
    result.cycle = not_run<LimitCycle>(OutcomeKind::off, "the scene has no [cycle], or turns it off");
  else if (!reason.empty())
    result.cycle = not_run<LimitCycle>(OutcomeKind::skipped, reason);
  else
  {
    if (only_diverges(chain.unstable().modes)) pace(chain);
    if (chain.report.modes.unstable_count == 0) follow_start(chain);
    std::optional<FittedCycle> resumed = resumed_cycle(chain);
    result = resumed ? std::move(*resumed) : find_cycle(chain);
    const LimitCycle& cycle = result.cycle;
    const Structure& structure = chain.model.structure;
    if (cycle.outcome.kind == OutcomeKind::converged &&
        (cycle.cut_short || checkpoint_is_worth_it(comm_of(structure.load))))
      keep_cycle(structure, cycle.orbit.state, cycle.orbit.period);
  }
  return result;
}

bool settles_on_another_cycle(const Report& report)
{
  const SettledMotion& settled = report.settled;
  if (settled.outcome.kind != OutcomeKind::settled || settled.examined.verdict.kind != MotionKind::periodic)
    return false;
  constexpr double fewest = 8; // steps in a period
  const double period = period_of(settled.examined.base), step = settled.period / settled.steps_per_period;
  if (!std::isfinite(period) || period < fewest * step) return false; // rounding has lines, too
  const LimitCycle& cycle = report.cycle;
  const ReachedMotion found{
      ReachedKind::steady, {cycle.measured.mean_fluctuating_energy, 0}, {1 / cycle.orbit.period, 0}, {}};
  const ReachedMotion seen{ReachedKind::steady, settled.fluctuating_energy, {1 / period, 0}, {}};
  return !agree(found, seen);
}

FittedCycle run_cycle_from_settled(Chain& chain)
{
  const SettledMotion& settled = chain.report.settled;
  const double period = period_of(settled.examined.base);
  chain.carried = CarriedCycle{copy_of(settled.end), period, std::max(settled.examined.base.closes_after, 1)};
  if (chain.paced) chain.paced->mode.lambda = {0, two_pi / period};
  CycleSettings settings = chain.scene.cycle;
  if (settings.steps_per_period > 0) // the steps that it was seen at
    settings.steps_per_period =
        static_cast<int>(std::lround(period / settled.period * static_cast<double>(settled.steps_per_period)));
  const CycleProblem problem = cycle_problem(chain);
  FittedCycle found =
      find_fitted_cycle(with_settings(problem, settings),
                        {chain.scene.fidelity, chain.scene.accuracy, chain.begin_steps}, chain.options.cycle);
  found.cycle.convergence.periods +=
      chain.report.cycle.convergence.periods + static_cast<int>(settled.examined.periods());
  return found;
}

CoarseStart run_coarse(Chain& fine)
{
  const std::string reason = no_mode_to_follow(fine.report, fine.scene);
  if (!reason.empty()) return not_run<CoarseStart>(OutcomeKind::skipped, reason);
  Scene scene = fine.coarse->scene;
  const CycleSettings chosen = chosen_settings(cycle_problem(fine), {scene.fidelity});
  constexpr double tolerance = 1e-3; // the mesh's own error is larger
  scene.cycle.steps_per_period = chosen.steps_per_period;
  scene.cycle.tolerance = std::max(chosen.tolerance, tolerance);
  ProgramOptions options = fine.options;
  options.cycle.shooting.multipliers = 0;
  const Model& model = fine.coarse->model;
  Report report;
  Chain chain{scene, options, model, report, {}};
  const WithoutCheckpoints of_fine_mesh;
  report.equilibrium = find_equilibrium(model.structure, model.interface, options.equilibrium);
  if (report.equilibrium.outcome.kind == OutcomeKind::converged)
  {
    chain.linearised = linearise(chain.sliding());
    report.modes = find_modes(chain.sliding(), *chain.linearised, scene.modes, options.modes);
  }
  report.estimates = run_estimates(chain);
  const LimitCycle cycle = run_cycle(chain).cycle;
  CoarseStart start{cycle.outcome, model.dofs.size, model.interface.pairs};
  if (!has_run(cycle.outcome)) start.outcome.kind = OutcomeKind::not_converged;
  if (start.outcome.kind != OutcomeKind::converged) return start;
  start.period = cycle.orbit.period;
  start.mean_fluctuating_energy = cycle.measured.mean_fluctuating_energy;
  start.periods = cycle.convergence.periods;
  fine.carried = carried_cycle(
      *fine.coarse, {report.equilibrium, report.modes.modes.front(), cycle.measured.start, cycle.orbit.period},
      fine.report.equilibrium, fine.report.modes.modes.front());
  return start;
}

SettledMotion run_settled(const Chain& chain)
{
  const LimitCycle& cycle = chain.report.cycle;
  if (!has_run(cycle.outcome)) return not_run<SettledMotion>(OutcomeKind::off, "no cycle was sought");
  if (succeeded(cycle.outcome)) return not_run<SettledMotion>(OutcomeKind::skipped, "the cycle is the answer");
  if (!motion_goes_on(chain.report))
    return not_run<SettledMotion>(OutcomeKind::skipped, "there is no motion to go on from");
  return find_settled_motion(cycle_problem(chain), cycle, chain.options.settled);
}

bool steps_may_decide(const Chain& chain)
{
  const Scene& scene = chain.scene;
  const SettledMotion& settled = chain.report.settled;
  const bool open = scene.fidelity == CycleModel::automatic && scene.cycle.steps_per_period == 0;
  if (!open || chain.coarse || !has_run(settled.outcome) || !is_small(chain)) return false;
  const SettledBySteps now = by_steps(settled);
  if (const std::optional<SettledBySteps>& before = chain.by_fewer_steps)
    return before->kind != now.kind || !alike(before->energy, now.energy) || !alike(before->exponent, now.exponent);
  return now.kind == MotionKind::irregular || now.kind == MotionKind::undecided || depends_on_steps(settled);
}

bool take_finer_steps(Chain& chain)
{
  constexpr int finer = 4, finest = 1024;
  const SettledMotion& settled = chain.report.settled;
  if (finer * settled.steps_per_period > finest) return false;
  chain.by_fewer_steps = by_steps(settled);
  chain.begin_steps = finer * settled.steps_per_period;
  chain.carried.reset(); // of what the motion had settled on
  return true;
}

void take_cycle_as_answer(Report& report, FittedCycle found)
{
  if (found.cycle.cut_short) // whether it attracts is not known: the settled motion is
    report.cycle.cut_short = true;
  if (found.cycle.cut_short || found.cycle.outcome.kind != OutcomeKind::converged) return;
  report.cycle = std::move(found.cycle);
  report.fidelity = std::move(found.fidelity);
  report.settled = not_run<SettledMotion>(OutcomeKind::skipped, "it is the cycle, which is the answer");
}

} // namespace squeal
