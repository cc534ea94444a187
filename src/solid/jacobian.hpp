#pragma once
/// Check of the Jacobian of an element.
#include <sstream>
#include <stdexcept>

namespace squeal
{

/// Returns the determinant of a Jacobian. Throws std::runtime_error with its value if it is not positive.
inline double positive_jacobian(double determinant, std::size_t point)
{
  if (determinant > 0) return determinant;
  std::ostringstream text;
  text << "the Jacobian is " << determinant << " at integration point " << point
       << ": the element is too distorted, folded or numbered inside out; correct the mesh there";
  throw std::runtime_error(text.str());
}

} // namespace squeal
