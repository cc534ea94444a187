#include "reduced_sliding.hpp"

#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/algebra/dense_matrix.hpp"

#include <algorithm>

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

OnShapes on_shapes(Mat A, const MultiVector& T, const MultiVector& W)
{
  if (!A) return {};
  const MultiVector AT = product(A, T), AW = product(A, W);
  return {inner_products(T, AT), inner_products(W, AT), inner_products(W, AW)};
}

/// The sum of terms with their coefficients.
OnShapes sum_of(const std::vector<OnShapes>& terms, const std::vector<double>& coefficients)
{
  OnShapes sum;
  for (std::size_t k = 0; k < terms.size(); ++k)
  {
    if (terms[k].TT.size() == 0) continue;
    if (sum.TT.size() == 0)
      sum = {coefficients[k] * terms[k].TT, coefficients[k] * terms[k].WT, coefficients[k] * terms[k].WW};
    else
    {
      sum.TT += coefficients[k] * terms[k].TT;
      sum.WT += coefficients[k] * terms[k].WT;
      sum.WW += coefficients[k] * terms[k].WW;
    }
  }
  return sum;
}

/// The normal rows of B among all of its rows.
MatrixXd normal_rows(const MatrixXd& B, const Interface& interface)
{
  const PairRows<Index> rows(interface.directions);
  MatrixXd result(interface.pairs, B.cols());
  for (Index pair = 0; pair < result.rows(); ++pair) result.row(pair) = B.row(rows.normal(pair));
  return result;
}

} // namespace

PairShapes make_pair_shapes(const BrakeModel& model, double omega)
{
  const auto& [structure, interface] = model;
  const Owned<Mat> energy = energy_of(structure, omega);
  const Factor factor(energy, nullptr, {});
  if (factor.failed()) throw Error("the stiffness is not positive semidefinite");
  PairShapes shapes{empty_multivector(structure.K)};
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
    append(shapes.W, x);
    view.normal(i) = 0;
  }
  if (interface.pairs > 0) shapes.BW = product(interface.B, shapes.W).entries;
  return shapes;
}

ShapeCollection::ShapeCollection(const BrakeModel& model, const PairShapes& pairs, double omega)
    : model_(model), pairs_(pairs), energy_(energy_of(model.structure, omega)),
      shapes_(empty_multivector(model.structure.K)), images_(empty_multivector(model.structure.K))
{
}

