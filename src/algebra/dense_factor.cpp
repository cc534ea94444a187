#include "dense_factor.hpp"

#include <Eigen/Cholesky>

namespace squeal
{

using Eigen::MatrixXd;

DenseFactor::DenseFactor(const Triplets& lower, int dofs, int border)
    : L_(MatrixXd::Zero(dofs, dofs)), influence_(MatrixXd::Zero(dofs, border)),
      schur_complement_(static_cast<std::size_t>(border) * static_cast<std::size_t>(border), 0.)
{
  for (std::size_t k = 0; k < lower.row.size(); ++k)
  {
    const int i = lower.row[k] - 1, j = lower.column[k] - 1;
    (i < dofs ? L_(i, j) : influence_(j, i - dofs)) += lower.value[k];
  }
  failed_ = Eigen::LLT<Eigen::Ref<MatrixXd>>(L_).info() != Eigen::Success; // in place
  if (failed_ || border == 0) return;
  L_.triangularView<Eigen::Lower>().solveInPlace(influence_);
  auto schur_complement = MatrixXd::Map(schur_complement_.data(), border, border);
  schur_complement.selfadjointView<Eigen::Lower>().rankUpdate(influence_.transpose());
  L_.transpose().triangularView<Eigen::Upper>().solveInPlace(influence_);
}

std::vector<double> DenseFactor::forward(const std::vector<double>& b, int columns)
{
  right_ = MatrixXd::Map(b.data(), L_.rows(), columns);
  std::vector<double> result(static_cast<std::size_t>(influence_.cols() * columns));
  MatrixXd::Map(result.data(), influence_.cols(), columns).noalias() = influence_.transpose() * right_;
  return result;
}

void DenseFactor::backward(const std::vector<double>& lambda, std::vector<double>& x)
{
  L_.triangularView<Eigen::Lower>().solveInPlace(right_);
  L_.transpose().triangularView<Eigen::Upper>().solveInPlace(right_);
  if (influence_.cols() > 0)
    right_.noalias() -= influence_ * MatrixXd::Map(lambda.data(), influence_.cols(), right_.cols());
  x.assign(right_.data(), right_.data() + right_.size());
}

double DenseFactor::entries() const
{
  return 0.5 * static_cast<double>(L_.size());
}

} // namespace squeal
