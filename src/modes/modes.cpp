#include "squeal/modes/modes.hpp"

#include "squeal/base/constants.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/modes/pair_search.hpp"
#include "squeal/modes/quadratic.hpp"

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

/// The modes of pairs that come with the largest real part first.
std::vector<ComplexMode> modes_of(const QuadraticSolution& solution, const Structure& structure,
                                  const LinearisedSliding& linearised)
{
  std::vector<ComplexMode> modes;
  for (const Eigenpair& pair : solution.pairs)
  {
    ComplexMode& mode = modes.emplace_back();
    mode.lambda = pair.lambda;
    mode.backward_error = pair.backward_error;
    set_shape(mode, linearised.contact, pair);
    mode.reactions = normal_reactions(linearised.reaction, mode.lambda, mode.real, mode.imaginary);
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
  return text + "symmetric part, which cannot count what gyroscopic or circulatory parts change";
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
  PetscInt free = 0;
  check(MatGetSize(linearised.K_z, &free, nullptr));
  if (free == 0)
  {
    modes.method = ModesMethod::full;
    modes.outcome = {OutcomeKind::converged, "closed contact leaves nothing free to vibrate", 0, 0};
    modes.count_check = "confirmed: there is no mode to count";
    return modes;
  }
  const QuadraticProblem reduced = sliding_problem(sliding.structure, linearised);
  const Owned<Mat> K_loss = sliding_loss(sliding.structure, linearised);
  const PairSearch found =
      search_pairs({reduced, K_loss, linearised.M_z, linearised.K_z}, settings.method, settings.band, options);
  modes.modes = modes_of(found.solution, sliding.structure, linearised);
  modes.outcome = found.solution.outcome;
  modes.count = count_pairs(found, std::sqrt(vibration_floor(norms_of(reduced))), 0.8 * two_pi * settings.band);
  if (modes.beyond_inertia) // where inertia does not count, a problem that is solved whole has all its pairs
  {
    modes.count.certified_by = free <= options.dense_limit ? Certificate::all_pairs : Certificate::none;
    if (free <= options.dense_limit) modes.count.expected = modes.count.found;
  }
  drop_beyond_band(modes);
  assess(modes);
  return modes;
}

} // namespace squeal
