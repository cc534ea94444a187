#pragma once
/// Displacements of one mesh at the nodes of another mesh of the same parts, points and bodies.
#include "squeal/solid/dofs.hpp"
#include "squeal/solid/structure.hpp"

namespace squeal
{

/// A mesh with its numbering, whole on rank 0.
struct NumberedMesh
{
  const Mesh& mesh;
  const DofMap& dofs;
};

/// Reads displacements of `from` at the nodes of `to`, by the shape functions of `from` within each part. Motions of
/// points and rigid bodies go by their names, modal coordinates by their order. Borrows both.
class Interpolation
{
public:
  /// Collective. Throws Error where a node of `to` is more than half an element outside of its part in `from`.
  Interpolation(const NumberedMesh& from, const NumberedMesh& to, const Scene& scene, MPI_Comm comm);

  /// Sets the free degrees of freedom of `fine`, in the layout of `to`, from those of `coarse`. Collective.
  void apply(Vec coarse, Vec fine) const;

private:
  /// A node of `from`, and the share that it has in the motion of a node of `to`.
  struct Share
  {
    int node = 0;
    double weight = 0;
  };

  NumberedMesh from_, to_;
  // On rank 0, of each degree of freedom in shares_, and the end of its shares:
  std::vector<std::size_t> offsets_, ends_;
  std::vector<Share> shares_; // those of a node once, however many degrees of freedom it has
};

} // namespace squeal
