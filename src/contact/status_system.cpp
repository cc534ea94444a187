#include "pair_states.hpp"

#include <Eigen/Dense>

namespace squeal
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// The smallest pivot over the largest.
double pivot_ratio(const Eigen::PartialPivLU<MatrixXd>& factors)
{
  const VectorXd pivots = factors.matrixLU().diagonal().cwiseAbs();
  return pivots.minCoeff() / pivots.maxCoeff();
}

/// Motions of a unit force along each direction of a pair, by its scales [m/N].
Vector3d unit_motions(const NaturalScale& rho)
{
  return {1 / rho.normal, 1 / rho.tangential, 1 / rho.tangential};
}

} // namespace

StickSlipOperator make_stick_slip_operator(MatrixXd N, MatrixXd M, const VectorXd& own, int directions,
                                           std::vector<int> contact)
{
  StickSlipOperator result{std::move(N), std::move(M), directions, {}, 0, std::move(contact)};
  result.compliance = own.maxCoeff();
  for (Index row = 0; row < result.M.rows(); ++row) // neither side moves along it: a spring there carries nothing
    if (result.M.row(row).isZero(0)) result.M(row, row) = result.compliance;
  const PairRows<Index> rows(directions);
  for (Index pair = 0; pair < static_cast<Index>(result.contact.size()); ++pair)
  {
    PairBlock block{};
    for (Index k = 0; k < rows.per_pair(); ++k)
      block[static_cast<std::size_t>(k)][static_cast<std::size_t>(k)] = own(rows.normal(pair) + k);
    result.rho.push_back(natural_scale(block, result.compliance));
  }
  return result;
}

struct StatusFactors
{
  std::vector<Matrix3d> laws;        // J of each pair
  double spring = 0;                 // [N/m] across rows
  bool regular = true;               // no row was mended
  Eigen::PartialPivLU<MatrixXd> own; // M R - N W
};

namespace
{

/// Motions of a pair by its unknowns, [m/N].
Matrix3d motion_law(const StickSlipOperator& of, std::size_t pair, const Matrix3d& J)
{
  return unit_motions(of.rho[pair]).asDiagonal() * (J - Matrix3d::Identity());
}

/// Columns of M R - N W in some rows, for reactions R y and motions W y of a pair.
MatrixXd columns_by(const StickSlipOperator& of, std::size_t pair, const Matrix3d& R, const Matrix3d& W)
{
  const PairRows<Index> pair_rows(of.directions);
  const Index own = pair_rows.per_pair(), first = pair_rows.normal(static_cast<Index>(pair));
  MatrixXd columns = of.N.middleCols(first, own).lazyProduct(-W.topLeftCorner(own, own));
  columns.noalias() += of.M.middleCols(first, own).lazyProduct(R.topLeftCorner(own, own));
  return columns;
}

/// The motions by the unknowns y of pairs, all of whose rows these are.
MatrixXd motions_by(const StickSlipOperator& of, const std::vector<Matrix3d>& laws, const MatrixXd& y)
{
  const PairRows<Index> rows(of.directions);
  const Index own = rows.per_pair();
  MatrixXd w(y.rows(), y.cols());
  for (std::size_t pair = 0; pair < laws.size(); ++pair)
  {
    const Index first = rows.normal(static_cast<Index>(pair));
    w.middleRows(first, own) =
        motion_law(of, pair, laws[pair]).topLeftCorner(own, own).lazyProduct(y.middleRows(first, own));
  }
  return w;
}

} // namespace

StatusSystem::StatusSystem(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at)
    : of_(of)
{
  read_laws(friction, at, 0);
  factor(0);
}

StatusSystem::StatusSystem(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at,
                           const Softening& soft, double near, std::shared_ptr<const StatusFactors>& factors)
    : of_(of), factors_(factors)
{
  read_laws(friction, at, soft.force);
  if (!factors_ || factors_->spring != soft.spring || !differ_by_rank(near)) factor(soft.spring);
  factors = factors_;
}

void StatusSystem::read_laws(const StickSlipFriction& friction, const StickSlipState& at, double smooth)
{
  const PairRows<Index> rows(of_.directions);
  const Index own = rows.per_pair();
  const PairStates states{of_, friction, at, smooth};
  particular_ = {-at.r, VectorXd::Zero(at.r.size())};
  for (std::size_t pair = 0; pair < of_.rho.size(); ++pair)
  {
    const PairState state = states[pair];
    statuses_.push_back(state.status());
    const Index first = rows.normal(static_cast<Index>(pair));
    const ProjectedForces to = state.projected();
    laws_.push_back(to.J);
    particular_.r.segment(first, own) += to.p.head(own);
    particular_.w.segment(first, own) =
        unit_motions(state.rho).head(own).cwiseProduct(particular_.r.segment(first, own));
  }
}

