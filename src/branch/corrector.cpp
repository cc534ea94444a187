#include "corrector.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr int most_iterations = 12, most_secants = 120;
constexpr double good_reduction = 0.3; // of the residual by a step: a worse one calls for a new Jacobian

// The map of a period jumps where an event of contact meets the grid of time. An orbit there closes on neither side,
// and steps alternate between both. The same orbit begun a part of a step later has the event elsewhere.
constexpr double progress = 0.9; // of the least residual so far
constexpr int steps_without_progress = 4, most_moves = 3;
constexpr double moved_by = 0.3; // of a step of the grid: three moves try four places of the event in it

// Where none of them helps, the better side of the jump is taken, up to so many times the tolerance: its residual is
// reported.
constexpr double beside_jump = 10;

void keep(BranchCorrector& corrector, Secant secant)
{
  corrector.secants.push_front(std::move(secant));
  if (corrector.secants.size() > static_cast<std::size_t>(std::max<PetscInt>(corrector.options.secants, most_secants)))
    corrector.secants.pop_back();
}

/// The step whose preconditioned change is `wanted`, by exact columns along the period recorded last.
BorderedVector exact_step(BranchCorrector& corrector, const BorderedSystem& system, const Orbit& orbit,
                          BorderedVector wanted, double accuracy)
{
  BorderedVector step =
      step_by_columns(system, orbit, corrector.parameter_column, std::move(wanted), accuracy, corrector.secants);
  corrector.columns += static_cast<long>(corrector.secants.size());
  return step;
}

/// Records the period of the orbit, and forms the column of p there.
void form_jacobian(BranchCorrector& corrector, const Orbit& orbit)
{
  if (!corrector.parameter_column.get()) corrector.parameter_column = zeros_like(orbit.state);
  corrector.family.parameter_column(orbit.period, orbit.state, corrector.parameter_column);
  corrector.family.flow.record_period(orbit.period, orbit.state, {});
  if (corrector.family.renew_preconditioner) corrector.family.renew_preconditioner();
  corrector.log.convergence.periods += 2;
}

/// Whether an iterate may lead to an orbit of this branch.
bool makes_progress(const BranchCorrector& corrector, const Orbit& orbit, double first_residual)
{
  return std::isfinite(orbit.residual) && orbit.residual < 10 * std::max(first_residual, 1e-3) &&
         orbit.fluctuation < 4 * corrector.scales.fluctuation && orbit.fluctuation > corrector.scales.fluctuation / 20;
}

} // namespace

double scaled_product(const BranchCorrector& corrector, const BorderedVector& a, const BorderedVector& b)
{
  return squeal::scaled_product(corrector.family.flow, corrector.scales, a, b);
}

OrbitProblem problem_of(const BranchCorrector& corrector)
{
  return {corrector.family.flow, corrector.family.preconditioner, copy_of(corrector.rest.get()),
          corrector.period,      corrector.settings.tolerance,    0};
}

BorderedVector vector_of(const BranchPoint& point)
{
  return {copy_of(point.orbit.state.get()), point.orbit.period, point.parameter};
}

std::optional<BranchPoint> correct(BranchCorrector& corrector, const BorderedVector& predicted,
                                   const BorderedVector& normal)
{
  const OrbitProblem problem = problem_of(corrector);
  const auto evaluate_at = [&](const BorderedVector& z)
  {
    corrector.family.set_parameter(z.parameter);
    return evaluate(problem, corrector.log, z.state, z.period);
  };
  BorderedVector z = copy_of(predicted);
  Orbit orbit = evaluate_at(z);
  const double first_residual = orbit.residual;
  bool renew = corrector.secants.empty();
  int since_progress = 0, moves = 0, corrections = 0;
  double least = std::numeric_limits<double>::infinity();
  std::optional<BranchPoint> best;
  for (int iteration = 0; iteration <= most_iterations; ++iteration)
  {
    if (!makes_progress(corrector, orbit, first_residual)) break;
    record(corrector.log, ShootingStage::multisecant, orbit, 2 * dofs_of(orbit.state) + 1);
    if (orbit.residual <= problem.tolerance) return BranchPoint{std::move(orbit), z.parameter, corrections};
    if (!(best && best->orbit.residual <= orbit.residual)) best = BranchPoint{copy_of(orbit), z.parameter, corrections};
    since_progress = orbit.residual < progress * least ? 0 : since_progress + 1;
    least = std::min(least, orbit.residual);
    if (since_progress == steps_without_progress && corrector.settings.steps > 0)
    {
      if (moves == most_moves) break;
      check(VecAXPY(z.state, moved_by * z.period / corrector.settings.steps, orbit.rate));
      orbit = evaluate_at(z);
      since_progress = 0;
      least = std::numeric_limits<double>::infinity();
      renew = true;
      ++moves;
      iteration = -1; // as many again
      continue;
    }
    if (renew) form_jacobian(corrector, orbit);
    const BorderedSystem system = system_at(problem, corrector.scales, orbit, corrector.parameter_column, normal);
    const Owned<Vec> defect = preconditioned(problem, orbit.period, orbit.defect);
    BorderedVector wanted{copy_of(defect.get()), 0, 0};
    close_border(system, {0, 0}, wanted);
    scale(-1, wanted);
    BorderedVector step =
        renew ? exact_step(corrector, system, orbit, std::move(wanted), 0.03)
              : step_by_secants(system, corrector.secants, corrector.options.secant_drop, std::move(wanted));
    const double length = std::sqrt(scaled_product(corrector, step, step));
    if (length > corrector.options.clamp) scale(corrector.options.clamp / length, step);
    add(1, step, z);
    ++corrections;
    if (!admissible_period(problem, z.period)) break;
    Orbit next = evaluate_at(z);
    renew = next.residual > good_reduction * orbit.residual;
    Owned<Vec> change = preconditioned(problem, next.period, next.defect);
    check(VecAXPY(change, -1, defect));
    keep(corrector, {std::move(step), std::move(change)});
    orbit = std::move(next);
  }
  if (moves == most_moves && best && best->orbit.residual <= beside_jump * problem.tolerance) return best;
  return {};
}

