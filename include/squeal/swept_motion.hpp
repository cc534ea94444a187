#pragma once
/// The chain of stages to what is heard, at a point of a sweep.
#include "squeal/chain.hpp"

namespace squeal
{

/// Finds what is heard on the chain's scene with the values of a point, by the settings of its cycle. `models`: those
/// near the chain's scene. Collective on their communicator. Error: the scene cannot be computed there.
SweptMotion find_swept_motion(const Chain& chain, const SweptPlace& place, NearbyModels& models);

} // namespace squeal
