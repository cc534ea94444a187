#include "squeal/study/reversed.hpp"

namespace squeal
{

void reverse_rotation(Structure& structure, Interface& interface)
{
  for (double& velocity : interface.drive) velocity = -velocity;
  if (!structure.G.get()) return;
  structure.G = copy_of(structure.G); // other models may share the matrix
  check(MatScale(structure.G, -1));
}

} // namespace squeal
