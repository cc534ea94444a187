#pragma once
/// Names of degrees of freedom for messages.
#include "squeal/solid/structure.hpp"

namespace squeal
{

/// Names of the components of a node.
inline constexpr const char* direction_names[] = {"x", "y", "z", "rx", "ry", "rz"};

/// Fills in the bodies and positions of the nodes.
void name_nodes(const Mesh& mesh, const Scene& scene, DofNames& names);

} // namespace squeal
