#pragma once
/// Values of a scene that are possible but hardly meant.
#include "squeal/scene/scene.hpp"

namespace squeal
{

/// A sentence for each material that no solid has and each mass that none has, which a slip of units explains, and for
/// each load that does nothing or turns round.
std::vector<std::string> doubts_about(const Scene& scene);

} // namespace squeal
