#pragma once
/// Values of a scene that are possible but hardly meant.
#include "squeal/scene/scene.hpp"

namespace squeal
{

/// A sentence for each material that no solid has and each mass that none has, which a slip of units explains, and for
/// each load that does nothing or turns round, or setting that nothing uses. Of gaps and compliances beside the model's
/// length [m], unless that is 0.
std::vector<std::string> doubts_about(const Scene& scene, double length);

} // namespace squeal
