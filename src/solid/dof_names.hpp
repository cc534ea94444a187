#pragma once
/// Names of degrees of freedom for messages.
#include "squeal/solid/dofs.hpp"

namespace squeal
{

/// Fills in the bodies and positions of the nodes.
void name_nodes(const Mesh& mesh, const Scene& scene, DofNames& names);

} // namespace squeal
