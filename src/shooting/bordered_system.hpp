#pragma once
/// The Newton system of an orbit bordered by the period and the phase condition (src/README.md, section 6.5),
///     [J d; f' 0] (x, t) = (b, row),   J = dPhi_T/dx - I,   d = dPhi_T/dT,
/// with J replaced by the preconditioner P:   x = P^-1 b - t P^-1 d,   t = (<f, P^-1 b> - row)/<f, P^-1 d>.
/// Here f is the unit vector along d.
#include "squeal/shooting/orbit.hpp"

namespace squeal
{

struct Border
{
  Owned<Vec> phase, column;    // energy image of f; P^-1 d
  double speed = 0, along = 0; // |d|; <f, P^-1 d>
};

Border border_at(const OrbitProblem& problem, const Orbit& orbit);

/// Turns y = P^-1 b into x and returns t.
double close_border(const Border& border, Vec y, double row);

} // namespace squeal
