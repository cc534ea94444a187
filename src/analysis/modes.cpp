#include "squeal/analysis/modes.hpp"

#include "squeal/analysis/closed_contact.hpp"
#include "squeal/analysis/projection.hpp"
#include "squeal/analysis/quadratic.hpp"
#include "squeal/analysis/real_modes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace squeal
{

namespace
{

struct SlidingProblem
{
  ClosedContact contact;
  Owned<Mat> C;             // with the friction direction's, in the structure's dofs
  QuadraticProblem reduced; // Y'.Z
  Owned<Mat> M, K;          // Z'.Z, symmetric
};

SlidingProblem make_problem(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium)
{
  SlidingProblem problem;
  problem.contact = eliminate_closed_pairs(structure, interface, equilibrium);
  const Mat Y = problem.contact.Y, Z = problem.contact.Z;
  problem.C = sliding_damping(structure, interface, equilibrium);
  problem.reduced = {project(structure.M, Y, Z), project(problem.C, Y, Z), project(structure.K, Y, Z)};
  problem.M = project_symmetric(structure.M, Z);
  problem.K = project_symmetric(structure.K, Z);
  return problem;
}

// The entry of phi of largest modulus; of nearly equal ones the first, so that every rank count turns phi alike.
std::complex<double> largest_entry(Vec real, Vec imaginary)
{
  PetscInt first = 0, last = 0;
  const PetscScalar *re = nullptr, *im = nullptr;
  check(VecGetOwnershipRange(real, &first, &last));
  check(VecGetArrayRead(real, &re));
  check(VecGetArrayRead(imaginary, &im));
  MPI_Comm comm = PetscObjectComm(reinterpret_cast<PetscObject>(real));
  double largest = 0;
  for (PetscInt i = 0; i < last - first; ++i) largest = std::max(largest, std::hypot(re[i], im[i]));
  MPI_Allreduce(MPI_IN_PLACE, &largest, 1, MPI_DOUBLE, MPI_MAX, comm);
  struct
  {
    double entry[2] = {0, 0};
    int rank = 0;
  } mine;
  mine.rank = ranks_of(comm);
  for (PetscInt i = last - first - 1; i >= 0; --i)
    if (std::hypot(re[i], im[i]) >= largest * (1 - 1e-6)) mine = {{re[i], im[i]}, rank_of(comm)};
  check(VecRestoreArrayRead(real, &re));
  check(VecRestoreArrayRead(imaginary, &im));
  int holder = 0;
  MPI_Allreduce(&mine.rank, &holder, 1, MPI_INT, MPI_MIN, comm);
  MPI_Bcast(mine.entry, 2, MPI_DOUBLE, holder, comm);
  return {mine.entry[0], mine.entry[1]};
}

// phi = Z y turned and scaled so that its largest entry is 1
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

std::vector<ComplexMode> modes_of(const QuadraticSolution& solution, const Structure& structure,
                                  const SlidingProblem& problem)
{
  std::vector<ComplexMode> modes;
  for (const Eigenpair& pair : solution.pairs)
  {
    ComplexMode mode;
    mode.lambda = pair.lambda;
    mode.backward_error = pair.backward_error;
    set_shape(mode, problem.contact, pair);
    mode.reactions = normal_reactions(problem.contact, structure, problem.C, mode.lambda, mode.real, mode.imaginary);
    modes.push_back(std::move(mode));
  }
  return modes;
}

struct ModesOptions
{
  PetscInt dense_limit = 200, candidates = 20;
};

ModesOptions read_options()
{
  ModesOptions options;
  options.dense_limit = dense_limit_option();
  check(PetscOptionsGetInt(nullptr, "modes_", "-candidates", &options.candidates, nullptr));
  return options;
}

QuadraticSolution solve_full(const SlidingProblem& problem, const ModesSettings& settings, const ModesOptions& options)
{
  const int limit = static_cast<int>(options.dense_limit);
  PetscInt n = 0;
  check(MatGetSize(problem.K, &n, nullptr));
  QuadraticSettings quadratic{settings.band, 0, 0, limit};
  if (n > options.dense_limit)
  {
    // Friction moves few eigenvalues across the band: the real modes say how many to ask for.
    quadratic.expected = count_real_modes(problem.M, problem.K, 1.05 * settings.band, limit);
    quadratic.shift = std::sqrt(-shift_below_zero(problem.M, problem.K)) / (2 * std::numbers::pi * settings.band);
  }
  return solve_quadratic(problem.reduced, quadratic);
}

QuadraticSolution solve_by_projection(const SlidingProblem& problem, const ModesSettings& settings,
                                      const ModesOptions& options)
{
  const RealModes basis =
      solve_real_modes(problem.M, problem.K, settings.real_modes, static_cast<int>(options.dense_limit));
  return solve_projected(problem.reduced, problem.M, problem.K, basis,
                         {settings.band, settings.residual_passes, static_cast<int>(options.candidates)});
}

int unstable_in(const std::vector<ComplexMode>& modes)
{
  return static_cast<int>(
      std::count_if(modes.begin(), modes.end(), [](const ComplexMode& mode) { return is_unstable(mode.lambda); }));
}

std::string compare_counts(const Modes& modes)
{
  const int other = unstable_in(modes.projected);
  const std::string counts = std::to_string(modes.unstable_count) + " by the full problem, " + std::to_string(other) +
                             " by projection on real modes";
  return (other == modes.unstable_count ? "confirmed: " : "NOT confirmed: ") + counts;
}

void judge(Modes& modes)
{
  for (const ComplexMode& mode : modes.modes)
    modes.outcome.residual = std::max(modes.outcome.residual, mode.backward_error);
  modes.unstable_count = unstable_in(modes.modes);
  if (modes.outcome.residual <= 1e-8 || modes.outcome.word != "converged") return;
  modes.outcome.word = "not converged";
  modes.outcome.reason = "a backward error exceeds 1e-8";
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

Modes find_modes(const Structure& structure, const Interface& interface, const Equilibrium& equilibrium,
                 const ModesSettings& settings)
{
  const ModesOptions options = read_options();
  const SlidingProblem problem = make_problem(structure, interface, equilibrium);
  Modes modes;
  modes.method = settings.method;
  modes.band = settings.band;
  PetscInt free = 0;
  check(MatGetSize(problem.K, &free, nullptr));
  if (free == 0)
  {
    modes.outcome = {"converged", "closed contact leaves nothing free to vibrate", 0, 0};
    modes.count_check = "confirmed: there is no mode to count";
    return modes;
  }
  QuadraticSolution projected;
  if (settings.method != "full")
  {
    projected = solve_by_projection(problem, settings, options);
    modes.projected = modes_of(projected, structure, problem);
  }
  if (settings.method == "projection")
  {
    modes.outcome = projected.outcome;
    modes.modes = std::move(modes.projected);
    modes.projected.clear();
    judge(modes);
    modes.count_check =
        "not confirmed: the projection alone was asked for; method \"both\" solves the full problem too";
    return modes;
  }
  const QuadraticSolution full = solve_full(problem, settings, options);
  modes.outcome = full.outcome;
  modes.modes = modes_of(full, structure, problem);
  judge(modes);
  modes.count_check = settings.method == "both"
                          ? compare_counts(modes)
                          : "not confirmed: the full problem alone was asked for; method \"both\" projects too";
  return modes;
}

} // namespace squeal
