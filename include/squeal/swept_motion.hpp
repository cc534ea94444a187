#pragma once
/// What is heard at a point of a sweep.
#include "squeal/model.hpp"
#include "squeal/options.hpp"

namespace squeal
{

/// What is heard on the scene with the values of a point, by the settings of its cycle. `model`: of the scene itself.
/// Collective among `comm`. Error: the scene cannot be computed there.
SweptMotion find_swept_motion(const Model& model, const Scene& scene, const ProgramOptions& options,
                              const SweptPlace& place, MPI_Comm comm);

} // namespace squeal
