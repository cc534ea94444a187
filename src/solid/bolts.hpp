#pragma once
/// Sections of bolts.
#include "contributions.hpp"

namespace squeal
{

/// A contribution that a section cuts, and the motion of its nodal degrees of freedom that a unit of shortening adds to
/// what it sees.
struct Cut
{
  Contribution of;
  Eigen::VectorXd shift;
};

/// The part of a bolt that its section cuts. A section of nodes cuts the elements on the side that the axis points to:
/// they see its nodes moved against the axis. The mesh must be whole. Throws Error for a section that does not cut
/// through a shank, and for nodes in a contact or tie.
std::vector<Cut> cuts_of(const Bolt& bolt, const NumberedMesh& numbered, const Scene& scene);

} // namespace squeal
