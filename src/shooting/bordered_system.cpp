#include "bordered_system.hpp"

namespace squeal
{

Border border_at(const OrbitProblem& problem, const Orbit& orbit)
{
  Border border{zeros_like(orbit.rate), zeros_like(orbit.rate), energy_norm(problem.flow, orbit.rate), 0};
  energy_image(problem.flow, orbit.rate, border.phase);
  check(VecScale(border.phase, 1 / border.speed));
  apply(problem.preconditioner, orbit.period, orbit.rate, border.column);
  check(VecDot(border.phase, border.column, &border.along));
  return border;
}

double close_border(const Border& border, Vec y, double row)
{
  double along = 0;
  check(VecDot(border.phase, y, &along));
  const double t = (along - row) / border.along;
  check(VecAXPY(y, -t, border.column));
  return t;
}

} // namespace squeal