BorderedVector tangent_at(BranchCorrector& corrector, const BranchPoint& point, const BorderedVector& about)
{
  const Orbit& orbit = point.orbit;
  corrector.family.set_parameter(point.parameter);
  form_jacobian(corrector, orbit);
  const OrbitProblem problem = problem_of(corrector);
  const BorderedSystem system = system_at(problem, corrector.scales, orbit, corrector.parameter_column, about);
  BorderedVector wanted{zeros_like(orbit.state), 0, 0};
  close_border(system, {0, 1}, wanted);
  BorderedVector tangent = exact_step(corrector, system, orbit, std::move(wanted), 1e-3);
  scale(1 / std::sqrt(scaled_product(corrector, tangent, tangent)), tangent);
  return tangent;
}

namespace
{

/// A count on an orbit; its change is an event.
using Count = std::function<int(const BranchPoint&)>;

/// How the event of a count is looked for.
struct Search
{
  BranchEventKind kind;
  Count count;
  Examined examined;
  int halvings; // of the interval between the points
};

/// Whether the event is about a multiplier.
bool is_of(BranchEventKind kind, std::complex<double> multiplier)
{
  if (kind == BranchEventKind::neimark_sacker) return multiplier.imag() > 0;
  return kind == BranchEventKind::period_doubling && multiplier.imag() == 0 && multiplier.real() < 0;
}

/// The values that count as the moduli of multipliers.
enum class Moduli
{
  least, // that the bars allow
  found,
  greatest,
};

/// The number of multipliers beyond the unit circle: of the event, or of all.
int beyond(std::optional<BranchEventKind> kind, const Multipliers& multipliers, Moduli moduli)
{
  int count = 0;
  for (std::size_t i = 0; i < multipliers.values.size(); ++i)
  {
    const double bar = moduli == Moduli::found ? 0 : multipliers.errors[i], size = std::abs(multipliers.values[i]);
    if (!kind || is_of(*kind, multipliers.values[i])) count += (moduli == Moduli::least ? size - bar : size + bar) > 1;
  }
  return count;
}

/// The modulus of the event's multiplier of that place, the largest first, and its bar; none: there are not as many.
std::optional<std::pair<double, double>> modulus_of(BranchEventKind kind, const Multipliers& multipliers, int place)
{
  for (std::size_t i = 0; i < multipliers.values.size(); ++i)
    if (is_of(kind, multipliers.values[i]) && place-- == 0)
      return std::pair{std::abs(multipliers.values[i]), multipliers.errors[i]};
  return {};
}

/// z on the straight line between two orbits.
BorderedVector between(const BorderedVector& from, const BorderedVector& to, double part)
{
  BorderedVector z = copy_of(from);
  scale(1 - part, z);
  add(part, to, z);
  return z;
}

std::optional<BranchPoint> correct_between(BranchCorrector& corrector, const BranchPoint& from, const BranchPoint& to,
                                           double part)
{
  const BorderedVector a = vector_of(from), b = vector_of(to);
  BorderedVector normal = copy_of(b);
  add(-1, a, normal);
  scale(1 / std::sqrt(scaled_product(corrector, normal, normal)), normal);
  return correct(corrector, between(a, b, part), normal);
}

BranchEvent event_at(BranchEventKind kind, const BranchPoint& orbit, double error)
{
  return {kind, orbit.parameter, error, orbit.orbit.period, orbit.measures.mean_fluctuating_energy, 0};
}

/// An event, and the multipliers at the ends of the interval that is left.
struct LocatedEvent
{
  BranchEvent event;
  Multipliers before, after;
};

/// Halves the interval between two orbits of different counts. The event is put to the end of higher energy of what is
/// left: there the orbit has what the event is about.
LocatedEvent locate(BranchCorrector& corrector, const Search& search, const BranchPoint& from, const BranchPoint& to)
{
  const int first = search.count(from);
  double low = 0, high = 1;
  double low_parameter = from.parameter, high_parameter = to.parameter;
  double period = to.orbit.period, energy = to.measures.mean_fluctuating_energy;
  Multipliers before = from.multipliers, after = to.multipliers;
  for (int i = 0; i < search.halvings; ++i)
  {
    const double middle = 0.5 * (low + high);
    std::optional<BranchPoint> point = correct_between(corrector, from, to, middle);
    if (!point) break;
    examine(corrector, *point, search.examined);
    const bool is_before = search.count(*point) == first;
    (is_before ? low : high) = middle;
    (is_before ? low_parameter : high_parameter) = point->parameter;
    (is_before ? before : after) = std::move(point->multipliers);
    period = point->orbit.period;
    energy = point->measures.mean_fluctuating_energy;
  }
  return {{search.kind, 0.5 * (low_parameter + high_parameter), 0.5 * std::abs(high_parameter - low_parameter), period,
           energy, search.count(to) - first},
          std::move(before),
          std::move(after)};
}

bool moves(const PointMeasures& measures)
{
  return measures.open_steps > 0;
}

std::vector<Search> searches(const BranchPoint& from, const BranchPoint& to)
{
  const auto lifts = [](const BranchPoint& orbit) { return moves(orbit.measures) ? 1 : 0; };
  const auto sticks = [](const BranchPoint& orbit) { return orbit.measures.stick_steps > 0 ? 1 : 0; };
  const auto opens = [](const BranchPoint& orbit) { return orbit.measures.lift_offs; };
  std::vector<Search> found = {
      {BranchEventKind::first_lift_off, lifts, Examined::measures_alone, 7},
      {BranchEventKind::first_stick, sticks, Examined::measures_alone, 5},
  };
  // the first opening is no grazing of an impacting motion
  if (moves(from.measures) && moves(to.measures))
    found.push_back({BranchEventKind::grazing, opens, Examined::measures_alone, 4});
  std::erase_if(found, [&](const Search& search) { return search.count(from) == search.count(to); });
  return found;
}

/// Where the parabola through (s, p) of three points turns.
double vertex(const std::array<double, 3>& s, const std::array<double, 3>& p)
{
  const double first = (p[1] - p[0]) / (s[1] - s[0]), second = (p[2] - p[1]) / (s[2] - s[1]);
  const double bend = (second - first) / (s[2] - s[0]);
  return 0.5 * (s[0] + s[1]) - first / (2 * bend);
}

double distance(const BranchCorrector& corrector, const BranchPoint& from, const BranchPoint& to)
{
  BorderedVector step = vector_of(to);
  add(-1, vector_of(from), step);
  return std::sqrt(scaled_product(corrector, step, step));
}

/// Whether contact does the same on both orbits, so that a parabola may hold between them.
bool alike(const BranchPoint& a, const BranchPoint& b)
{
  return moves(a.measures) == moves(b.measures) && (a.measures.stick_steps > 0) == (b.measures.stick_steps > 0);
}

/// The part of the parameter beyond the middle of three orbits where it may turn, with both sides bent towards the
/// turn. The line of each side is continued to the other one's end.
double rise_to_corner(const BranchCorrector& corrector, const std::array<const BranchPoint*, 3>& orbits)
{
  const double before = distance(corrector, *orbits[0], *orbits[1]),
               after = distance(corrector, *orbits[1], *orbits[2]);
  const double of_first = std::abs(orbits[1]->parameter - orbits[0]->parameter),
               of_second = std::abs(orbits[2]->parameter - orbits[1]->parameter);
  return std::max(of_first / before * after, of_second / after * before);
}

} // namespace

