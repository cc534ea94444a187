#pragma once
/// Words of dense algebra.
#include <complex>
#include <Eigen/Core>

namespace squeal
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

} // namespace squeal
