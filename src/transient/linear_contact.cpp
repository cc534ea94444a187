#include "linear_contact.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/LU>
#include <optional>
#include <vector>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

using PairMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 2, 2>; // of tangential directions

struct Slip // of a pair
{
  Index first = 0, normal = 0; // its first tangential row of W, and its normal one's place among the first unknowns
  PairMatrix turn;             // [-] columns: e, and the direction across it
  double mu = 0;               // [-]
  double by_coefficient = 0;   // [N] r_n dmu/d(common coefficient)
};

/// The closed pairs.
struct Unknowns
{
  std::vector<Index> leading; // the first unknowns: rows of W
  std::vector<Slip> slips;
  Index first_turned = 0; // of the directions of `turn`: the first one that has an entry of y
  VectorXd S;             // [N s/m] the diagonal of S, by entries of y: pair by pair

  Index size() const { return static_cast<Index>(leading.size()) + S.size(); }
};

Unknowns unknowns_of(int directions, const PairFriction& friction, const StepRecord& record,
                     std::span<const ContactStatus> statuses)
{
  const PairRows<Index> rows(directions);
  const PairView reactions(record.reactions, directions), velocity(record.contact_velocity, directions);
  Unknowns result;
  result.first_turned = depends_on_speed(friction) ? 0 : 1; // constant mu: dw_t along e does not matter
  std::vector<double> S;
  for (std::size_t pair = 0; pair < statuses.size(); ++pair)
  {
    if (statuses[pair] == ContactStatus::open) continue;
    const auto own = static_cast<Index>(pair);
    result.leading.push_back(rows.normal(own));
    if (statuses[pair] == ContactStatus::stick)
    {
      for (Index k = 0; k < directions; ++k) result.leading.push_back(rows.tangential(own) + k);
      continue;
    }
    const VectorXd w = VectorXd::Map(velocity.tangential(pair).data(), directions);
    const double speed = std::max(w.norm(), 1e-300), reaction = reactions.normal(pair);
    const FrictionLaw& law = friction.of(pair);
    const FrictionCoefficient mu = friction_coefficient(law, speed);
    const double by_common = friction.has_own(pair) ? 0 : share_of_coefficient(law, speed);
    const VectorXd e = w / speed;
    PairMatrix turn = e;
    if (directions == 2) turn = (PairMatrix(2, 2) << e(0), -e(1), e(1), e(0)).finished();
    result.slips.push_back(
        {rows.tangential(own), static_cast<Index>(result.leading.size()) - 1, turn, mu.value, reaction * by_common});
    if (result.first_turned == 0) S.push_back(mu.derivative * reaction);
    if (directions == 2) S.push_back(mu.value * reaction / speed);
  }
  result.S = VectorXd::Map(S.data(), static_cast<Index>(S.size()));
  return result;
}

/// Rows of the first unknowns and of y, of a column with all rows of W.
void put_rows(const Unknowns& unknowns, const double* column, double* result)
{
  for (const Index row : unknowns.leading) *result++ = column[row];
  for (const Slip& slip : unknowns.slips)
    for (Index d = unknowns.first_turned; d < slip.turn.cols(); ++d)
    {
      double along = 0;
      for (Index k = 0; k < slip.turn.rows(); ++k) along += slip.turn(k, d) * column[slip.first + k];
      *result++ = along;
    }
}

MatrixXd rows_of(const Unknowns& unknowns, const MatrixXd& columns)
{
  MatrixXd result(unknowns.size(), columns.cols());
  for (Index k = 0; k < columns.cols(); ++k) put_rows(unknowns, columns.col(k).data(), result.col(k).data());
  return result;
}

/// (dw_n and dw_t of stick; dw_t where y is) by (the first unknowns; y), b apart.
MatrixXd condense(const Unknowns& unknowns, const Eigen::Map<const MatrixXd>& W)
{
  const auto leading = static_cast<Index>(unknowns.leading.size());
  MatrixXd result(unknowns.size(), unknowns.size());
  for (Index j = 0; j < leading; ++j)
    put_rows(unknowns, W.col(unknowns.leading[static_cast<std::size_t>(j)]).data(), result.col(j).data());
  MatrixXd tangential(unknowns.size(), unknowns.slips.empty() ? 0 : unknowns.slips.front().turn.rows());
  Index at = leading;
  for (const Slip& slip : unknowns.slips)
  {
    for (Index k = 0; k < tangential.cols(); ++k)
      put_rows(unknowns, W.col(slip.first + k).data(), tangential.col(k).data());
    for (Index k = 0; k < tangential.cols(); ++k)
      result.col(slip.normal) -= slip.mu * slip.turn(k, 0) * tangential.col(k);
    for (Index d = unknowns.first_turned; d < slip.turn.cols(); ++d, ++at)
    {
      result.col(at) = slip.turn(0, d) * tangential.col(0);
      for (Index k = 1; k < tangential.cols(); ++k) result.col(at) += slip.turn(k, d) * tangential.col(k);
    }
  }
  return result;
}

