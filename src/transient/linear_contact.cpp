#include "linear_contact.hpp"

#include <cmath>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

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

/// 1 - e e'
MatrixXd across(const VectorXd& e)
{
  return MatrixXd::Identity(e.size(), e.size()) - e * e.transpose();
}

} // namespace

LinearContact::LinearContact(const ContactOperator& W, double friction, const StepRecord& record,
                             std::span<const ContactStatus> statuses)
    : friction_(friction), size_(static_cast<Index>(W.size())), directions_(W.directions)
{
  const Index block = 1 + directions_;
  std::vector<Index> following;
  for (std::size_t pair = 0; pair < statuses.size(); ++pair)
  {
    if (statuses[pair] == ContactStatus::open) continue;
    const Index row = static_cast<Index>(pair) * block;
    const auto tangential = VectorXd::Map(&record.contact_velocity[static_cast<std::size_t>(row + 1)], directions_);
    if (statuses[pair] == ContactStatus::slip)
    {
      const double speed = std::max(tangential.norm(), 1e-300),
                   reaction = record.reactions[static_cast<std::size_t>(row)];
      slips_.push_back({static_cast<Index>(rows_.size()), static_cast<Index>(following.size()), tangential / speed,
                        friction * reaction / speed, reaction});
    }
    rows_.push_back(row);
    for (Index k = 1; k < block; ++k) (statuses[pair] == ContactStatus::slip ? following : rows_).push_back(row + k);
  }
  leading_ = static_cast<Index>(rows_.size());
  for (Slip& slip : slips_) slip.first += leading_;
  rows_.insert(rows_.end(), following.begin(), following.end());
  W_.resize(static_cast<Index>(rows_.size()), static_cast<Index>(rows_.size()));
  for (Index j = 0; j < W_.cols(); ++j)
  {
    const double* const column =
        &W.W[static_cast<std::size_t>(rows_[static_cast<std::size_t>(j)] * size_)]; // symmetric
    for (Index i = 0; i < W_.rows(); ++i) W_(i, j) = column[rows_[static_cast<std::size_t>(i)]];
  }
}

MatrixXd LinearContact::by_whole_system(const MatrixXd& db, const VectorXd& dmu)
{
  if (!whole_lu_)
  {
    MatrixXd A = W_;
    for (const Slip& slip : slips_)
    {
      const MatrixXd turn = slip.tau * across(slip.e);
      A.middleRows(slip.first, directions_) = (turn * W_.middleRows(slip.first, directions_)).eval();
      A.block(slip.first, slip.first, directions_, directions_).diagonal().array() += 1;
      A.block(slip.first, slip.normal, directions_, 1) += friction_ * slip.e;
    }
    regularise(A, leading_);
    whole_lu_.emplace(A);
  }
  MatrixXd right = -db;
  for (const Slip& slip : slips_)
    right.middleRows(slip.first, directions_) = (slip.tau * across(slip.e) * right.middleRows(slip.first, directions_) -
                                                 slip.reaction * slip.e * dmu.transpose())
                                                    .eval();
  return whole_lu_->solve(right);
}

bool LinearContact::by_fixed_point(const MatrixXd& db, const VectorXd& dmu, MatrixXd& dr)
{
  const Index following = W_.rows() - leading_, columns = db.cols();
  if (!leading_lu_)
  {
    MatrixXd A = W_.topLeftCorner(leading_, leading_);
    for (const Slip& slip : slips_)
      A.col(slip.normal) -= friction_ * W_.block(0, slip.first, leading_, directions_) * slip.e;
    regularise(A, leading_);
    leading_lu_.emplace(A);
  }
  MatrixXd turned = MatrixXd::Zero(following, columns); // tau (1 - e e') dw_t
  double last = HUGE_VAL;
  for (int pass = 0; pass < 30; ++pass)
  {
    dr.resize(W_.rows(), columns);
    dr.bottomRows(following) = -turned;
    for (const Slip& slip : slips_) dr.middleRows(slip.first, directions_) -= slip.reaction * slip.e * dmu.transpose();
    MatrixXd right = -db.topRows(leading_);
    right.noalias() -= W_.topRightCorner(leading_, following) * dr.bottomRows(following);
    dr.topRows(leading_) = leading_lu_->solve(right);
    for (const Slip& slip : slips_) dr.middleRows(slip.first, directions_) -= friction_ * slip.e * dr.row(slip.normal);
    if (directions_ == 1 || slips_.empty()) return true;
    MatrixXd dw = db.bottomRows(following);
    dw.noalias() += W_.bottomRows(following) * dr;
    double change = 0;
    for (const Slip& slip : slips_)
    {
      const Index at = slip.first - leading_;
      const MatrixXd turn = slip.tau * across(slip.e),
                     own = turn * W_.block(slip.first, slip.first, directions_, directions_);
      const MatrixXd next = (MatrixXd::Identity(directions_, directions_) + own).inverse() *
                            (turn * dw.middleRows(at, directions_) + own * turned.middleRows(at, directions_));
      change = std::max(change, (next - turned.middleRows(at, directions_)).cwiseAbs().maxCoeff());
      turned.middleRows(at, directions_) = next;
    }
    if (change <= 1e-10 * dr.cwiseAbs().maxCoeff()) return true;
    if (pass > 2 && change > 0.5 * last) return false;
    last = change;
  }
  return false;
}

MatrixXd LinearContact::response(const MatrixXd& db, const VectorXd& dmu)
{
  MatrixXd result = MatrixXd::Zero(size_, db.cols());
  if (rows_.empty()) return result;
  const MatrixXd own = db(rows_, Eigen::all);
  MatrixXd dr;
  if (whole_lu_ || !by_fixed_point(own, dmu, dr)) dr = by_whole_system(own, dmu);
  result(rows_, Eigen::all) = dr;
  return result;
}

} // namespace squeal
