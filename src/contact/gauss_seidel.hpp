#pragma once
/// The default contact solver (src/README.md, section 4.7).
#include "contact_work.hpp"

namespace squeal
{

/// Block Gauss-Seidel on all of them at once; W r must be fresh, and is in the end.
void gauss_seidel(std::span<ContactWork* const> works, const ContactSettings& settings);

} // namespace squeal
