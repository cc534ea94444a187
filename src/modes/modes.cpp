#include "squeal/modes/modes.hpp"

#include "loss.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/modes/projection.hpp"
#include "squeal/modes/quadratic.hpp"
#include "squeal/modes/real_modes.hpp"
#include "squeal/modes/slices.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;

/// The entry of phi with the largest modulus. Of nearly equal ones it is the first, for any number of ranks.
std::complex<double> largest_component(Vec real, Vec imaginary)
{
  PetscInt first = 0, last = 0;
  const PetscScalar *re = nullptr, *im = nullptr;
  check(VecGetOwnershipRange(real, &first, &last));
  check(VecGetArrayRead(real, &re));
  check(VecGetArrayRead(imaginary, &im));
  MPI_Comm comm = comm_of(real);
  double largest = 0;
  for (PetscInt i = 0; i < last - first; ++i) largest = std::max(largest, std::hypot(re[i], im[i]));
  MPI_Allreduce(MPI_IN_PLACE, &largest, 1, MPI_DOUBLE, MPI_MAX, comm);
  struct
  {
    double entry[2] = {0, 0};
    int rank = 0;
  } own;
  own.rank = ranks_of(comm);
  for (PetscInt i = last - first - 1; i >= 0; --i)
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
  check(MatCreateVecs(contact.Z, nullptr, mode.real.put()));
  check(MatMult(contact.Z, pair.real, mode.real));
  mode.imaginary = zeros_like(mode.real);
  check(MatMult(contact.Z, pair.imaginary, mode.imaginary));
  const std::complex<double> turn = 1.0 / largest_component(mode.real, mode.imaginary);
  const Owned<Vec> real = copy_of(mode.real);
  check(VecAXPBY(mode.real, -turn.imag(), turn.real(), mode.imaginary));
  check(VecAXPBY(mode.imaginary, turn.imag(), turn.real(), real));
}

/// Adds to the reactions those to complex stiffness beyond C's equivalent of it, (i - lambda/omega) K_loss phi.
void add_loss_reactions(const Structure& structure, const ClosedContact& contact, ComplexMode& mode)
{
  const Complex factor = Complex(0, 1) - mode.lambda / structure.loss_omega;
  const Owned<Vec> force = zeros_like(mode.real);
  Owned<Vec> rows;
  check(MatCreateVecs(contact.reaction, nullptr, rows.put()));
  for (const auto& [part, turn] : {std::pair{mode.real.get(), factor}, {mode.imaginary.get(), Complex(0, 1) * factor}})
  {
    check(MatMult(structure.K_loss, part, force));
    check(MatMult(contact.reaction, force, rows));
    const std::vector<double> reactions = all_entries(rows);
    for (std::size_t i = 0; i < reactions.size(); ++i) mode.reactions[i] += turn * reactions[i];
  }
}

std::vector<ComplexMode> modes_of(const QuadraticSolution& solution, const LinearisedSliding& linearised)
{
  std::vector<ComplexMode> modes;
  for (const Eigenpair& pair : solution.pairs)
  {
    ComplexMode mode;
    mode.lambda = pair.lambda;
    mode.backward_error = pair.backward_error;
    set_shape(mode, linearised.contact, pair);
    mode.reactions = normal_reactions(linearised.reaction, mode.lambda, mode.real, mode.imaginary);
    modes.push_back(std::move(mode));
  }
  return modes;
}

/// What both routes, the full problem and the projection, solve.
struct ModesProblem
{
  const LinearisedSliding& linearised;
  QuadraticProblem reduced; // Y'.Z
  const ModesSettings& settings;
  const ModesOptions& options;
  const Structure& structure;
  Owned<Mat> K_loss;   // of loss factors, Y'.Z; null: none
  bool beyond_inertia; // gyroscopic or circulatory parts may change the number of pairs in a band
};

