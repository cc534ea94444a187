#pragma once
/// The order of the degrees of freedom in files, which does not depend on the number of ranks. It is that of a matrix
/// scene's matrices, else by node of the mesh and direction (x y z rx ry rz), free ones only.
#include "squeal/base/checkpoint.hpp"
#include "squeal/solid/structure.hpp"

namespace squeal
{

/// Moves vectors between the ranks and a list on rank 0 in the order of files. All members are collective.
class FileOrder
{
public:
  explicit FileOrder(const Structure& structure);

  /// Returns all entries on rank 0, and nothing elsewhere.
  std::vector<double> gather(Vec x) const;

  /// Sets the vector from the list on rank 0, which has its size; the lists of other ranks are not read.
  void scatter(std::span<const double> entries, Vec x) const;

  /// Moves the vector into the checkpoint that is written, or out of the one that is read.
  void describe(Checkpoint& checkpoint, Vec x) const;

private:
  Owned<Vec> whole_; // on rank 0
  Owned<VecScatter> scatter_;
};

} // namespace squeal
