#pragma once
/// Quasi-Newton steps on the bordered system of an orbit (src/README.md, sections 6.5 and 6.7). Unknowns are z = (x, T,
/// p), where the flow may depend on a parameter p:
///     [J d g; f' 0 0; n'] dz = (b, rows),   J = dPhi_T/dx - I,   d = dPhi_T/dT,   g = dPhi_T/dp.
/// f is the unit vector along d, n the normal of a branch. B is the system with P for J, and G = B^-1 (F, 0) the
/// preconditioned defect. With earlier steps X and their changes of G, Y = Q R,
///     dz = -X R^-1 Q'G - (1 - Q Q') G.
/// Q is orthogonal in scaled unknowns, in the energy norm of G, not of F. In F, motions that the next period damps out
/// would be larger than the slow ones that are sought. Functions are collective.
#include "squeal/shooting/multipliers.hpp"
#include "squeal/shooting/orbit.hpp"

#include <array>
#include <deque>

namespace squeal
{

/// z, or a change of it.
struct BorderedVector
{
  Owned<Vec> state;
  double period = 0, parameter = 0; // [s]
};

BorderedVector copy_of(const BorderedVector& z);

/// y += factor x
void add(double factor, const BorderedVector& x, BorderedVector& y);

void scale(double factor, BorderedVector& z);

/// The sizes of the unknowns: z is measured by its parts over these.
struct BorderedScales
{
  double fluctuation = 1, period = 1, parameter = 1;
};

/// The product of two changes, in the scaled unknowns.
double scaled_product(const Flow& flow, const BorderedScales& scales, const BorderedVector& a, const BorderedVector& b);

/// A change of z and what it does to the preconditioned defect.
struct Secant
{
  BorderedVector step;
  Owned<Vec> change; // P^-1 dF
};

/// B at an orbit.
struct BorderedSystem
{
  const OrbitProblem& problem;
  const BorderedScales& scales;
  Owned<Vec> phase{}, along{}; // energy images of f, and of n's state over its scale; `along` null: p stays
  double along_period = 0, along_parameter = 1;
  Owned<Vec> period{}, parameter{};   // P^-1 d, P^-1 g
  double A[2][2] = {{0, 0}, {0, -1}}; // of (dT, dp), the state eliminated
};

/// B where p stays. Borrows problem and scales.
BorderedSystem system_at(const OrbitProblem& problem, const BorderedScales& scales, const Orbit& orbit);

/// B on a branch with this column of p and this normal.
BorderedSystem system_at(const OrbitProblem& problem, const BorderedScales& scales, const Orbit& orbit,
                         Vec parameter_column, const BorderedVector& normal);

/// P^-1 of the orbit's defect.
Owned<Vec> preconditioned(const OrbitProblem& problem, double period, Vec b);

/// Turns y, whose state is P^-1 b, into the solution of B y = (b, rows).
void close_border(const BorderedSystem& system, const std::array<double, 2>& rows, BorderedVector& y);

/// The step whose preconditioned change is `wanted`, by the secants at hand, the newest first; P where they say
/// nothing. A secant is left out where less than the part `drop` of its change is new.
BorderedVector step_by_secants(const BorderedSystem& system, const std::deque<Secant>& secants, double drop,
                               BorderedVector wanted);

/// The step by GCR, to a part `accuracy` of the change, with exact columns along the period recorded last (Eisenstat et
/// al. 1983). Their secants replace those at hand. `parameter_column`: null where p stays.
BorderedVector step_by_columns(const BorderedSystem& system, const Orbit& orbit, Vec parameter_column,
                               BorderedVector wanted, double accuracy, std::deque<Secant>& secants);

// The full-space finish of a shooting (src/README.md, sections 6.7 and 6.8; Anderson 1965, Eyert 1996): secants about
// the preconditioner, one period a step, no difference columns. Secants are exact where a whole tangent is cheap. All
// functions are collective. Error: as of the flow.
//
// Caveat: no globalisation. The step is clamped and the iteration guarded, and it ends without progress.

/// Twice what the next step from the orbit would change, since the signs of the steps alternate.
RelativeChange remaining_change(const OrbitProblem& problem, const ShootingOptions& options, const Orbit& orbit);

/// Iterates from `start` until the residual meets the problem's tolerance, or the remaining change its target error.
/// The change is twice the last step's, or half of the one before if that is more. The ending says whether it did,
/// stalled or collapsed to the equilibrium.
StageResult shoot_once(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log, Orbit start);

/// An orbit gone round several times is a solution, too. Where the period over a prime factor of `rounds` nearly closes
/// the one found, that solution is returned, else `found`. Takes for each factor the steps of a period, and of a search
/// where it nearly closes.
StageResult prefer_fewer_rounds(const OrbitProblem& problem, const ShootingOptions& options, ConvergenceLog& log,
                                int rounds, StageResult found);

} // namespace squeal
