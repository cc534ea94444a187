#include "squeal/modes/modes.hpp"

#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/modes/projection.hpp"
#include "squeal/modes/quadratic.hpp"
#include "squeal/modes/real_modes.hpp"
#include "squeal/modes/slices.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

/// The entry of phi with the largest modulus. Of nearly equal ones it is the first, for any number of ranks.
std::complex<double> largest_entry(Vec real, Vec imaginary)
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
  const std::complex<double> turn = 1.0 / largest_entry(mode.real, mode.imaginary);
  const Owned<Vec> real = copy_of(mode.real);
  check(VecAXPBY(mode.real, -turn.imag(), turn.real(), mode.imaginary));
  check(VecAXPBY(mode.imaginary, turn.imag(), turn.real(), real));
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
};

/// Counts in the band, or up to an edge a little below if friction moves a pair across the end of the band.
PairCount count_in_band(const QuadraticProblem& problem, const QuadraticSolution& solution, RealCount& real,
                        double band)
{
  const double end = 2 * std::numbers::pi * band;
  const int free = count_below(real, std::sqrt(vibration_floor(norms_of(problem))));
  return count_pairs(solution, real, free, 0.8 * end, end);
}

CountedSolution solve_full(const ModesProblem& problem, RealCount& real)
{
  const int limit = static_cast<int>(problem.options.dense_limit);
  const double band = problem.settings.band, end = 2 * std::numbers::pi * band;
  PetscInt n = 0;
  check(MatGetSize(problem.linearised.K_z, &n, nullptr));
  CountedSolution result;
  if (n > limit && problem.options.solver == ModesSolver::slices)
  {
    result = solve_by_slices(problem.reduced, real, band, problem.options.pencil);
    if (result.count.expected == result.count.found) return result;
    result.count = count_in_band(problem.reduced, result.solution, real, band);
    if (result.count.found >= result.count.expected) return result;
    result.solution.outcome.kind = OutcomeKind::not_converged;
    result.solution.outcome.reason = "fewer pairs were found than are expected; -modes_solver toar uses another method";
    return result;
  }
  QuadraticSettings quadratic{band, 0, n > limit ? count_below(real, end) : 0, limit};
  if (n > limit) quadratic.shift = std::sqrt(-shift_below_zero(problem.linearised.M_z, problem.linearised.K_z)) / end;
  result.solution = solve_quadratic(problem.reduced, quadratic);
  result.count = count_in_band(problem.reduced, result.solution, real, band);
  return result;
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
  return solve_projected(
      problem.reduced, M, K, basis,
      {settings.band, settings.residual_passes, static_cast<int>(options.candidates), options.pencil});
}

int unstable_in(const std::vector<ComplexMode>& modes)
{
  return static_cast<int>(
      std::count_if(modes.begin(), modes.end(), [](const ComplexMode& mode) { return is_unstable(mode.lambda); }));
}

/// The sentence that Modes::count_check holds.
std::string describe_count(const Modes& modes)
{
  const bool confirmed = !modes.count.certified_by.empty() && !modes.routes_disagree;
  std::string text = confirmed ? "confirmed: " : "NOT confirmed: ";
  if (modes.method == ModesMethod::both)
    text += std::to_string(modes.unstable_count) + " unstable by the full problem, " +
            std::to_string(unstable_in(modes.projected)) + " by projection on real modes; ";
  return text + format("%d pairs below %.6g Hz, %d expected by the inertia of the frictionless structure",
                       modes.count.found, modes.count.frequency, modes.count.expected);
}

