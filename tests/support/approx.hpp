#pragma once
#include <doctest/doctest.h>

/// Returns `exact` with a relative tolerance alone. doctest's own adds epsilon times 1, which any displacement of 1e-5
/// would meet.
inline doctest::Approx approx(double exact, double relative)
{
  return doctest::Approx(exact).epsilon(relative).scale(0);
}