/// Pairs that stick may have more rows than the structure has motions. Their reactions are then not unique but their
/// velocities are; this much more of a diagonal entry makes the system regular.
void regularise(MatrixXd& A, Index rows)
{
  for (Index i = 0; i < rows; ++i)
    if (A.row(i).isZero(0))
      A(i, i) = 1; // a tangential row without a motion
    else
      A(i, i) *= 1 + 1e-10;
}

/// The first unknowns and y with `b` in rows of `A`, which condense() gave and regularise() made regular; nothing where
/// the fixed point does not contract.
std::optional<MatrixXd> by_fixed_point(const MatrixXd& A, const VectorXd& S, const MatrixXd& b)
{
  const Index turned = S.size(), leading = A.rows() - turned;
  const Eigen::PartialPivLU<MatrixXd> lu(A.topLeftCorner(leading, leading));
  const VectorXd own = A.diagonal().tail(turned);
  MatrixXd x = MatrixXd::Zero(b.rows(), b.cols());
  double last = HUGE_VAL;
  for (int pass = 0; pass < 30; ++pass)
  {
    MatrixXd right = -b.topRows(leading);
    if (pass > 0) right.noalias() -= A.topRightCorner(leading, turned) * x.bottomRows(turned);
    x.topRows(leading) = lu.solve(right);
    if (turned == 0) return x;
    MatrixXd dw = b.bottomRows(turned);
    dw.noalias() += A.bottomRows(turned) * x;
    const MatrixXd y = ((own.array() * S.array()).matrix().asDiagonal() * x.bottomRows(turned) - S.asDiagonal() * dw)
                           .array()
                           .colwise() /
                       (1 + S.array() * own.array());
    const double change = (y - x.bottomRows(turned)).cwiseAbs().maxCoeff();
    x.bottomRows(turned) = y;
    if (change <= 1e-10 * x.cwiseAbs().maxCoeff()) return x;
    if (pass > 2 && change > 0.5 * last) return std::nullopt;
    last = change;
  }
  return std::nullopt;
}

/// The same by the factors of all rows.
MatrixXd by_whole_system(MatrixXd A, const VectorXd& S, const MatrixXd& b)
{
  const Index turned = S.size();
  MatrixXd right = -b;
  A.bottomRows(turned) = (S.asDiagonal() * A.bottomRows(turned)).eval();
  A.diagonal().tail(turned).array() += 1;
  right.bottomRows(turned) = (S.asDiagonal() * right.bottomRows(turned)).eval();
  return A.partialPivLu().solve(right);
}

} // namespace

MatrixXd linear_contact_response(std::span<const double> W, int directions, const PairFriction& friction,
                                 const StepRecord& record, std::span<const ContactStatus> statuses, const MatrixXd& db,
                                 const VectorXd& dmu)
{
  MatrixXd result = MatrixXd::Zero(db.rows(), db.cols());
  const Unknowns unknowns = unknowns_of(directions, friction, record, statuses);
  if (unknowns.leading.empty()) return result;
  const Eigen::Map<const MatrixXd> whole(W.data(), db.rows(), db.rows());
  const auto leading = static_cast<Index>(unknowns.leading.size());
  MatrixXd A = condense(unknowns, whole), b = rows_of(unknowns, db);
  if (!dmu.isZero(0))
  {
    VectorXd by_coefficient = VectorXd::Zero(db.rows());
    for (const Slip& slip : unknowns.slips)
      by_coefficient.segment(slip.first, slip.turn.rows()) = slip.by_coefficient * slip.turn.col(0);
    b -= rows_of(unknowns, whole * by_coefficient) * dmu.transpose();
  }
  regularise(A, leading);
  std::optional<MatrixXd> x = by_fixed_point(A, unknowns.S, b);
  if (!x) x = by_whole_system(std::move(A), unknowns.S, b);
  for (Index i = 0; i < leading; ++i) result.row(unknowns.leading[static_cast<std::size_t>(i)]) = x->row(i);
  Index at = leading;
  for (const Slip& slip : unknowns.slips)
  {
    auto own = result.middleRows(slip.first, slip.turn.rows());
    own -= slip.turn.col(0) * (slip.mu * x->row(slip.normal) + slip.by_coefficient * dmu.transpose());
    for (Index d = unknowns.first_turned; d < slip.turn.cols(); ++d) own += slip.turn.col(d) * x->row(at++);
  }
  return result;
}

} // namespace squeal
