#pragma once
/// The modes of a run as a checkpoint: a run that goes on need not find them again, and goes on with the same ones.
#include "squeal/modes/modes.hpp"

namespace squeal
{

/// Leaves the modes as they are. Collective.
void keep_modes(Modes& modes, const Structure& structure);

/// Modes of the run that is gone on with; nothing where there are none. Collective.
std::optional<Modes> kept_modes(const Structure& structure);

} // namespace squeal