void examine(BranchCorrector& corrector, BranchPoint& point, Examined wanted)
{
  corrector.family.set_parameter(point.parameter);
  if (corrector.family.measure) point.measures = corrector.family.measure(point.orbit);
  if (wanted == Examined::measures_alone) return;
  point.multipliers = find_multipliers(problem_of(corrector), corrector.options, point.orbit).multipliers;
  corrector.columns += point.multipliers.periods;
}

std::vector<BranchEvent> events_between(BranchCorrector& corrector, const BranchPoint& from, const BranchPoint& to)
{
  std::vector<BranchEvent> events;
  for (const Search& search : searches(from, to)) events.push_back(locate(corrector, search, from, to).event);
  return events;
}

std::array<KnownBeyond, 2> known_beyond(const Multipliers& start)
{
  std::array<KnownBeyond, 2> known = {{{BranchEventKind::neimark_sacker}, {BranchEventKind::period_doubling}}};
  for (KnownBeyond& one : known) one.count = beyond(one.kind, start, Moduli::found);
  return known;
}

std::optional<BranchEvent> crossing_among(BranchCorrector& corrector, const std::vector<BranchPoint>& orbits,
                                          KnownBeyond& known)
{
  const BranchEventKind kind = known.kind;
  const std::size_t last = orbits.size() - 1;
  const int least = beyond(kind, orbits[last].multipliers, Moduli::least),
            most = beyond(kind, orbits[last].multipliers, Moduli::greatest);
  if (least <= known.count && known.count <= most)
  {
    if (least == most) known.place = last;
    return {};
  }
  const Count count = [kind](const BranchPoint& orbit) { return beyond(kind, orbit.multipliers, Moduli::found); };
  std::size_t before = last - 1; // the last of the orbits that are as is known, by the values
  while (before > known.place && count(orbits[before]) != known.count) --before;
  const Search search{kind, count, Examined::multipliers_too, 5};
  LocatedEvent located = locate(corrector, search, orbits[before], orbits[before + 1]);
  const std::size_t since = known.place;
  const int place = std::min(known.count, count(orbits[last]));
  located.event.change = count(orbits[last]) - known.count;
  known = {kind, known.count + located.event.change, last};
  if (beyond({}, located.before, Moduli::found) == beyond({}, located.after, Moduli::found)) return {};
  // what the bar leaves open, by the slope between the orbits that are certain
  const auto from = modulus_of(kind, orbits[since].multipliers, place),
             to = modulus_of(kind, orbits[last].multipliers, place), at = modulus_of(kind, located.after, place);
  const double distance = std::abs(orbits[last].parameter - orbits[since].parameter);
  if (from && to && at) located.event.error += at->second * distance / std::abs(to->first - from->first);
  return located.event;
}

