#include "reduced_sliding.hpp"

#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/modes/quadratic.hpp"

#include <algorithm>
#include <numeric>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// K + omega^2 M
Owned<Mat> energy_of(const Structure& structure, double omega)
{
  Owned<Mat> energy = copy_of(structure.K);
  check(MatAXPY(energy, omega * omega, structure.M, SAME_NONZERO_PATTERN));
  check(MatSetOption(energy, MAT_SYMMETRIC, PETSC_TRUE));
  return energy;
}

/// B_n
Owned<Mat> normal_rows(const Interface& interface)
{
  std::vector<int> all(static_cast<std::size_t>(interface.pairs));
  std::iota(all.begin(), all.end(), 0);
  return rows_of(interface, all, RowsTaken::normal);
}

} // namespace

MultiVector make_pair_shapes(const BrakeModel& model, double omega)
{
  const auto& [structure, interface] = model;
  const Owned<Mat> energy = energy_of(structure, omega);
  const Factor factor(energy, nullptr, {});
  if (factor.failed()) throw Error("the stiffness is not positive semidefinite");
  MultiVector shapes = empty_multivector(structure.K);
  std::vector<double> force(interface.size());
  for (std::size_t i = 0; i < static_cast<std::size_t>(interface.pairs); ++i)
  {
    const PairView view(force, interface.directions);
    view.normal(i) = 1;
    const Owned<Vec> b = zeros_like(structure.load), x = zeros_like(structure.load);
    add_reactions(interface, force, b);
    solve(factor, b, x);
    double work = 0;
    check(VecDot(b, x, &work));
    check(VecScale(x, 1 / std::sqrt(work)));
    append(shapes, x);
    view.normal(i) = 0;
  }
  return shapes;
}

ShapeCollection::ShapeCollection(const BrakeModel& model, const MultiVector& pairs, double omega)
    : pairs_(pairs), energy_(energy_of(model.structure, omega)), normals_(normal_rows(model.interface)),
      shapes_(empty_multivector(model.structure.K)), images_(empty_multivector(model.structure.K))
{
}

void ShapeCollection::take_normal_motion_off(MultiVector& vectors) const
{
  if (pairs_.columns() == 0) return;
  vectors.entries -= pairs_.entries * solve_dense(whole_product(normals_, pairs_), whole_product(normals_, vectors),
                                                  "the normal motions of two pairs are the same");
}

void ShapeCollection::add(MultiVector vectors, double truncation)
{
  const Index modes = vectors.columns() / 2;
  const MultiVector forces = product(energy_, vectors);
  for (Index k = 0; k < modes; ++k)
  {
    const double energy = vectors.entries.col(k).dot(forces.entries.col(k)) +
                          vectors.entries.col(modes + k).dot(forces.entries.col(modes + k));
    for (const Index j : {k, modes + k}) vectors.entries.col(j) /= std::sqrt(energy);
  }
  take_normal_motion_off(vectors);
  for (int pass = 0; pass < 2 && shapes_.columns() > 0; ++pass) // twice: what is left is small
    vectors.entries -= shapes_.entries * inner_products(images_, vectors);
  const MatrixXd left = inner_products(vectors, product(energy_, vectors));
  const auto [squares, directions] = solve_dense_symmetric((left + left.transpose()) / 2);
  const Index gained = (squares.array() > truncation * truncation).count();
  const VectorXd sizes = squares.tail(gained).cwiseSqrt();
  const MultiVector news = combination(vectors, directions.rightCols(gained) * sizes.cwiseInverse().asDiagonal());
  append(images_, product(energy_, news));
  append(shapes_, news);
}

namespace
{

/// Of the pairs of a point, closed and rigid ones, which are eliminated, and the others.
struct PairsOfPoint
{
  std::vector<Index> closed{}, open{};
};

PairsOfPoint pairs_of(const Interface& interface, const std::vector<char>& closed)
{
  PairsOfPoint pairs;
  for (std::size_t i = 0; i < closed.size(); ++i)
    (closed[i] && compliance_of(interface, i) == 0 ? pairs.closed : pairs.open).push_back(static_cast<Index>(i));
  return pairs;
}

/// The rows B_n + part e.B_t of some pairs, from all of B. `part`: of each pair, 0 or mu.
MatrixXd rows_with(const std::vector<double>& part, const Interface& interface, const std::vector<Index>& pairs,
                   const MatrixXd& B)
{
  const std::vector<double> directions = drive_directions(interface);
  const TangentView e(directions, interface.directions);
  const PairRows<Index> rows(interface.directions);
  MatrixXd result(static_cast<Index>(pairs.size()), B.cols());
  for (Index k = 0; k < result.rows(); ++k)
  {
    const Index pair = pairs[static_cast<std::size_t>(k)];
    const auto i = static_cast<std::size_t>(pair);
    result.row(k) = B.row(rows.normal(pair));
    for (std::size_t d = 0; d < e.of(i).size(); ++d)
      result.row(k) += part[i] * e.of(i)[d] * B.row(rows.tangential(pair) + static_cast<Index>(d));
  }
  return result;
}

/// S lifted by the shapes W of the closed pairs.
struct LiftedShapes
{
  MultiVector Y, Z;
};

LiftedShapes lifted(const MultiVector& S, const MultiVector& W, const Interface& interface,
                    const std::vector<Index>& closed)
{
  if (closed.empty()) return {S, S};
  const MatrixXd BS = whole_product(interface.B, S), BW = whole_product(interface.B, W);
  const std::vector<double> mu = drive_friction(interface), frictionless(mu.size(), 0.);
  const auto lift = [&](const std::vector<double>& part)
  {
    MultiVector result = S;
    result.entries -=
        W.entries * solve_dense(rows_with(part, interface, closed, BW), rows_with(part, interface, closed, BS),
                                "a closed pair is jammed by friction, or fixed by other pairs");
    return result;
  };
  return {lift(mu), lift(frictionless)};
}

} // namespace

ReducedMatrices reduced_matrices(const SlidingEquilibrium& sliding, const MultiVector& T, const MultiVector& W)
{
  const auto& [structure, interface, equilibrium] = sliding;
  if (W.columns() != interface.pairs)
    throw Error(format("the number of contact pairs changes from %d to %d", static_cast<int>(W.columns()),
                       static_cast<int>(interface.pairs)));
  const PairsOfPoint pairs = pairs_of(interface, equilibrium.closed);
  const auto of_pairs = [&](const std::vector<Index>& which) {
    return MultiVector{W.comm, W.entries(Eigen::all, which)};
  };
  MultiVector S = T;
  append(S, of_pairs(pairs.open));
  const LiftedShapes shapes = lifted(S, of_pairs(pairs.closed), interface, pairs.closed);
  const auto seen = [&](Mat A) { return inner_products(shapes.Y, product(A, shapes.Z)); };
  Owned<Mat> C = sliding_damping(sliding);
  if (structure.K_loss.get()) C = without_loss(C, structure);
  ReducedMatrices result{seen(structure.M), seen(C), seen(structure.K), {}, T.columns()};
  if (structure.H.get()) result.K += seen(structure.H);
  if (const auto springs = contact_stiffness(interface, equilibrium.closed, PairForces::with_friction); springs.get())
    result.K += seen(springs);
  if (structure.K_loss.get()) result.K_loss = seen(structure.K_loss);
  return result;
}

} // namespace squeal