bool StatusSystem::differ_by_rank(double near)
{
  constexpr Index most = 6; // one in so many rows: more cost about as much as factors
  if (!factors_->regular) return false;
  const PairRows<Index> rows(of_.directions);
  const Index own = rows.per_pair();
  std::vector<std::size_t> pairs;
  for (std::size_t pair = 0; pair < laws_.size(); ++pair)
    if ((laws_[pair] - factors_->laws[pair]).lpNorm<Eigen::Infinity>() > near) pairs.push_back(pair);
  const Index count = own * static_cast<Index>(pairs.size());
  if (most * count > of_.N.rows()) return false;
  MatrixXd changes(of_.N.rows(), count);
  std::vector<Matrix3d> laws = factors_->laws;
  for (const std::size_t pair : pairs)
  {
    const Matrix3d R = laws_[pair] - laws[pair], W = motion_law(of_, pair, R + Matrix3d::Identity());
    changes.middleCols(static_cast<Index>(changed_.size()), own) = columns_by(of_, pair, R - factors_->spring * W, W);
    for (Index k = 0; k < own; ++k) changed_.push_back(rows.normal(static_cast<Index>(pair)) + k);
    laws[pair] = laws_[pair];
  }
  laws_ = std::move(laws);
  if (pairs.empty()) return true;
  by_changes_ = factors_->own.solve(changes);
  own_.compute(MatrixXd::Identity(count, count) + by_changes_(changed_, Eigen::all));
  return true;
}

void StatusSystem::factor(double spring)
{
  const PairRows<Index> rows(of_.directions);
  const Index own = rows.per_pair();
  StatusFactors made{laws_, spring, true, {}};
  MatrixXd matrix(of_.N.rows(), of_.N.rows());
  for (std::size_t pair = 0; pair < laws_.size(); ++pair)
  {
    const Index to = rows.normal(static_cast<Index>(pair));
    const Matrix3d W = motion_law(of_, pair, laws_[pair]);
    matrix.middleCols(to, own) = columns_by(of_, pair, laws_[pair] - spring * W, W);
    for (Index k = to; k < to + own; ++k) // a row in which neither side moves leaves its friction open: it stays
      if (matrix.col(k).isZero(0))
      {
        matrix(k, k) = 1;
        made.regular = false;
      }
  }
  if (matrix.size() > 0)
  {
    made.own.compute(matrix);
    if (!(pivot_ratio(made.own) > 1e-13))
    {
      // rows of pairs that depend on each other: a compliance in series with each shares what they carry
      constexpr double series = 1e-10; // of the largest pivot
      matrix.diagonal().array() += series * made.own.matrixLU().diagonal().cwiseAbs().maxCoeff();
      made.own.compute(matrix);
      made.regular = false;
    }
  }
  factors_ = std::make_shared<const StatusFactors>(std::move(made));
}

StickSlipState StatusSystem::response(const VectorXd& rhs) const
{
  VectorXd y = factors_->own.solve(-rhs);
  if (!changed_.empty()) y -= by_changes_ * own_.solve(y(changed_));
  StickSlipState result{y, motions_by(of_, laws_, y)};
  const PairRows<Index> rows(of_.directions);
  const Index own = rows.per_pair();
  for (std::size_t pair = 0; pair < laws_.size(); ++pair)
  {
    const Index first = rows.normal(static_cast<Index>(pair));
    result.r.segment(first, own) = laws_[pair].topLeftCorner(own, own) * y.segment(first, own);
  }
  return result;
}

StickSlipState StatusSystem::change(const VectorXd& rhs, const Softening& soft) const
{
  StickSlipState result = response(rhs - of_.N * particular_.w + of_.M * (particular_.r - soft.spring * particular_.w));
  result.r += particular_.r;
  result.w += particular_.w;
  return result;
}

int StatusSystem::index() const
{
  const auto negative = (factors_->own.matrixLU().diagonal().array() < 0).count();
  return factors_->own.permutationP().determinant() * (negative % 2 == 0 ? 1 : -1) > 0 ? 1 : -1;
}

double StatusSystem::reciprocal_condition() const
{
  return pivot_ratio(factors_->own);
}

} // namespace squeal
