#pragma once
/// The motion that is heard at a point of a sweep.
#include "squeal/model.hpp"
#include "squeal/options.hpp"

namespace squeal
{

/// Finds what is heard on the scene with the values of a point, by the settings of its cycle. `models`: of the scene.
/// Collective on their communicator. Error: the scene cannot be computed there.
SweptMotion find_swept_motion(NearbyModels& models, const Scene& scene, const ProgramOptions& options,
                              const SweptPlace& place);

} // namespace squeal