/// The modes of a solution, with loss factors.
std::vector<ComplexMode> modes_of(QuadraticSolution& solution, const ModesProblem& problem)
{
  if (!problem.K_loss.get()) return modes_of(solution, problem.linearised);
  correct_loss(solution, problem.reduced, problem.K_loss, problem.options.pencil);
  std::vector<ComplexMode> modes = modes_of(solution, problem.linearised);
  for (ComplexMode& mode : modes)
    if (mode.lambda.imag() > 0) add_loss_reactions(problem.structure, problem.linearised.contact, mode);
  std::stable_sort(modes.begin(), modes.end(),
                   [](const ComplexMode& a, const ComplexMode& b) { return a.lambda.real() > b.lambda.real(); });
  return modes;
}

/// Counts in the band, or up to an edge a little below if friction moves a pair across the end of the band.
PairCount count_in_band(const QuadraticProblem& problem, const QuadraticSolution& solution, RealCount& real,
                        double band)
{
  const double end = two_pi * band;
  const int free = count_below(real, std::sqrt(vibration_floor(norms_of(problem))));
  std::vector<double> moduli;
  for (const Eigenpair& pair : solution.pairs) moduli.push_back(std::abs(pair.lambda));
  return count_pairs(std::move(moduli), real, free, 0.8 * end, end);
}

/// The slices' solution, or that of SLEPc's TOAR where they have fewer pairs than are expected. An overdamped mode is
/// no pair: then TOAR finds no more either.
CountedSolution solve_full(const ModesProblem& problem, RealCount& real)
{
  const PetscInt limit = problem.options.dense_limit;
  const double band = problem.settings.band, end = two_pi * band;
  PetscInt n = 0;
  check(MatGetSize(problem.linearised.K_z, &n, nullptr));
  CountedSolution slices;
  if (n > limit && problem.options.solver == ModesSolver::slices)
  {
    slices = solve_by_slices(problem.reduced, real, band, problem.options.pencil);
    if (slices.count.expected == slices.count.found) return slices;
    slices.count = count_in_band(problem.reduced, slices.solution, real, band);
    if (slices.count.found >= slices.count.expected || problem.beyond_inertia) return slices;
  }
  QuadraticSettings quadratic{band, 0, n > limit ? count_below(real, end) : 0, limit};
  if (n > limit) quadratic.shift = std::sqrt(-shift_below_zero(problem.linearised.M_z, problem.linearised.K_z)) / end;
  CountedSolution whole{solve_quadratic(problem.reduced, quadratic), {}};
  whole.count = count_in_band(problem.reduced, whole.solution, real, band);
  return whole.count.found < slices.count.found ? std::move(slices) : std::move(whole);
}

/// Projects on the number of real modes that the scene asks for, or on those up to a little beyond the band, at least
/// twenty.
QuadraticSolution solve_by_projection(const ModesProblem& problem)
{
  constexpr int fewest = 20;
  const ModesSettings& settings = problem.settings;
  const ModesOptions& options = problem.options;
  const Mat M = problem.linearised.M_z, K = problem.linearised.K_z;
  RealModes basis;
  if (settings.real_modes == 0) basis = solve_real_modes_below(M, K, 1.05 * settings.band, options);
  const int wanted = settings.real_modes > 0 ? settings.real_modes : fewest;
  if (static_cast<int>(basis.omega.size()) < wanted) basis = solve_real_modes(M, K, wanted, options);
  return solve_projected(problem.reduced, M, K, basis,
                         {settings.band, settings.residual_passes, options.candidates, options.pencil});
}

int unstable_in(const std::vector<ComplexMode>& modes)
{
  return static_cast<int>(
      std::count_if(modes.begin(), modes.end(), [](const ComplexMode& mode) { return is_unstable(mode.lambda); }));
}

/// The sentence that Modes::count_check holds.
std::string describe_count(const Modes& modes)
{
  const bool confirmed = modes.count.certified_by != Certificate::none && !modes.routes_disagree;
  std::string text = confirmed ? "confirmed: " : "NOT confirmed: ";
  if (modes.method == ModesMethod::both)
    text += std::to_string(modes.unstable_count) + " unstable by the full problem, " +
            std::to_string(unstable_in(modes.projected)) + " by projection on real modes; ";
  text += format("%d pairs below %.6g Hz, ", modes.count.found, modes.count.frequency);
  if (modes.count.certified_by == Certificate::all_pairs) return text + "where the whole problem was solved";
  text += format("%d expected by the inertia of the ", modes.count.expected);
  if (!modes.beyond_inertia) return text + "frictionless structure";
  return text + "symmetric part, which cannot count what gyroscopic or circulatory parts change";
}

