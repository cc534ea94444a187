#pragma once
/// The default contact solver (src/README.md, section 4.7).
#include "contact_work.hpp"

namespace squeal
{

/// What rank 0 asks of the others within ServedProducts, but for a product with so many columns.
inline constexpr int end_of_service = 0, task_of_sweeps = -1, task_of_gathering = -2;

/// Block Gauss-Seidel on all of them at once; W r must be fresh, and is in the end. On rank 0; where ranks share W,
/// the others must be within ServedProducts.
void gauss_seidel(std::span<ContactWork* const> works, const ContactSettings& settings);

/// The part of the other ranks in the sweeps that rank 0 has announced.
void sweep_along(const ContactOperator& W);

} // namespace squeal
