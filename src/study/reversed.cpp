#include "squeal/study/reversed.hpp"

namespace squeal
{

void reverse_rotation(Structure& structure, Interface& interface)
{
  for (double& velocity : interface.drive) velocity = -velocity;
  if (structure.G.get()) check(MatScale(structure.G, -1));
}

} // namespace squeal
