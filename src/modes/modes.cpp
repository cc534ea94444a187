#include "squeal/modes/modes.hpp"
#include "squeal/base/checkpoint.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/equilibrium/state.hpp"
#include "squeal/modes/passes.hpp"
#include "squeal/modes/quadratic.hpp"
#include "squeal/modes/real_modes.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>

namespace squeal
{

namespace
{

constexpr double reach_of_count = 1.05;                 // over the band
constexpr int most_passes = 16;                         // of residual correction
constexpr double pair_tolerance = 1e-12, sharp = 1e-14; // backward errors of pairs, and of nearly critical ones
constexpr double loss_tolerance = 1e-13;                // the same with losses
constexpr double spurious_pair = 1e-8;                  // backward error of what is no pair
constexpr double guards_of_pairs = 0.3; // neighbours in a space, over its modes: most of what ends are corrected by
constexpr double residual_share = 1e-2; // a pass divides residuals by about ten: a quarter of them stay
constexpr double near_end = 0.98;       // of |lambda|: from there on pairs may leave

/// Number of eigenvalues of the symmetric problem below theta.
int inertia_below(const PairProblem& problem, double theta, const PencilOptions& options)
{
  return inertia_at(theta, problem.M_z, problem.K_z, options, elimination_order(problem.K_z)).below;
}

/// The pairs of a window by passes; without P, those on the span of the basis.
QuadraticSolution correct(const PairProblem& problem, Mat K_loss, MultiVector basis, const PencilFactor* P,
                          const Window& window)
{
  QuadraticSolution found = solve_on_subspace(problem.sliding, K_loss, std::move(basis), P,
                                              {.window = window,
                                               .passes = P ? most_passes : 0,
                                               .pairs = std::numeric_limits<std::size_t>::max(),
                                               .tolerance = K_loss ? loss_tolerance : pair_tolerance,
                                               .sharp = K_loss ? loss_tolerance : sharp,
                                               .share = residual_share});
  if (P) std::erase_if(found.pairs, [](const Eigenpair& pair) { return pair.backward_error > spurious_pair; });
  return found;
}

/// Adds the pairs of a window, from a basis near their vectors.
void add_pairs(const PairProblem& problem, MultiVector basis, const PencilFactor* P, const Window& window,
               PairSearch& search)
{
  QuadraticSolution found = correct(problem, nullptr, std::move(basis), P, window);
  for (const Eigenpair& pair : found.pairs) search.moduli.push_back(std::abs(pair.lambda));
  if (problem.K_loss)
  {
    basis = span_of(found.pairs, problem.K_z);
    const auto number = [&](const QuadraticSolution& solution)
    {
      return std::ranges::count_if(solution.pairs, [&](const Eigenpair& pair)
                                   { return std::norm(pair.lambda) < near_end * near_end * window.limit; });
    };
    const auto expected = number(correct(problem, problem.K_loss, basis, nullptr, window));
    found = correct(problem, problem.K_loss, std::move(basis), P, window);
    if (number(found) < expected)
    {
      found.outcome.kind = OutcomeKind::not_converged;
      found.outcome.reason = format("with loss factors %td modes were found of %td", number(found), expected);
    }
  }
  Outcome& outcome = search.solution.outcome;
  outcome.iterations += found.outcome.iterations;
  if (found.outcome.kind == OutcomeKind::not_converged) outcome = found.outcome;
  std::ranges::move(found.pairs, std::back_inserter(search.solution.pairs));
}

/// Takes real negative eigenvalues out of the pairs, which then are what grows or vibrates, and notes their moduli.
void set_decays_apart(PairSearch& search)
{
  const auto decays = [](const Eigenpair& pair) { return pair.lambda.imag() == 0 && pair.lambda.real() < 0; };
  for (const Eigenpair& pair : search.solution.pairs)
    (decays(pair) ? search.decays : search.moduli).push_back(decays(pair) ? pair.lambda.real() : std::abs(pair.lambda));
  std::erase_if(search.solution.pairs, decays);
}

/// All pairs of a small problem.
void search_whole(const PairProblem& problem, double floor, PairSearch& search)
{
  Window window{floor * floor, search.top * search.top, true};
  search.solution = solve_whole(problem.sliding, nullptr, window);
  set_decays_apart(search);
  window.has_decays = false;
  if (problem.K_loss) search.solution = solve_whole(problem.sliding, problem.K_loss, window);
}

/// All pairs slice by slice of |lambda|, of equal width, each from the undamped problem with friction about its middle.
/// That is unsymmetric, so that its spaces and its factor know friction. A space holds all theta that friction turns by
/// the usual angle.
void search_slices(const PairProblem& problem, double floor, const PencilOptions& options, PairSearch& search)
{
  constexpr int in_slice = 75;                // pairs
  constexpr double usual_angle = 0.06;        // [rad] by which friction turns theta
  constexpr double subspace_tolerance = 1e-9; // for a space to be invariant
  constexpr double rigid_share = 1e-6;        // theta below this part of the largest may be a free body's
  const double limit = search.top * search.top;
  const EliminationOrder order = elimination_order(problem.K_z);
  search.expected = inertia_at(limit, problem.M_z, problem.K_z, options, order).below;
  const int slices = std::max(1, (search.expected + in_slice - 1) / in_slice);
  Progress progress(comm_of(problem.K_z), "modes", search.top);
  ShiftInvert pencil = make_shift_invert(problem.sliding.K, problem.sliding.M, Keep::lu, options, &order);
  double smallest = HUGE_VAL;
  for (int k = 0; k < slices; ++k)
  {
    const double least = std::max(floor * floor, limit * std::pow(1. * k / slices, 2)),
                 end = limit * std::pow((k + 1.) / slices, 2);
    move_to(pencil, (least + end) / 2);
    const double radius = std::abs(std::polar(end, usual_angle) - pencil.shift);
    Nearest nearest = solve_nearest(pencil, search.expected / slices, radius, subspace_tolerance, guards_of_pairs);
    if (!nearest.converged) continue; // the count shows that pairs are missing
    for (const double theta : nearest.theta) smallest = std::min(smallest, std::abs(theta));
    add_pairs(problem, std::move(nearest.space), pencil.factor.get(), {least, end}, search);
    progress.update(std::sqrt(end), format("below %.4g Hz", std::sqrt(end) / two_pi));
  }
  pencil = {}; // before a count that needs a factor as well
  if (smallest < rigid_share * limit)
    search.expected -= inertia_at(floor * floor, problem.M_z, problem.K_z, options, order).below;
}

/// All pairs by SLEPc, corrected for losses.
void search_by_toar(const PairProblem& problem, double floor, const ModesOptions& options, PairSearch& search)
{
  const double shift = std::sqrt(-shift_below_zero(problem.M_z, problem.K_z));
  QuadraticSolution found =
      solve_quadratic(problem.sliding, {search.top / two_pi, shift / search.top,
                                        std::max(search.expected, static_cast<int>(search.omega.size()))});
  if (!problem.K_loss)
  {
    search.solution = std::move(found);
    set_decays_apart(search);
    return;
  }
  ShiftInvert pencil = make_shift_invert(problem.K_z, problem.M_z, Keep::factor, options.pencil);
  move_to(pencil, search.top * search.top / 2);
  add_pairs(problem, span_of(found.pairs, problem.K_z), pencil.factor.get(), {floor * floor, search.top * search.top},
            search);
}

} // namespace

PairSearch search_pairs(const PairProblem& problem, ModesMethod method, double band, const ModesOptions& options)
{
  const PetscInt n = row_count(problem.K_z);
  const double floor = std::sqrt(vibration_floor(norms_of(problem.sliding)));
  const bool by_slices = n > options.dense_limit && method != ModesMethod::toar && !problem.is_indefinite;
  PairSearch search{{{OutcomeKind::converged, "", 0, 0}}, two_pi * band * (by_slices ? reach_of_count : 1)};
  const auto find_real = [&]
  { search.omega = solve_real_modes_below(problem.M_z, problem.K_z, search.top / two_pi, options).omega; };
  if (by_slices)
  {
    search_slices(problem, floor, options.pencil, search);
    if (search.expected != std::ssize(search.moduli)) find_real(); // for a lower edge
  }
  else
  {
    if (!problem.is_indefinite)
      find_real();
    else if (n > options.dense_limit)
      search.expected = inertia_below(problem, search.top * search.top, options.pencil) -
                        inertia_below(problem, -search.top * search.top, options.pencil);
    n > options.dense_limit ? search_by_toar(problem, floor, options, search) : search_whole(problem, floor, search);
  }
  sort_and_measure(search.solution);
  return search;
}

ModeCount count_pairs(const PairSearch& search, double floor, double least)
{
  const auto& [solution, top, decays, unsorted, omega, counted] = search;
  std::vector<double> moduli = unsorted;
  std::ranges::sort(moduli, std::greater{});
  const auto number = [](const std::vector<double>& values, double from, double end) {
    return static_cast<int>(std::ranges::count_if(values, [&](double value) { return value >= from && value < end; }));
  };
  const auto below = [&](double edge)
  {
    const int expected = number(omega, floor, edge), found = number(moduli, 0, edge);
    return ModeCount{expected == found ? Certificate::inertia : Certificate::none, edge / two_pi, expected, found};
  };
  const auto all = static_cast<int>(moduli.size());
  if (omega.empty()) return {counted == all ? Certificate::inertia : Certificate::none, top / two_pi, counted, all};
  const ModeCount whole = below(top);
  if (whole.expected == whole.found) return whole;
  for (std::size_t k = 1; k < moduli.size() && moduli[k - 1] > least; ++k)
  {
    const double edge = std::max(least, (moduli[k - 1] + moduli[k]) / 2);
    if (edge >= top) continue;
    if (const ModeCount count = below(edge); count.certified_by != Certificate::none) return count;
  }
  return whole;
}

namespace
{

/// The entry of phi with the largest modulus. Of nearly equal ones it is the first, for any number of ranks.
std::complex<double> largest_component(Vec real, Vec imaginary)
{
  const PetscInt own_entries = own_range(real).size();
  const PetscScalar *re = nullptr, *im = nullptr;
  check(VecGetArrayRead(real, &re));
  check(VecGetArrayRead(imaginary, &im));
  MPI_Comm comm = comm_of(real);
  double largest = 0;
  for (PetscInt i = 0; i < own_entries; ++i) largest = std::max(largest, std::hypot(re[i], im[i]));
  MPI_Allreduce(MPI_IN_PLACE, &largest, 1, MPI_DOUBLE, MPI_MAX, comm);
  struct
  {
    double entry[2] = {0, 0};
    int rank = 0;
  } own;
  own.rank = ranks_of(comm);
  for (PetscInt i = own_entries - 1; i >= 0; --i)
    if (std::hypot(re[i], im[i]) >= largest * (1 - 1e-6)) own = {{re[i], im[i]}, rank_of(comm)};
  check(VecRestoreArrayRead(real, &re));
  check(VecRestoreArrayRead(imaginary, &im));
  int holder = 0;
  MPI_Allreduce(&own.rank, &holder, 1, MPI_INT, MPI_MIN, comm);
  MPI_Bcast(own.entry, 2, MPI_DOUBLE, holder, comm);
  return {own.entry[0], own.entry[1]};
}

/// Sets phi = Z y, turned and scaled so that its largest entry is 1.
void set_shape(ComplexMode& mode, const ClosedContact& contact, const Eigenpair& pair)
{
  mode.real = product(contact.Z, pair.real);
  mode.imaginary = product(contact.Z, pair.imaginary);
  const std::complex<double> turn = 1.0 / largest_component(mode.real, mode.imaginary);
  const Owned<Vec> real = copy_of(mode.real);
  check(VecAXPBY(mode.real, -turn.imag(), turn.real(), mode.imaginary));
  check(VecAXPBY(mode.imaginary, turn.imag(), turn.real(), real));
}

/// Adds to the reactions those to complex stiffness beyond C's equivalent of it, (i - lambda/omega) K_loss phi.
void add_loss_reactions(const Structure& structure, const ClosedContact& contact, ComplexMode& mode)
{
  const Complex factor = Complex(0, 1) - mode.lambda / structure.loss_omega;
  for (const auto& [part, turn] : {std::pair{mode.real.get(), factor}, {mode.imaginary.get(), Complex(0, 1) * factor}})
  {
    const std::vector<double> reactions = all_entries(product(contact.reaction, product(structure.K_loss, part)));
    for (std::size_t i = 0; i < reactions.size(); ++i) mode.reactions[i] += turn * reactions[i];
  }
}

/// The modes of pairs that come with the largest real part first.
std::vector<ComplexMode> modes_of(const QuadraticSolution& solution, const SlidingEquilibrium& sliding,
                                  const LinearisedSliding& linearised)
{
  const Structure& structure = sliding.structure;
  std::vector<ComplexMode> modes;
  for (const Eigenpair& pair : solution.pairs)
  {
    ComplexMode& mode = modes.emplace_back();
    mode.lambda = pair.lambda;
    mode.backward_error = pair.backward_error;
    set_shape(mode, linearised.contact, pair);
    mode.reactions = reactions_of(sliding, linearised, ReactionRows::normal, mode.lambda, mode.real, mode.imaginary);
    if (structure.K_loss.get() && mode.lambda.imag() > 0) add_loss_reactions(structure, linearised.contact, mode);
  }
  return modes;
}

/// The sentence that Modes::count_check holds.
std::string describe_count(const Modes& modes)
{
  std::string text = modes.count.certified_by != Certificate::none ? "confirmed: " : "NOT confirmed: ";
  text += format("%d pairs below %.6g Hz, ", modes.count.found, modes.count.frequency);
  if (modes.count.certified_by == Certificate::all_pairs) return text + "where the whole problem was solved";
  text += format("%d expected by the inertia of the ", modes.count.expected);
  if (!modes.beyond_inertia) return text + "frictionless structure";
  return text + "symmetric part, which cannot count what gyroscopic, circulatory or indefinite parts change";
}

/// Sets what follows from the modes: their order, the numbers of unstable ones, the residual and whether it converged.
void assess(Modes& modes)
{
  for (const ComplexMode& mode : modes.modes)
    modes.outcome.residual = std::max(modes.outcome.residual, mode.backward_error);
  std::stable_partition(modes.modes.begin(), modes.modes.end(),
                        [](const ComplexMode& mode) { return is_unstable(mode.lambda); });
  modes.unstable_count = static_cast<int>(
      std::ranges::count_if(modes.modes, [](const ComplexMode& mode) { return is_unstable(mode.lambda); }));
  std::stable_partition(modes.modes.begin(), modes.modes.begin() + modes.unstable_count,
                        [](const ComplexMode& mode) { return mode.frequency_hz() > 0; }); // the first one is followed
  modes.count_check = describe_count(modes);
  if (modes.outcome.residual <= 1e-8 || modes.outcome.kind != OutcomeKind::converged) return;
  modes.outcome.kind = OutcomeKind::not_converged;
  modes.outcome.reason = "a backward error exceeds 1e-8";
}

/// Keeps of the modes beyond the band, which were found for the count, the frequencies only.
void drop_beyond_band(Modes& modes)
{
  const auto beyond =
      std::stable_partition(modes.modes.begin(), modes.modes.end(),
                            [&](const ComplexMode& mode) { return std::abs(mode.lambda) < two_pi * modes.band; });
  for (auto mode = beyond; mode != modes.modes.end(); ++mode) modes.beyond_band.push_back(mode->frequency_hz());
  modes.modes.erase(beyond, modes.modes.end());
}

} // namespace

double frequency_hz_of(std::complex<double> lambda)
{
  return std::abs(lambda.imag()) / two_pi;
}

double damping_ratio_of(std::complex<double> lambda)
{
  return -lambda.real() / std::abs(lambda);
}

double ComplexMode::frequency_hz() const
{
  return frequency_hz_of(lambda);
}

double ComplexMode::damping_ratio() const
{
  return damping_ratio_of(lambda);
}

double instability_of(std::complex<double> lambda)
{
  return lambda.real() - 1e-8 * std::abs(lambda);
}

bool is_unstable(std::complex<double> lambda)
{
  return instability_of(lambda) > 0;
}

Modes find_modes(const SlidingEquilibrium& sliding, const LinearisedSliding& linearised, const ModesSettings& settings,
                 const ModesOptions& options)
{
  Modes modes;
  modes.method = settings.method;
  modes.band = settings.band;
  modes.shapes = options.shapes;
  modes.beyond_inertia = sliding.structure.G.get() || sliding.structure.H.get();
  const PetscInt free = row_count(linearised.K_z);
  if (free == 0)
  {
    modes.method = ModesMethod::full;
    modes.outcome = {OutcomeKind::converged, "closed contact leaves nothing free to vibrate", 0, 0};
    modes.count_check = "confirmed: there is no mode to count";
    return modes;
  }
  const QuadraticProblem reduced = sliding_problem(sliding.structure, linearised);
  const Owned<Mat> K_loss = sliding_loss(sliding.structure, linearised);
  PairProblem problem{reduced, K_loss, linearised.M_z, linearised.K_z};
  problem.is_indefinite = sliding.structure.elements == 0 && // elements have no negative stiffness
                          inertia_below(problem, shift_below_zero(problem.M_z, problem.K_z), options.pencil) > 0;
  modes.beyond_inertia = modes.beyond_inertia || problem.is_indefinite;
  const PairSearch found = search_pairs(problem, settings.method, settings.band, options);
  modes.modes = modes_of(found.solution, sliding, linearised);
  modes.outcome = found.solution.outcome;
  modes.count = count_pairs(found, std::sqrt(vibration_floor(norms_of(reduced))), 0.8 * two_pi * settings.band);
  modes.decays = found.decays;
  const bool is_whole = free <= options.dense_limit;
  if (modes.beyond_inertia) modes.count.certified_by = Certificate::none;
  if (is_whole && (modes.beyond_inertia || !modes.decays.empty())) // what inertia does not count is solved whole
    modes.count.certified_by = Certificate::all_pairs, modes.count.expected = modes.count.found;
  drop_beyond_band(modes);
  assess(modes);
  return modes;
}

namespace
{

constexpr const char* name_of_search = "modes";

/// All but the vectors of the modes, of which the numbers alone are set.
void describe_search(Checkpoint& checkpoint, Modes& modes)
{
  std::size_t found = modes.modes.size();
  describe_all(checkpoint, found, modes.outcome, modes.method, modes.shapes, modes.band, modes.decays,
               modes.beyond_band, modes.unstable_count, modes.beyond_inertia, modes.count.certified_by,
               modes.count.frequency, modes.count.expected, modes.count.found, modes.count_check);
  modes.modes.resize(found);
}

/// Hands each mode with the name of its checkpoint to `pass`: one checkpoint of all might not fit into the memory.
template <class Pass> void for_each_mode(Modes& modes, const Structure& structure, const Pass& pass)
{
  const FileOrder order(structure);
  std::size_t number = 0;
  for (ComplexMode& mode : modes.modes)
    pass(format("modes.%06zu", number++),
         [&](Checkpoint& checkpoint)
         {
           describe_all(checkpoint, mode.lambda, mode.backward_error, mode.reactions);
           order.describe(checkpoint, mode.real);
           order.describe(checkpoint, mode.imaginary);
         });
}

} // namespace

void keep_modes(Modes& modes, const Structure& structure)
{
  const MPI_Comm comm = comm_of(structure.load);
  for_each_mode(modes, structure,
                [&](const std::string& name, const Description& describe) { keep(name, comm, describe); });
  keep(name_of_search, comm, [&](Checkpoint& checkpoint) { describe_search(checkpoint, modes); }); // of all modes
}

std::optional<Modes> kept_modes(const Structure& structure)
{
  const MPI_Comm comm = comm_of(structure.load);
  Modes modes;
  if (!restore(name_of_search, comm, [&](Checkpoint& checkpoint) { describe_search(checkpoint, modes); })) return {};
  for (ComplexMode& mode : modes.modes)
  {
    mode.real = zeros_like(structure.load);
    mode.imaginary = zeros_like(structure.load);
  }
  bool all = true;
  for_each_mode(modes, structure,
                [&](const std::string& name, const Description& describe) { all &= restore(name, comm, describe); });
  if (!all) return {};
  if (rank_of(comm) == 0) std::printf("  of the checkpoint\n");
  return modes;
}

} // namespace squeal
