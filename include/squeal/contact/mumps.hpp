#pragma once
/// What squeal says to MUMPS in any arithmetic: `Solver` is its structure, DMUMPS_STRUC_C or ZMUMPS_STRUC_C.

namespace squeal
{

enum class MumpsJob
{
  start = -1,
  end = -2,
  analyse = 1,
  factorise = 2,
  solve_phase = 3,
};

/// MUMPS's own numbering of its controls, which counts from one.
template <class Solver> auto& control(Solver& mumps, int number)
{
  return mumps.icntl[number - 1];
}

/// By `run()`, which does the factorisation: pivots that are put off need more room, ICNTL(14) [%], than was estimated.
template <class Solver, class Run> void factorise_in_room(Solver& mumps, Run run)
{
  run();
  while ((mumps.infog[0] == -8 || mumps.infog[0] == -9) && control(mumps, 14) < 2000)
  {
    control(mumps, 14) = 4 * control(mumps, 14) + 10;
    run();
  }
}

} // namespace squeal
