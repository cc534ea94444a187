#pragma once
/// The stages of the shooting solver (src/README.md, section 6), on states x = (u, v) held as VecNest:
///     F(x, T) = Phi_T(x) - x = 0,   <f, dx> = 0,
/// f the flow's direction: a correction along the orbit would only move the time origin. Products are energy products,
/// <a, b> = a_u'K b_u + a_v'M b_v. Each stage returns the best candidate it met.
#include "squeal/base/progress.hpp"
#include "squeal/cycle/cycle.hpp"

#include <deque>

namespace squeal
{

struct ShootingOptions
{
  std::string finish = "multisecant";
  PetscInt reduced_newtons = 10;   // iterations of the reduced system; 0: not tried
  PetscInt base_growths = -1;      // -1: 4 without a finish; none with one, which is cheaper
  PetscReal difference = 1e-6;     // of the fluctuation: difference columns
  PetscReal rank_tolerance = 1e-7; // of the base, and of the reduced least-squares solve
  PetscInt secants = 60;           // kept
  PetscReal drop = 1e-4;           // a secant is dropped when less than this part of it is new
  PetscReal clamp = 0.3;           // of the fluctuation: longest step
  PetscInt stall = 30;             // iterations without progress
  PetscInt max_periods = 400;
  PetscInt multipliers = -1; // Krylov dimension; 0: none; -1: as many as the option table says
};

/// A candidate and what one evaluation of the flow says about it.
struct Orbit
{
  Owned<Vec> state;
  double period = 0;      // [s]
  Owned<Vec> defect;      // Phi_T(x) - x
  Owned<Vec> rate;        // dPhi_T/dT
  double fluctuation = 0; // |x - equilibrium|
  double residual = 0;    // |defect| / fluctuation
};

/// A step of the multisecant iteration and what it did to the preconditioned defect.
struct Secant
{
  Owned<Vec> step, change; // dx; P^-1 dF
  double period = 0;       // dT
};

/// By how much the iteration still moves, relative.
struct Moves
{
  double frequency = 0, energy = 0;
};

/// What the stages share.
struct Shooting
{
  const Flow& flow;
  const Preconditioner& preconditioner;
  ShootingOptions options{};
  Owned<Vec> equilibrium{}; // (u0, 0)
  double first_period = 0;
  double tolerance = 0;
  double least_fluctuation = 0; // below: the candidate is falling onto the equilibrium
  long periods = 0;
  int iterations = 0;
  std::vector<NewtonRecord> records{};
  double residual_projected = 0;
  std::function<void(const NewtonRecord&)> announce{};
  std::deque<Secant> secants{}; // newest first; they serve the next shooting at nearly the same flow as well
  double wish = 0;              // above 0: converged as soon as what is still to come moves no more than that
  Moves last{}, to_come{};      // the last step and an estimate of all that would follow
};

/// States as nests.
Owned<Vec> state_of(Vec u, Vec v); // of copies
Vec displacement(Vec state);
Vec velocity(Vec state);

void energy_image(const Flow& flow, Vec x, Vec image); // (K u, M v)
double energy_product(const Flow& flow, Vec a, Vec b);
double energy_norm(const Flow& flow, Vec a);

Orbit evaluate(Shooting& shooting, Vec state, double period);
Orbit copy_of(const Orbit& orbit);
void record(Shooting& shooting, const std::string& stage, int unknowns, double projected, const Orbit& orbit);
int full_unknowns(const Orbit& orbit);                           // u, v and T
bool admissible_period(const Shooting& shooting, double period); // within a factor of two of the first
bool vanishing(const Shooting& shooting,
               const Orbit& orbit); // energy below a tenth of the start's and of the first event's

/// `count` free periods from the orbit's state, then its evaluation with the period of the best recurrence.
Orbit free_periods(Shooting& shooting, Vec state, double period, int count);

/// Energy-orthonormal base, dependent vectors dropped; `base` holds what is there already.
void extend_base(const Shooting& shooting, std::vector<Owned<Vec>>& base, Vec candidate);

/// Damped Newton on T and the base's coordinates about the orbit.
Orbit shoot_reduced(Shooting& shooting, const Orbit& start, const std::vector<Owned<Vec>>& base,
                    const std::string& stage);

enum class Ending
{
  converged,
  stalled,
  vanished,
  not_periodic,
};

struct Finish
{
  Orbit orbit;
  Ending ending = Ending::stalled;
};

Finish shoot_multisecant(Shooting& shooting, const Orbit& start);

/// Secants; where they give up, ten more free periods and once again; then Newton-Krylov. As -cycle_finish says.
Finish finish_in_full_space(Shooting& shooting, Orbit start);

/// What a step from the orbit would do to period and energy, into shooting.last and to_come: twice that, or half of the
/// step before, since their signs alternate.
void judge(Shooting& shooting, const Orbit& orbit, const Secant& step);
Secant next_step(const Shooting& shooting, const Orbit& orbit);

/// Options read, nothing integrated yet. Borrows all three; every record is announced to `progress`.
Shooting begin_shooting(const Flow& flow, const Preconditioner& preconditioner, const ShootingStart& start,
                        double tolerance, Progress& progress);
Finish shoot_newton_krylov(Shooting& shooting, const Orbit& start);

/// Make the solvers' options known to the library even when they never run.
void declare_reduced_options();
void declare_fallback_options();

void apply(const Preconditioner& preconditioner, double period, Vec x, Vec y);

/// The bordered system [J d; f' 0] (x, t) = (b, row) at an orbit, J replaced by P: x = P^-1 b - t P^-1 d.
struct Border
{
  Owned<Vec> phase, column;    // energy image of f, the unit flow; P^-1 d
  double speed = 0, along = 0; // |d|; <f, P^-1 d>
};

Border border_at(const Shooting& shooting, const Orbit& orbit);

/// Turns y = P^-1 b into x; returns t.
double close_border(const Border& border, Vec y, double row);

/// Multipliers by Arnoldi on difference quotients, in the energy product, into the cycle: all of a small system, else
/// of the motions that may grow, those `asleep` among them. The motion of the largest; null if none was asked for.
Owned<Vec> find_multipliers(Shooting& shooting, const Orbit& orbit, const std::vector<Owned<Vec>>& asleep,
                            LimitCycle& cycle);

} // namespace squeal
