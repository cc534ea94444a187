#include "squeal/algebra/shift_invert.hpp"

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
  const Block S = pencil.factor->solved(product(pencil.M, columns_from(V, krylov.order)));
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

ShiftInvert make_shift_invert(Mat K, Mat M, Symmetry symmetry)
{
  return {K, M, 0, std::make_unique<PencilFactor>(K, M, symmetry)};
}

// On an eigenvalue there is no factor: below it there is.
void move_to(ShiftInvert& pencil, double shift)
{
  for (double step = 1e-6; step < 1e-2; step *= 10)
  {
    pencil.shift = shift;
    if (pencil.factor->factorise(shift)) return;
    shift -= step * std::abs(shift);
  }
  throw LibraryError("K - " + std::to_string(pencil.shift) + " M of the modes is singular, and just below, too");
}

Nearest solve_nearest(const ShiftInvert& pencil, PetscInt count, double radius, double tolerance)
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
    if (!exhausted && (krylov.order < 2 * count || round % (1 + krylov.order / 150) != 0)) continue;
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