std::optional<BranchEvent> fold_among(BranchCorrector& corrector, const std::array<const BranchPoint*, 3>& points)
{
  std::array<const BranchPoint*, 3> now = points; // the middle one is furthest: the fold is there or beyond
  const auto parameter = [&](std::size_t i) { return now[i]->parameter; };
  // where the branch stands upright the parameter turns by the tolerance alone
  const double least = 1e-6 * corrector.scales.parameter;
  if (std::min(std::abs(parameter(1) - parameter(0)), std::abs(parameter(2) - parameter(1))) < least) return {};
  if (!((parameter(1) - parameter(0)) * (parameter(2) - parameter(1)) < 0)) return {};
  const double outwards = parameter(1) > parameter(0) ? 1 : -1;
  std::array<BranchPoint, 4> found;
  double error = 0.5 * std::abs(parameter(2) - parameter(0));
  for (BranchPoint& orbit : found)
  {
    const double before = distance(corrector, *now[0], *now[1]), after = distance(corrector, *now[1], *now[2]);
    const double at = vertex({-before, 0, after}, {parameter(0), parameter(1), parameter(2)});
    const std::size_t side = at < 0 ? 0 : 1;
    const double part = std::clamp(at < 0 ? 1 + at / before : at / after, 0., 1.);
    std::optional<BranchPoint> point = correct_between(corrector, *now[side], *now[side + 1], part);
    if (!point) break;
    orbit = std::move(*point);
    examine(corrector, orbit, Examined::measures_alone);
    const double further = outwards * (orbit.parameter - parameter(1));
    error = std::abs(further);
    if (further > 0)
      now = side == 0 ? std::array{now[0], static_cast<const BranchPoint*>(&orbit), now[1]}
                      : std::array{now[1], static_cast<const BranchPoint*>(&orbit), now[2]};
    else
      now[2 * side] = &orbit;
    if (error < least) break;
  }
  if (!alike(*now[0], *now[1]) || !alike(*now[1], *now[2])) error = std::max(error, rise_to_corner(corrector, now));
  return event_at(BranchEventKind::fold, *now[1], error);
}

} // namespace squeal
