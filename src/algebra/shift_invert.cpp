#include "squeal/algebra/shift_invert.hpp"

#include "squeal/base/run_control.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr PetscInt block_size = 12;     // vectors in the starting block
constexpr PetscInt largest_space = 600; // vectors

/// (K - shift M)^-1 M V_k = V H. V_k are the columns of V that were multiplied so far, one for each column of H.
struct Krylov
{
  MultiVector V;
  MatrixXd H{};

  Index order() const { return H.cols(); }
};

/// Multiplies the newest block and appends to V what the product adds to its span.
void grow(Krylov& krylov, const ShiftInvert& pencil)
{
  MultiVector& V = krylov.V;
  const Index size = V.columns(), order = krylov.order();
  end_if_asked(comm_of(pencil.M));
  const MultiVector S = pencil.factor->solve(product(pencil.M, columns_from(V, order)));
  const MatrixXd inside = inner_products(V, S);
  const Index gained = extend_orthonormal(V, S);
  krylov.H.conservativeResizeLike(MatrixXd::Zero(size + gained, size));
  krylov.H.rightCols(size - order) << inside, inner_products(columns_from(V, size), S);
}

/// An orthonormal basis of the leading invariant subspace of the square part of H, and the residual of its span.
struct Leading
{
  std::vector<double> nu{};   // eigenvalues of (K - shift M)^-1 M, none smaller in modulus than those left out
  MatrixXd Q{};               // order x nu.size(), and columns for guards
  double residual = HUGE_VAL; // over the smallest |nu|
};

/// The number of eigenvalues to take: those of at least `least` in modulus, at least `count`, and up to that times
/// `slack` more. It ends at the widest ratio of neighbours, where the space converges fastest and neither conjugates
/// nor multiples are parted.
std::size_t number_to_take(const std::vector<double>& descending, PetscInt count, double least, double slack)
{
  const double rounding = 1e-13 * descending[0]; // below, a mode has no mass and does not vibrate
  const auto end = std::find_if(descending.begin(), descending.end(), [&](double nu) { return nu < rounding; });
  const auto size = static_cast<std::size_t>(end - descending.begin());
  const auto required = std::find_if(descending.begin(), end, [&](double nu) { return nu < least; });
  const auto low = std::min(
      size, std::max(static_cast<std::size_t>(count), static_cast<std::size_t>(required - descending.begin())));
  if (low == 0) return 0;
  std::size_t best = low;
  double widest = 1;
  const auto more = static_cast<std::size_t>(slack * static_cast<double>(low));
  for (std::size_t k = low; k < std::min(size, low + more + 2); ++k)
    if (descending[k - 1] > descending[k] * widest)
    {
      widest = descending[k - 1] / descending[k];
      best = k;
    }
  return widest > 1 + 1e-9 ? best : size;
}

Leading leading_subspace(const Krylov& krylov, PetscInt count, double least, double guards)
{
  const Index order = krylov.order();
  Leading result;
  std::vector<DenseEigenpair> pairs = solve_dense_unsymmetric(krylov.H.topRows(order));
  std::vector<double> descending;
  for (const DenseEigenpair& pair : pairs) descending.push_back(std::abs(pair.lambda));
  const auto basis = [&](std::size_t taken) {
    return orthonormal_columns(real_columns({pairs.begin(), pairs.begin() + static_cast<Index>(taken)}, order));
  };
  const std::size_t taken = number_to_take(descending, count, least, 0.5);
  if (taken == 0) return result;
  for (std::size_t k = 0; k < taken; ++k) result.nu.push_back(pairs[k].lambda.real());
  result.Q = basis(taken);
  const MatrixXd outside = krylov.H.bottomRows(krylov.H.rows() - order) * result.Q;
  result.residual = std::sqrt(outside.colwise().squaredNorm().maxCoeff()) / descending[taken - 1];
  const auto wider = static_cast<PetscInt>((1 + guards) * static_cast<double>(taken));
  if (guards > 0) result.Q = basis(number_to_take(descending, wider, HUGE_VAL, 0.1));
  return result;
}

/// Computed on rank 0 and broadcast, since what follows must be the same on every rank.
Leading leading_subspace_shared(const Krylov& krylov, PetscInt count, double least, double guards)
{
  Leading leading;
  const MPI_Comm comm = krylov.V.comm;
  on_rank_zero(comm, [&] { leading = leading_subspace(krylov, count, least, guards); });
  broadcast(leading.Q, comm);
  broadcast(leading.nu, comm);
  MPI_Bcast(&leading.residual, 1, MPI_DOUBLE, 0, comm);
  return leading;
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

ShiftInvert make_shift_invert(Mat K, Mat M, Keep keep, const PencilOptions& options, const EliminationOrder* order)
{
  return {K, M, 0, std::make_unique<PencilFactor>(K, M, keep, options, order)};
}

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

Nearest solve_nearest(const ShiftInvert& pencil, PetscInt count, double radius, double tolerance, double guards)
{
  const PetscInt n = row_count(pencil.K);
  Krylov krylov{empty_multivector(pencil.K)};
  extend_orthonormal(krylov.V, random_multivector(pencil.K, std::min(n, block_size)));
  const PetscInt limit = std::max(largest_space, 4 * count);
  const double least = radius > 0 ? 1 / radius : HUGE_VAL;
  Nearest result;
  for (int round = 0; !result.converged && krylov.V.columns() < limit; ++round)
  {
    grow(krylov, pencil);
    const bool exhausted = krylov.V.columns() == krylov.order();
    if (!exhausted && (krylov.order() < 2 * count || round % (1 + krylov.order() / 150) != 0)) continue;
    const Leading leading = leading_subspace_shared(krylov, count, least, guards);
    result.converged = exhausted || leading.residual < tolerance;
    if (!result.converged) continue;
    for (const double nu : leading.nu) result.theta.push_back(pencil.shift + 1 / nu);
    result.space = {krylov.V.comm, krylov.V.entries.leftCols(krylov.order()) * leading.Q};
  }
  return result;
}

} // namespace squeal