void ShapeCollection::take_normal_motion_off(MultiVector& vectors) const
{
  const Interface& interface = model_.interface;
  if (interface.pairs == 0) return;
  const MatrixXd motion = normal_rows(product(interface.B, vectors).entries, interface);
  vectors.entries -= pairs_.W.entries * solve_dense(normal_rows(pairs_.BW, interface), motion,
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

ReducedSliding::ReducedSliding(const PolynomialModel& model, const MultiVector& T, const PairShapes& pairs)
    : BT_(product(model.reference().interface.B, T).entries), BW_(pairs.BW)
{
  for (const ModelTerm& term : model.terms())
    for (std::size_t k = 0; k < terms_.size(); ++k)
      terms_[k].push_back(on_shapes((term.structure.*matrices_of_structure[k]).get(), T, pairs.W));
}

namespace
{

/// The pairs of a point: closed and rigid ones, which are eliminated, and the others. With the rows B_n + part e.B_t of
/// the first ones on shapes.
struct PairsOfPoint
{
  const Interface& interface;
  std::vector<Index> closed{}, open{};

  /// `part`: of each pair, 0 or mu.
  MatrixXd rows_on(const MatrixXd& B, const std::vector<double>& part) const
  {
    const std::vector<double> directions = drive_directions(interface);
    const TangentView e(directions, interface.directions);
    const PairRows<Index> rows(interface.directions);
    MatrixXd result(static_cast<Index>(closed.size()), B.cols());
    for (Index k = 0; k < result.rows(); ++k)
    {
      const Index pair = closed[static_cast<std::size_t>(k)];
      const auto i = static_cast<std::size_t>(pair);
      result.row(k) = B.row(rows.normal(pair));
      for (std::size_t d = 0; d < e.of(i).size() && part[i] != 0; ++d)
        result.row(k) += part[i] * e.of(i)[d] * B.row(rows.tangential(pair) + static_cast<Index>(d));
    }
    return result;
  }
};

PairsOfPoint pairs_of(const Interface& interface, const std::vector<char>& closed)
{
  PairsOfPoint pairs{interface};
  for (std::size_t i = 0; i < closed.size(); ++i)
    (closed[i] && compliance_of(interface, i) == 0 ? pairs.closed : pairs.open).push_back(static_cast<Index>(i));
  return pairs;
}

/// What W of the closed pairs adds to S on either side.
struct Lifts
{
  MatrixXd Y, Z;
};

Lifts make_lifts(const PairsOfPoint& pairs, const MatrixXd& BS, const MatrixXd& BW)
{
  const std::vector<double> mu = drive_friction(pairs.interface), frictionless(mu.size(), 0.);
  const auto lift = [&](const std::vector<double>& part) -> MatrixXd
  {
    if (pairs.closed.empty()) return MatrixXd(0, BS.cols());
    return -solve_dense(pairs.rows_on(BW, part), pairs.rows_on(BS, part),
                        "a closed pair is jammed by friction, or fixed by other pairs");
  };
  return {lift(mu), lift(frictionless)};
}

/// (S + W Y)'A (S + W Z), A' = sign A
MatrixXd lifted(const OnShapes& A, double sign, const PairsOfPoint& pairs, const Lifts& lifts)
{
  const std::vector<Index>&closed = pairs.closed, &open = pairs.open;
  const Index shapes = A.TT.rows(), opened = static_cast<Index>(open.size());
  MatrixXd result(shapes + opened, shapes + opened), WS(static_cast<Index>(closed.size()), shapes + opened);
  const MatrixXd of_open = A.WT(open, Eigen::all);
  result << A.TT, sign * of_open.transpose(), of_open, A.WW(open, open);
  WS << A.WT(closed, Eigen::all), A.WW(closed, open);
  result.noalias() += lifts.Y.transpose() * WS;
  if (opened == 0) return result; // B_n S = 0
  const MatrixXd coupled = A.WW(closed, closed) * lifts.Z;
  result.noalias() += sign * WS.transpose() * lifts.Z;
  result.noalias() += lifts.Y.transpose() * coupled;
  return result;
}

/// S_Y'C_f S_Z, from the rows of B on both.
MatrixXd friction_damping(const Interface& interface, const Equilibrium& equilibrium, const MatrixXd& left,
                          const MatrixXd& right)
{
  const PairRows<Index> rows(interface.directions);
  const TangentView drive(interface.drive, interface.directions);
  const PairView reactions(equilibrium.reactions, interface.directions);
  MatrixXd force = MatrixXd::Zero(right.rows(), right.cols());
  for (std::size_t i = 0; i < equilibrium.closed.size(); ++i)
  {
    if (!equilibrium.closed[i] || reactions.normal(i) <= 0) continue;
    const SlidingFriction friction = sliding_friction(interface.friction.of(i), reactions.normal(i), drive.of(i));
    const auto& D = interface.friction.common.direction_damping ? friction.damping : friction.damping_of_speed;
    const Index first = rows.tangential(static_cast<Index>(i));
    for (Index k = 0; k < rows.directions; ++k)
      for (Index l = 0; l < rows.directions; ++l)
        force.row(first + k) += D[static_cast<std::size_t>(k)][static_cast<std::size_t>(l)] * right.row(first + l);
  }
  return left.transpose() * force;
}

/// S_Y'B'S B S_Z of the closed pairs with a compliance, from the rows of B on both.
MatrixXd stiffness_of_pairs(const Interface& interface, const Equilibrium& equilibrium, const MatrixXd& left,
                            const MatrixXd& right)
{
  const PairRows<Index> rows(interface.directions);
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  MatrixXd force = MatrixXd::Zero(right.rows(), right.cols());
  for (std::size_t i = 0; i < equilibrium.closed.size(); ++i)
  {
    const double c = compliance_of(interface, i);
    if (!equilibrium.closed[i] || c == 0) continue;
    const Index normal = rows.normal(static_cast<Index>(i)), first = rows.tangential(static_cast<Index>(i));
    force.row(normal) = right.row(normal) / c;
    for (std::size_t d = 0; d < e.of(i).size(); ++d)
      force.row(first + static_cast<Index>(d)) = mu[i] * e.of(i)[d] / c * right.row(normal);
  }
  return left.transpose() * force;
}

} // namespace

ReducedMatrices ReducedSliding::at(const std::vector<double>& coefficients, const Interface& interface,
                                   const Equilibrium& equilibrium) const
{
  const PairsOfPoint pairs = pairs_of(interface, equilibrium.closed);
  MatrixXd BS(BT_.rows(), BT_.cols() + static_cast<Index>(pairs.open.size()));
  if (interface.pairs > 0) BS << BT_, BW_(Eigen::all, pairs.open);
  const MatrixXd at_closed = BW_(Eigen::all, pairs.closed);
  const Lifts lifts = make_lifts(pairs, BS, at_closed);
  const auto& [M, C, K, G, H, K_loss] = terms_;
  const auto projected = [&](const std::vector<OnShapes>& terms, double sign) -> MatrixXd
  {
    const OnShapes A = sum_of(terms, coefficients);
    if (A.TT.size() == 0) return MatrixXd::Zero(BS.cols(), BS.cols());
    return lifted(A, sign, pairs, lifts);
  };
  const auto has = [](const std::vector<OnShapes>& terms)
  { return std::ranges::any_of(terms, [](const OnShapes& term) { return term.TT.size() > 0; }); };
  ReducedMatrices result{projected(M, 1), projected(C, 1), projected(K, 1), {}, shapes()};
  if (has(G)) result.C += projected(G, -1);
  if (has(H)) result.K += projected(H, -1);
  if (has(K_loss)) result.K_loss = projected(K_loss, 1);
  if (interface.pairs == 0) return result;
  const MatrixXd left = BS + at_closed * lifts.Y, right = pairs.open.empty() ? BS : (BS + at_closed * lifts.Z).eval();
  result.C += friction_damping(interface, equilibrium, left, right);
  if (!interface.compliance.empty()) result.K += stiffness_of_pairs(interface, equilibrium, left, right);
  return result;
}

} // namespace squeal
