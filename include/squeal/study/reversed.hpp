#pragma once
/// The other direction of rotation.
#include "squeal/contact/interface.hpp"

namespace squeal
{

/// Turns round the drive of the contacts, and the G that rotation brings.
void reverse_rotation(Structure& structure, Interface& interface);

} // namespace squeal
