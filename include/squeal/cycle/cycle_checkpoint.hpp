#pragma once
/// The checkpoint of a search for a cycle: the orbit that it has reached. A restarted search begins there, and finds
/// the same cycle to its tolerance.
#include "squeal/cycle/limit_cycle.hpp"

#include <optional>

namespace squeal
{

/// The orbit of the run that is gone on with; nothing where there is none. Collective.
std::optional<ResumedOrbit> kept_cycle(const Structure& structure);

/// Keeps the orbit from this start. Collective.
void keep_cycle(const Structure& structure, Vec start, double period);

/// Wraps the flow, which keeps the last orbit near a cycle that it integrates, when a checkpoint is due.
void keep_cycles_of(Flow& flow, const Structure& structure);

} // namespace squeal
