#pragma once
/// The rest of driven pairs where Newton's method on the statuses ends without one: 0 <= w _|_ r >= 0, N w = q + M r.
#include "squeal/contact/stick_slip.hpp"

#include <optional>

namespace squeal
{

/// A solution by Lemke's path, or of few pairs by trying every set of closed ones; none where neither finds one.
std::optional<StickSlipState> rest_by_pivoting(const StickSlipOperator& of, const Eigen::VectorXd& q);

} // namespace squeal
