#include "squeal/transient/linear_contact.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/LU>

namespace squeal
{

MatrixXd LinearContact::solve_leading(const MatrixXd& right) const
{
  MatrixXd x = Eigen::PermutationMatrix<Eigen::Dynamic>(order_) * right;
  leading_block().triangularView<Eigen::UnitLower>().solveInPlace(x);
  leading_block().triangularView<Eigen::Upper>().solveInPlace(x);
  return x;
}

MatrixXd LinearContact::solve_leading_transposed(MatrixXd x) const
{
  leading_block().transpose().triangularView<Eigen::Lower>().solveInPlace(x);
  leading_block().transpose().triangularView<Eigen::UnitUpper>().solveInPlace(x);
  return Eigen::PermutationMatrix<Eigen::Dynamic>(order_).transpose() * x;
}

void LinearContact::set_unknowns(const ContactLaw& law, const StepRecord& record)
{
  const auto& [directions, friction, theta] = law;
  const PairRows<Index> rows(directions);
  const PairView<const double> reactions(record.reactions, directions), velocity(record.contact_velocity, directions);
  const std::vector<ContactStatus> statuses = contact_status(reactions, velocity, friction);
  const PairFriction in_step = law_of_step(friction, theta);
  first_turned_ = depends_on_speed(in_step) ? 0 : 1; // constant mu: dw_t along e does not matter
  std::vector<double> S;
  for (std::size_t pair = 0; pair < statuses.size(); ++pair)
  {
    if (statuses[pair] == ContactStatus::open) continue;
    const auto own = static_cast<Index>(pair);
    leading_.push_back(rows.normal(own));
    const VectorXd w = VectorXd::Map(velocity.tangential(pair).data(), directions);
    const double speed = w.norm(), reaction = reactions.normal(pair);
    if (statuses[pair] == ContactStatus::stick || speed == 0)
    {
      for (Index k = 0; k < directions; ++k) leading_.push_back(rows.tangential(own) + k);
      continue;
    }
    const FrictionLaw& of_pair = in_step.of(pair);
    const FrictionCoefficient mu = friction_coefficient(of_pair, speed);
    const VectorXd e = w / speed;
    PairMatrix turn = e;
    if (directions == 2) turn = (PairMatrix(2, 2) << e(0), -e(1), e(1), e(0)).finished();
    slips_.push_back({rows.tangential(own), static_cast<Index>(leading_.size()) - 1, turn, mu.value});
    if (!in_step.has_own(pair))
      by_coefficient_.segment(rows.tangential(own), directions) = -reaction * share_of_coefficient(of_pair, speed) * e;
    if (first_turned_ == 0) S.push_back(mu.derivative * reaction);
    if (directions == 2) S.push_back(mu.value * reaction / speed);
  }
  S_ = VectorXd::Map(S.data(), static_cast<Index>(S.size()));
}

LinearContact::LinearContact(const Eigen::Ref<const MatrixXd>& W, const ContactLaw& law, const StepRecord& record)
    : by_coefficient_(VectorXd::Zero(W.rows()))
{
  set_unknowns(law, record);
  const auto leading = static_cast<Index>(leading_.size());
  A_.resize(leading + S_.size(), leading + S_.size());
  for_each_column(W, [&](Index j, const VectorXd& column) { put_rows(column.data(), A_.col(j).data()); });
  // pairs that stick may have more rows than the structure has motions: their reactions are then not unique, but their
  // velocities are
  constexpr double more = 1e-10; // of a diagonal entry
  for (Index i = 0; i < leading; ++i) A_(i, i) = A_.row(i).isZero(0) ? 1 : A_(i, i) * (1 + more);
  for (Index i = leading; i < A_.rows(); ++i) A_.row(i) *= S_(i - leading);
  A_.diagonal().tail(S_.size()).array() += 1;
  order_ = Eigen::VectorXi::LinSpaced(leading, 0, to_int(leading) - 1);
  Eigen::Ref<MatrixXd> block = A_.topLeftCorner(leading, leading);
  if (leading == 0 || !block.allFinite()) return; // LAPACK would leave the order unset
  const Eigen::PartialPivLU<Eigen::Ref<MatrixXd>> in_place(block);
  order_ = in_place.permutationP().indices();
}

/// Shows each column of F Q to visit(place, column).
template <class Visit> void LinearContact::for_each_column(const Eigen::Ref<const MatrixXd>& F, Visit visit) const
{
  VectorXd column;
  auto slip = slips_.begin();
  for (Index j = 0; j < static_cast<Index>(leading_.size()); ++j)
  {
    column = F.col(leading_[static_cast<std::size_t>(j)]);
    if (slip != slips_.end() && slip->normal == j)
    {
      for (Index k = 0; k < slip->turn.rows(); ++k) column -= slip->mu * slip->turn(k, 0) * F.col(slip->first + k);
      ++slip;
    }
    visit(j, column);
  }
  auto at = static_cast<Index>(leading_.size());
  for (const Slip& one : slips_)
    for (Index d = first_turned_; d < one.turn.cols(); ++d, ++at)
    {
      column = one.turn(0, d) * F.col(one.first);
      for (Index k = 1; k < one.turn.rows(); ++k) column += one.turn(k, d) * F.col(one.first + k);
      visit(at, column);
    }
}

void LinearContact::put_rows(const double* column, double* result) const
{
  for (const Index row : leading_) *result++ = column[row];
  for (const Slip& slip : slips_)
    for (Index d = first_turned_; d < slip.turn.cols(); ++d)
    {
      double along = 0;
      for (Index k = 0; k < slip.turn.rows(); ++k) along += slip.turn(k, d) * column[slip.first + k];
      *result++ = along;
    }
}

MatrixXd LinearContact::rows_of(const MatrixXd& db) const
{
  MatrixXd result(A_.rows(), db.cols());
  for (Index k = 0; k < db.cols(); ++k) put_rows(db.col(k).data(), result.col(k).data());
  return result;
}

MatrixXd LinearContact::columns_of(const Eigen::Ref<const MatrixXd>& F) const
{
  MatrixXd result(F.rows(), A_.cols());
  for_each_column(F, [&](Index j, const VectorXd& column) { result.col(j) = column; });
  return result;
}

/// A^-1 of the right side, by the leading block and the rest in turn; by block elimination where that does not
/// converge.
template <class Matrix, class Solve>
MatrixXd LinearContact::solve_by_parts(const Matrix& A, const Solve& solve_first, const MatrixXd& right) const
{
  const Index turned = S_.size(), leading = A.rows() - turned;
  const VectorXd own = A.diagonal().tail(turned);
  MatrixXd x = MatrixXd::Zero(right.rows(), right.cols());
  double last = HUGE_VAL;
  for (int pass = 0; pass < 30; ++pass)
  {
    MatrixXd of_leading = right.topRows(leading);
    if (pass > 0) of_leading.noalias() -= A.topRightCorner(leading, turned) * x.bottomRows(turned);
    x.topRows(leading) = solve_first(of_leading);
    if (turned == 0) return x;
    MatrixXd missed = right.bottomRows(turned);
    missed.noalias() -= A.bottomRows(turned) * x;
    const MatrixXd step = own.cwiseInverse().asDiagonal() * missed;
    x.bottomRows(turned) += step;
    const double change = step.cwiseAbs().maxCoeff();
    if (change <= 1e-10 * x.cwiseAbs().maxCoeff()) return x;
    if (pass > 2 && !(change <= 0.5 * last)) break;
    last = change;
  }
  const MatrixXd by_turned = solve_first(A.topRightCorner(leading, turned));
  const MatrixXd of_first = solve_first(right.topRows(leading)),
                 schur = A.bottomRightCorner(turned, turned) - A.bottomLeftCorner(turned, leading) * by_turned;
  x.bottomRows(turned) =
      schur.partialPivLu().solve(right.bottomRows(turned) - A.bottomLeftCorner(turned, leading) * of_first);
  x.topRows(leading) = of_first - by_turned * x.bottomRows(turned);
  return x;
}

MatrixXd LinearContact::solve(MatrixXd right) const
{
  right = -right;
  right.bottomRows(S_.size()) = (S_.asDiagonal() * right.bottomRows(S_.size())).eval();
  return solve_by_parts(
      A_, [&](const MatrixXd& b) { return solve_leading(b); }, right);
}

MatrixXd LinearContact::solve_transposed(const MatrixXd& right) const
{
  MatrixXd result = -solve_by_parts(
      A_.transpose(), [&](const MatrixXd& b) { return solve_leading_transposed(b); }, right);
  result.bottomRows(S_.size()) = (S_.asDiagonal() * result.bottomRows(S_.size())).eval();
  return result;
}

MatrixXd LinearContact::reactions(const MatrixXd& x) const
{
  MatrixXd result = MatrixXd::Zero(by_coefficient_.size(), x.cols());
  for (std::size_t i = 0; i < leading_.size(); ++i) result.row(leading_[i]) = x.row(static_cast<Index>(i));
  auto at = static_cast<Index>(leading_.size());
  for (const Slip& slip : slips_)
  {
    auto own = result.middleRows(slip.first, slip.turn.rows());
    own -= slip.mu * slip.turn.col(0) * x.row(slip.normal);
    for (Index d = first_turned_; d < slip.turn.cols(); ++d) own += slip.turn.col(d) * x.row(at++);
  }
  return result;
}

} // namespace squeal