/// Sets what follows from the modes: their order, the numbers of unstable ones, the residual and whether it converged.
void assess(Modes& modes)
{
  for (const ComplexMode& mode : modes.modes)
    modes.outcome.residual = std::max(modes.outcome.residual, mode.backward_error);
  std::stable_partition(modes.modes.begin(), modes.modes.end(),
                        [](const ComplexMode& mode) { return is_unstable(mode.lambda); });
  modes.unstable_count = unstable_in(modes.modes);
  std::stable_partition(modes.modes.begin(), modes.modes.begin() + modes.unstable_count,
                        [](const ComplexMode& mode) { return mode.frequency_hz() > 0; }); // the first one is followed
  modes.routes_disagree = modes.method == ModesMethod::both && unstable_in(modes.projected) != modes.unstable_count;
  modes.count_check = describe_count(modes);
  if (modes.outcome.residual <= 1e-8 || modes.outcome.kind != OutcomeKind::converged) return;
  modes.outcome.kind = OutcomeKind::not_converged;
  modes.outcome.reason = "a backward error exceeds 1e-8";
}

ModeCount certified(const PairCount& count)
{
  return {count.expected == count.found ? Certificate::inertia : Certificate::none, count.frequency, count.expected,
          count.found};
}

/// Where inertia does not count, a problem that is solved whole has all its pairs.
ModeCount certified_whole(const PairCount& count, const ModesProblem& problem, PetscInt size)
{
  const bool whole = size <= problem.options.dense_limit && problem.settings.method != ModesMethod::projection;
  return {whole ? Certificate::all_pairs : Certificate::none, count.frequency, whole ? count.found : count.expected,
          count.found};
}

bool is_certified_to(double band, const ModeCount& count)
{
  return count.certified_by != Certificate::none && count.frequency >= band * (1 - 1e-12);
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
  PetscInt free = 0;
  check(MatGetSize(linearised.K_z, &free, nullptr));
  if (free == 0)
  {
    modes.method = ModesMethod::full;
    modes.outcome = {OutcomeKind::converged, "closed contact leaves nothing free to vibrate", 0, 0};
    modes.count_check = "confirmed: there is no mode to count";
    return modes;
  }
  const Mat Y = linearised.contact.Y, Z = linearised.contact.Z;
  const ModesProblem problem{linearised,
                             sliding_problem(sliding.structure, linearised),
                             settings,
                             options,
                             sliding.structure,
                             sliding.structure.K_loss.get() ? project(sliding.structure.K_loss, Y, Z) : Owned<Mat>{},
                             modes.beyond_inertia};
  RealCount real = make_real_count(linearised.M_z, linearised.K_z, options);
  CountedSolution found;
  if (settings.method == ModesMethod::projection)
  {
    found.solution = solve_by_projection(problem);
    found.count = count_in_band(problem.reduced, found.solution, real, settings.band);
  }
  else
    found = solve_full(problem, real);
  modes.modes = modes_of(found.solution, problem);
  modes.outcome = found.solution.outcome;
  modes.count = modes.beyond_inertia ? certified_whole(found.count, problem, free) : certified(found.count);
  if (settings.method == ModesMethod::automatic)
    modes.method = is_certified_to(settings.band, modes.count) ? ModesMethod::full : ModesMethod::both;
  if (modes.method == ModesMethod::both)
  {
    found = {}; // before the projection takes memory
    QuadraticSolution beside = solve_by_projection(problem);
    modes.projected = modes_of(beside, problem);
  }
  drop_beyond_band(modes);
  assess(modes);
  return modes;
}

} // namespace squeal
