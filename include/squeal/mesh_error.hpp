#pragma once
/// The error of the mesh in growth rates and frequencies. Modes of the scene's mesh and of one with every element
/// divided (mesh.refine) show where both lead.
///
/// An eigenvalue goes as lambda(h) = lambda + c h^q while the closed pairs stay the same, and jumps with each that
/// opens or closes. So the finer mesh has it twice: lambda(h/2), and held with the closed pairs of the scene's mesh.
/// With d = held - lambda(h) the limit is lambda(h/2) + d/(2^q - 1). The order q is not known: at corners and edges of
/// contact it is below that of the elements, 2 or 4. Orders from 1 on put the limit between lambda(h/2) and lambda(h/2)
/// + d; the middle is the corrected value. Its bar is 1.25 |d|/2 + |lambda(h/2) - held|. The second term is there since
/// the border of the contact falls between nodes as it may, on either mesh. Straight sides of a geometry's round parts
/// become rounder with the first division, so that they are part of d.
///
/// Caveat: a mesh that is too coarse has no order yet. A mesh file, or a mesh that mesh.refine divided, keeps its
/// straight sides.
#include "squeal/options.hpp"
#include "squeal/transient/sliding_point.hpp"

namespace squeal
{

/// The modes on the finer mesh that follow from the unstable ones and from the two stable ones of least damping ratio.
/// Collective. outcome: "converged"; "not converged": no equilibrium there, or a mode was not found on it; "skipped".
MeshError find_mesh_error(const SlidingPoint& point, const Scene& scene, const ProgramOptions& options);

} // namespace squeal
