#pragma once
#include <doctest/doctest.h>

/// Relative tolerance and nothing else: doctest's own adds epsilon times one, vacuous for a displacement of 1e-5.
inline doctest::Approx about(double exact, double relative)
{
  return doctest::Approx(exact).epsilon(relative).scale(0);
}
