#pragma once
/// The default contact solver (src/README.md, section 4.7).
#include "contact_work.hpp"

namespace squeal
{

/// Requests of rank 0 to the others within ServedProducts.
inline constexpr int end_of_service = 0, task_of_product = 1, task_of_sweeps = 2, task_of_gathering = 3;

/// Block Gauss-Seidel; W r must be fresh, and is in the end. On rank 0; where ranks share W, the others must be within
/// ServedProducts.
void gauss_seidel(ContactWork& work, const ContactSettings& settings);

/// The part of the other ranks in the sweeps that rank 0 has announced.
void sweep_along(const ContactOperator& W);

} // namespace squeal