/// Sets what follows from the modes: their order, the numbers of unstable ones, the residual and whether it converged.
void assess(Modes& modes)
{
  for (const ComplexMode& mode : modes.modes)
    modes.outcome.residual = std::max(modes.outcome.residual, mode.backward_error);
  std::stable_partition(modes.modes.begin(), modes.modes.end(),
                        [](const ComplexMode& mode) { return is_unstable(mode.lambda); });
  modes.unstable_count = unstable_in(modes.modes);
  modes.routes_disagree = modes.method == ModesMethod::both && unstable_in(modes.projected) != modes.unstable_count;
  modes.count_check = describe_count(modes);
  if (modes.outcome.residual <= 1e-8 || modes.outcome.kind != OutcomeKind::converged) return;
  modes.outcome.kind = OutcomeKind::not_converged;
  modes.outcome.reason = "a backward error exceeds 1e-8";
}

ModeCount certified(const PairCount& count)
{
  return {count.expected == count.found ? "inertia" : "", count.frequency, count.expected, count.found};
}

/// Keeps of the modes beyond the band, which were found for the count, the frequencies only.
void drop_beyond_band(Modes& modes)
{
  const auto beyond = std::stable_partition(modes.modes.begin(), modes.modes.end(),
                                            [&](const ComplexMode& mode)
                                            { return std::abs(mode.lambda) < 2 * std::numbers::pi * modes.band; });
  for (auto mode = beyond; mode != modes.modes.end(); ++mode) modes.beyond_band.push_back(mode->frequency_hz());
  modes.modes.erase(beyond, modes.modes.end());
}

} // namespace

double ComplexMode::frequency_hz() const
{
  return std::abs(lambda.imag()) / (2 * std::numbers::pi);
}

double ComplexMode::damping_ratio() const
{
  return -lambda.real() / std::abs(lambda);
}

OptionList options_of(ModesOptions& options)
{
  return {
      {"-modes_dense_limit", &options.dense_limit, Range::not_negative,
       "eigenproblems up to this size are solved whole by LAPACK"},
      {"-modes_solver", choice_of(options.solver), Range::any,
       "of larger problems: slices of frequency, or TOAR around zero (toar)"},
      {"-modes_candidates", &options.candidates, Range::not_negative,
       "pairs that each residual pass of the projection corrects"},
      {"-modes_shapes", choice_of(options.shapes), Range::any,
       "modes whose shapes the fields file holds: the unstable ones or all"},
  };
}

bool is_unstable(std::complex<double> lambda)
{
  return lambda.real() > 1e-8 * std::abs(lambda);
}

Modes find_modes(const SlidingEquilibrium& sliding, const LinearisedSliding& linearised, const ModesSettings& settings,
                 const ModesOptions& options)
{
  Modes modes;
  modes.method = settings.method;
  modes.band = settings.band;
  modes.shapes = options.shapes;
  PetscInt free = 0;
  check(MatGetSize(linearised.K_z, &free, nullptr));
  if (free == 0)
  {
    modes.outcome = {OutcomeKind::converged, "closed contact leaves nothing free to vibrate", 0, 0};
    modes.count_check = "confirmed: there is no mode to count";
    return modes;
  }
  const Mat Y = linearised.contact.Y, Z = linearised.contact.Z;
  const ModesProblem problem{
      linearised,
      {project(sliding.structure.M, Y, Z), project(linearised.C, Y, Z), project(sliding.structure.K, Y, Z)},
      settings,
      options};
  RealCount real = make_real_count(linearised.M_z, linearised.K_z, options);
  CountedSolution found;
  if (settings.method != ModesMethod::full)
  {
    found.solution = solve_by_projection(problem);
    modes.projected = modes_of(found.solution, linearised);
  }
  if (settings.method == ModesMethod::projection)
  {
    found.count = count_in_band(problem.reduced, found.solution, real, settings.band);
    modes.modes = std::exchange(modes.projected, {});
  }
  else
  {
    found = solve_full(problem, real);
    modes.modes = modes_of(found.solution, linearised);
  }
  modes.outcome = found.solution.outcome;
  modes.count = certified(found.count);
  drop_beyond_band(modes);
  assess(modes);
  return modes;
}

} // namespace squeal
