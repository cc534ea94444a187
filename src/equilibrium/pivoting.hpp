#pragma once
/// The rest of driven pairs where Newton's method on the statuses ends without one: 0 <= w _|_ r >= 0, N w = q + M r.
#include "squeal/contact/stick_slip.hpp"

#include <optional>

namespace squeal
{

constexpr Eigen::Index few_pairs = 12; // whose 4096 sets take less than the path of a thousand pairs

/// A solution by Lemke's path, or of few pairs by trying every set of closed ones. Of few pairs none means that there
/// is none; of more that none was found.
std::optional<StickSlipState> rest_by_pivoting(const StickSlipOperator& of, const Eigen::VectorXd& q);

} // namespace squeal
