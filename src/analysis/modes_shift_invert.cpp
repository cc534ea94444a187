#include "squeal/analysis/shift_invert.hpp"

#include <algorithm>
#include <cmath>
#include <slepcblaslapack.h>

namespace squeal
{

namespace
{

using Index = std::size_t;

constexpr PetscInt block_size = 12;     // solved for at once
constexpr PetscInt largest_space = 600; // vectors
constexpr double tolerance = 1e-9;      // of an invariant subspace, relative to the eigenvalues of the inverse

// A^-1 M V_k = V H: the columns of H are those of V multiplied so far, its rows all of V.
struct Krylov
{
  Block V;
  std::vector<double> H;
  PetscInt order = 0; // columns of H
};

// Multiplies the newest block and appends what is new in the answer.
void grow(Krylov& krylov, const ShiftInvert& pencil)
{
  Block& V = krylov.V;
  const PetscInt size = V.columns, fresh = size - krylov.order;
  const Block S = solved(pencil.factor, product(pencil.M, columns_from(V, krylov.order)));
  const std::vector<double> inside = inner(V, S);
  const PetscInt gained = extend_orthonormal(V, S);
  const std::vector<double> outside = inner(columns_from(V, size), S);
  std::vector<double> H(static_cast<Index>(V.columns) * static_cast<Index>(size));
  const auto column = [&](PetscInt j) { return H.begin() + static_cast<std::ptrdiff_t>(j) * V.columns; };
  for (PetscInt j = 0; j < krylov.order; ++j)
    std::copy_n(krylov.H.begin() + static_cast<std::ptrdiff_t>(j) * size, size, column(j));
  for (PetscInt j = 0; j < fresh; ++j)
  {
    std::copy_n(inside.begin() + static_cast<std::ptrdiff_t>(j) * size, size, column(krylov.order + j));
    std::copy_n(outside.begin() + static_cast<std::ptrdiff_t>(j) * gained, gained, column(krylov.order + j) + size);
  }
  krylov.H = std::move(H);
  krylov.order = size;
}

// The leading columns of a Schur basis of the square part of H, and by how much they miss being invariant.
struct Leading
{
  std::vector<std::complex<double>> nu; // eigenvalues of (K - shift M)^-1 M, largest first
  std::vector<double> Q;                // order x nu.size()
  double next = 0;                      // |nu| of the first that was left out
  double residual = INFINITY;           // over the smallest |nu|
};

// How many of the largest to take: those of at least `least`, `count` or up to half as many again, cut at the widest
// ratio, where the space converges fastest and no conjugates or multiples are parted.
Index how_many(const std::vector<double>& descending, PetscInt count, double least, double rounding)
{
  const auto kept = std::find_if(descending.begin(), descending.end(), [&](double nu) { return nu < rounding; });
  const auto size = static_cast<Index>(kept - descending.begin());
  const auto required = std::find_if(descending.begin(), kept, [&](double nu) { return nu < least; });
  const Index low =
      std::min(size, std::max(static_cast<Index>(count), static_cast<Index>(required - descending.begin())));
  if (low == 0) return 0;
  Index best = low;
  double widest = 1;
  for (Index k = low; k < std::min(size, low + low / 2 + 2); ++k)
    if (descending[k - 1] > descending[k] * widest)
    {
      widest = descending[k - 1] / descending[k];
      best = k;
    }
  return widest > 1 + 1e-9 ? best : size;
}

Leading leading_subspace(const Krylov& krylov, PetscInt count, double least)
{
  const PetscBLASInt order = static_cast<PetscBLASInt>(krylov.order),
                     rows = static_cast<PetscBLASInt>(krylov.V.columns);
  const auto size = static_cast<Index>(order);
  std::vector<double> T(size * size), Q(size * size), re(size), im(size), work(40 * size + size * size);
  for (PetscBLASInt j = 0; j < order; ++j)
    std::copy_n(krylov.H.begin() + static_cast<std::ptrdiff_t>(j) * rows, order,
                T.begin() + static_cast<std::ptrdiff_t>(j) * order);
  PetscBLASInt found = 0, info = 0, work_size = static_cast<PetscBLASInt>(work.size());
  LAPACKgees_("V", "N", nullptr, &order, T.data(), &order, &found, re.data(), im.data(), Q.data(), &order, work.data(),
              &work_size, nullptr, &info);
  Leading result;
  if (info != 0) return result;
  std::vector<double> sizes;
  for (Index i = 0; i < size; ++i) sizes.push_back(std::hypot(re[i], im[i]));
  std::vector<double> descending = sizes;
  std::sort(descending.rbegin(), descending.rend());
  const double rounding = 1e-13 * descending[0]; // without mass there is no vibration
  const Index wanted = how_many(descending, count, least, rounding);
  if (wanted == 0) return result;
  const double smallest = descending[wanted - 1] * (1 - 1e-12);
  result.next = wanted < size ? descending[wanted] : 0;
  std::vector<PetscBLASInt> chosen(size), integers(1);
  for (Index i = 0; i < size; ++i) chosen[i] = sizes[i] >= smallest;
  double condition = 0, separation = 0;
  const PetscBLASInt one = 1;
  LAPACKtrsen_("N", "V", chosen.data(), &order, T.data(), &order, Q.data(), &order, re.data(), im.data(), &found,
               &condition, &separation, work.data(), &work_size, integers.data(), &one, &info);
  if (info != 0) return result;
  const auto taken = static_cast<Index>(found);
  result.Q.assign(Q.begin(), Q.begin() + static_cast<std::ptrdiff_t>(size * taken));
  double largest = 0;
  for (Index k = 0; k < taken; ++k)
  {
    result.nu.emplace_back(re[k], im[k]);
    double square = 0;
    for (PetscBLASInt i = order; i < rows; ++i)
    {
      double miss = 0;
      for (PetscBLASInt j = 0; j < order; ++j)
        miss += krylov.H[static_cast<Index>(i) + static_cast<Index>(j) * static_cast<Index>(rows)] *
                Q[static_cast<Index>(j) + k * size];
      square += miss * miss;
    }
    largest = std::max(largest, std::sqrt(square));
  }
  result.residual = largest / smallest;
  return result;
}

// On rank 0, told to all: what follows must be the same everywhere.
Leading leading_subspace_shared(const Krylov& krylov, PetscInt count, double least)
{
  Leading leading;
  const MPI_Comm comm = krylov.V.comm;
  on_rank_zero(comm, [&] { leading = leading_subspace(krylov, count, least); });
  int size = static_cast<int>(leading.nu.size());
  double scalars[2] = {leading.next, leading.residual};
  MPI_Bcast(&size, 1, MPI_INT, 0, comm);
  MPI_Bcast(scalars, 2, MPI_DOUBLE, 0, comm);
  leading.nu.resize(static_cast<Index>(size));
  leading.Q.resize(static_cast<Index>(size) * static_cast<Index>(krylov.order));
  MPI_Bcast(leading.nu.data(), size, MPI_CXX_DOUBLE_COMPLEX, 0, comm);
  MPI_Bcast(leading.Q.data(), static_cast<int>(leading.Q.size()), MPI_DOUBLE, 0, comm);
  leading.next = scalars[0];
  leading.residual = scalars[1];
  return leading;
}

// Zeros for the columns of V that are not multiplied yet.
std::vector<double> padded(const std::vector<double>& Q, const Krylov& krylov)
{
  const auto order = static_cast<Index>(krylov.order), rows = static_cast<Index>(krylov.V.columns);
  std::vector<double> result(Q.size() / std::max<Index>(order, 1) * rows);
  for (Index k = 0; k * order < Q.size(); ++k)
    std::copy_n(Q.begin() + static_cast<std::ptrdiff_t>(k * order), order,
                result.begin() + static_cast<std::ptrdiff_t>(k * rows));
  return result;
}

// MUMPS's own account of its last phase: INFOG, counted from one.
PetscInt infog(Mat factor, PetscInt number)
{
  PetscInt value = 0;
  check(MatMumpsGetInfog(factor, number, &value));
  return value;
}

constexpr PetscInt singular = -10, most_room = 2000; // INFOG(1); percent of memory beyond MUMPS's estimate

// Pivots that are put off need more room than was estimated, how much depends on the timing of the ranks.
bool short_of_room(PetscInt outcome)
{
  return outcome == -8 || outcome == -9 || outcome == -17 || outcome == -20;
}

// `room`: percent beyond the estimate, or 0 for MUMPS's own margin.
Owned<Mat> analysed(const ShiftInvert& pencil, PetscInt room)
{
  Owned<Mat> factor;
  MatFactorInfo settings;
  check(MatFactorInfoInitialize(&settings));
  check(MatGetFactor(pencil.shifted, MATSOLVERMUMPS, pencil.kind, factor.put()));
  check(MatSetOptionsPrefix(factor, "modes_"));
  // The negative pivots of a root that ScaLAPACK factors are not counted: MUMPS keeps the root to itself.
  check(MatMumpsSetIcntl(factor, 13, 1));
  check(MatMumpsSetIcntl(factor, 27, block_size));
  if (pencil.kind == MAT_FACTOR_LU)
    check(MatLUFactorSymbolic(factor, pencil.shifted, nullptr, nullptr, &settings));
  else
    check(MatCholeskyFactorSymbolic(factor, pencil.shifted, nullptr, &settings));
  if (room > 0) check(MatMumpsSetIcntl(factor, 14, room));
  return factor;
}

// INFOG(1) of the factorisation, below zero if it failed, of which PETSc says nothing. The analysis is kept from shift
// to shift, but a failure takes it away: PETSc would pass over every later factorisation.
PetscInt factorise(ShiftInvert& pencil)
{
  MatFactorInfo settings;
  check(MatFactorInfoInitialize(&settings));
  for (PetscInt room = 0;;)
  {
    if (!pencil.factor.get()) pencil.factor = analysed(pencil, room);
    if (pencil.kind == MAT_FACTOR_LU)
      check(MatLUFactorNumeric(pencil.factor, pencil.shifted, &settings));
    else
      check(MatCholeskyFactorNumeric(pencil.factor, pencil.shifted, &settings));
    const PetscInt outcome = infog(pencil.factor, 1);
    if (outcome >= 0) return outcome;
    check(MatMumpsGetIcntl(pencil.factor, 14, &room));
    room = 4 * std::max<PetscInt>(room, 0) + 10;
    pencil.factor = {};
    if (!short_of_room(outcome) || room > most_room) return outcome;
  }
}

} // namespace

void use_mumps(ST transformation)
{
  KSP solver = nullptr;
  PC factor = nullptr;
  check(STSetType(transformation, STSINVERT));
  check(STGetKSP(transformation, &solver));
  check(KSPSetType(solver, KSPPREONLY));
  check(KSPGetPC(solver, &factor));
  check(PCSetType(factor, PCLU));
  check(PCFactorSetMatSolverType(factor, MATSOLVERMUMPS));
}

ShiftInvert make_shift_invert(Mat K, Mat M, MatFactorType kind)
{
  ShiftInvert pencil{K, M, kind, 0, {}, {}};
  check(MatDuplicate(K, MAT_COPY_VALUES, pencil.shifted.put()));
  check(MatAXPY(pencil.shifted, 1, M, DIFFERENT_NONZERO_PATTERN));
  if (kind == MAT_FACTOR_CHOLESKY) check(MatSetOption(pencil.shifted, MAT_SYMMETRIC, PETSC_TRUE));
  return pencil;
}

// On an eigenvalue there is no factor: below it there is.
void move_to(ShiftInvert& pencil, double shift)
{
  const Mat A = pencil.shifted;
  PetscInt outcome = singular;
  for (double step = 1e-6; outcome == singular && step < 1e-2; step *= 10)
  {
    check(MatZeroEntries(A));
    check(MatAXPY(A, 1, pencil.K, SUBSET_NONZERO_PATTERN));
    check(MatAXPY(A, -shift, pencil.M, SUBSET_NONZERO_PATTERN));
    pencil.shift = shift;
    outcome = factorise(pencil);
    shift -= step * std::abs(shift);
  }
  if (outcome < 0)
    throw LibraryError("MUMPS found no factor of K - " + std::to_string(pencil.shift) +
                       " M: INFOG(1) = " + std::to_string(outcome) +
                       ", which its manual explains (-13: out of memory); -modes_mat_mumps_icntl_4 2 says more");
}

int negative_pivots(const ShiftInvert& pencil)
{
  // MatGetInertia insists on null pivot detection: not wanted
  return static_cast<int>(infog(pencil.factor, 12));
}

Nearest solve_nearest(const ShiftInvert& pencil, PetscInt count, double radius)
{
  PetscInt n = 0;
  check(MatGetSize(pencil.K, &n, nullptr));
  Krylov krylov;
  krylov.V = empty_block(pencil.K);
  extend_orthonormal(krylov.V, uneven_block(pencil.K, std::min(n, block_size)));
  const PetscInt room = std::max(largest_space, 4 * count);
  const double least = radius > 0 ? 1 / radius : INFINITY;
  Nearest result;
  for (int round = 0; !result.converged && krylov.V.columns < room; ++round)
  {
    grow(krylov, pencil);
    const bool exhausted = krylov.V.columns == krylov.order;
    if (!exhausted && (krylov.order < 2 * count || round % 3 != 0)) continue;
    Leading leading = leading_subspace_shared(krylov, count, least);
    result.converged = exhausted || leading.residual < tolerance;
    if (!result.converged) continue;
    double smallest = leading.next > 0 ? INFINITY : 0; // nothing is left out: everything is reached
    for (const std::complex<double> nu : leading.nu)
    {
      result.theta.push_back(pencil.shift + 1.0 / nu);
      smallest = std::min(smallest, std::abs(nu));
    }
    result.reach = 1 / smallest;
    result.space = combination(krylov.V, padded(leading.Q, krylov), static_cast<PetscInt>(leading.nu.size()));
  }
  return result;
}

} // namespace squeal
