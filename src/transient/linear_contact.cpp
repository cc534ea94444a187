#include "linear_contact.hpp"

#include <algorithm>
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

} // namespace

LinearContact::LinearContact(std::span<const double> W, int directions, const FrictionLaw& law,
                             const StepRecord& record, std::span<const ContactStatus> statuses)
    : size_(static_cast<Index>(record.reactions.size())), directions_(directions)
{
  const PairRows<Index> rows(directions);
  const PairView reactions(record.reactions, directions), velocity(record.contact_velocity, directions);
  std::vector<Index> following;
  for (std::size_t pair = 0; pair < statuses.size(); ++pair)
  {
    if (statuses[pair] == ContactStatus::open) continue;
    const bool slips = statuses[pair] == ContactStatus::slip;
    if (slips)
    {
      const VectorXd s = VectorXd::Map(velocity.tangential(pair).data(), directions_);
      const double speed = std::max(s.norm(), 1e-300), reaction = reactions.normal(pair);
      const FrictionCoefficient mu = friction_coefficient(law, speed);
      const VectorXd e = s / speed;
      const MatrixXd along = e * e.transpose();
      slips_.push_back({static_cast<Index>(rows_.size()), static_cast<Index>(following.size()), e, mu.value,
                        mu.value * reaction / speed * (MatrixXd::Identity(directions_, directions_) - along) +
                            mu.derivative * reaction * along,
                        reaction * share_of_coefficient(law, speed)});
    }
    const auto own = static_cast<Index>(pair);
    rows_.push_back(rows.normal(own));
    for (Index k = 0; k < directions_; ++k) (slips ? following : rows_).push_back(rows.tangential(own) + k);
  }
  leading_ = static_cast<Index>(rows_.size());
  for (Slip& slip : slips_) slip.first += leading_;
  rows_.insert(rows_.end(), following.begin(), following.end());
  W_ = MatrixXd::Map(W.data(), size_, size_)(rows_, rows_);
}

MatrixXd LinearContact::by_whole_system(const MatrixXd& db, const VectorXd& dmu)
{
  if (!whole_lu_)
  {
    MatrixXd A = W_;
    for (const Slip& slip : slips_)
    {
      A.middleRows(slip.first, directions_) = (slip.S * W_.middleRows(slip.first, directions_)).eval();
      A.block(slip.first, slip.first, directions_, directions_).diagonal().array() += 1;
      A.block(slip.first, slip.normal, directions_, 1) += slip.mu * slip.e;
    }
    regularise(A, leading_);
    whole_lu_.emplace(A);
  }
  MatrixXd right = -db;
  for (const Slip& slip : slips_)
    right.middleRows(slip.first, directions_) =
        (slip.S * right.middleRows(slip.first, directions_) - slip.by_coefficient * slip.e * dmu.transpose()).eval();
  return whole_lu_->solve(right);
}

bool LinearContact::by_fixed_point(const MatrixXd& db, const VectorXd& dmu, MatrixXd& dr)
{
  const Index following = W_.rows() - leading_, columns = db.cols();
  if (!leading_lu_)
  {
    MatrixXd A = W_.topLeftCorner(leading_, leading_);
    for (const Slip& slip : slips_)
      A.col(slip.normal) -= slip.mu * W_.block(0, slip.first, leading_, directions_) * slip.e;
    regularise(A, leading_);
    leading_lu_.emplace(A);
  }
  MatrixXd turned = MatrixXd::Zero(following, columns); // S dw_t
  const bool alone = std::all_of(slips_.begin(), slips_.end(), [](const Slip& slip) { return slip.S.isZero(0); });
  double last = HUGE_VAL;
  for (int pass = 0; pass < 30; ++pass)
  {
    dr.resize(W_.rows(), columns);
    dr.bottomRows(following) = -turned;
    for (const Slip& slip : slips_)
      dr.middleRows(slip.first, directions_) -= slip.by_coefficient * slip.e * dmu.transpose();
    MatrixXd right = -db.topRows(leading_);
    right.noalias() -= W_.topRightCorner(leading_, following) * dr.bottomRows(following);
    dr.topRows(leading_) = leading_lu_->solve(right);
    for (const Slip& slip : slips_) dr.middleRows(slip.first, directions_) -= slip.mu * slip.e * dr.row(slip.normal);
    if (alone) return true;
    MatrixXd dw = db.bottomRows(following);
    dw.noalias() += W_.bottomRows(following) * dr;
    double change = 0;
    for (const Slip& slip : slips_)
    {
      const Index at = slip.first - leading_;
      const MatrixXd own = slip.S * W_.block(slip.first, slip.first, directions_, directions_);
      const MatrixXd next = (MatrixXd::Identity(directions_, directions_) + own).inverse() *
                            (slip.S * dw.middleRows(at, directions_) + own * turned.middleRows(at, directions_));
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
