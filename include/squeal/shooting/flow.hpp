#pragma once
/// The flow of an autonomous system x' = f(x) with states x = (u, v), held as VecNest, and their energy product
///     <a, b> = a_u'K b_u + a_v'M b_v   [twice J for a = b].
/// The shooting solver sees nothing else of a model. Functions on states are collective, but for the two that lend a
/// half of one.
#include "squeal/base/petsc.hpp"

#include <complex>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace squeal
{

/// Approximations of the largest multipliers of dPhi_T/dx and spans of eigenvectors (src/README.md, section 6.9). All
/// lists are of one size.
struct SlowMotions
{
  std::vector<std::complex<double>> values; // largest first
  std::vector<double> errors;               // what a modulus changes by with the grid of time
  std::vector<double> rises;                // what it rises by at most
  std::vector<Owned<Vec>> right, left;      // of the spans; left ones act by the energy product
  double next = 0;                          // the largest modulus beside these
  /// Takes from a motion its part along every motion of the approximation that loses less than half in a period. Empty:
  /// the approximation is exact.
  std::function<void(Vec motion)> without_known;
  /// x = (A - m)^-1 x of a complex x, A that approximation of dPhi_T/dx.
  std::function<void(std::complex<double> m, Vec real, Vec imaginary)> correct;
  std::string missing; // why there are none
  long periods = 0;    // integrated to find them
};

/// The steps in which a period is recorded.
struct TimeGrid
{
  double shift = 0;    // the part of a step by which it is moved
  int finer = 1;       // times as many steps as the flow takes
  bool events = false; // with what events inside steps do to the tangent; the period may begin some steps later

  int steps(int of_flow) const { return finer * of_flow; }
};

/// The motion in a period of a system's offsets (src/README.md, section 6.13). These are displacements that friction
/// holds and that nothing leads back.
struct OffsetMotion
{
  double slip = 0;  // [m] the largest way of one that moves one way alone
  double swing = 0; // [m] the largest of a vibration, which this is held against
  int held = 0;     // those that stay as they are throughout
};

/// The offsets of a flow; empty functions: it has none.
struct Offsets
{
  std::function<OffsetMotion()> motion{};       // of the period integrated last
  std::function<void(Vec rest)> find_rest{};    // the state of rest at the offsets of that period
  std::function<void(Vec part)> without_held{}; // takes from u or v their part along those held in the period recorded
                                                // last
};

/// The period map Phi_T: the state a time T after a start.
struct Flow
{
  /// end = Phi_period(start); unless `rate` is null, rate = dPhi/dperiod at the end.
  std::function<void(double period, Vec start, Vec end, Vec rate)> integrate;
  Mat M = nullptr, K = nullptr; // of the energy product
  /// Integrates a period and keeps what its tangent needs. Multisecants alone need none: then it may be empty.
  std::function<void(double period, Vec start, const TimeGrid& grid)> record_period{};
  /// x_k = dPhi_period/dx x_k along the period recorded last, all at once, in place.
  std::function<void(std::span<const Vec> states)> apply_tangent{};
  /// The slow motions of this period, which becomes the one recorded last. Empty: none are known.
  std::function<SlowMotions(double period, Vec start)> slow_motions{};
  double work = 0; // counted, of a period (squeal/base/cost.hpp)
  Offsets offsets{};
};

/// y = P^-1 x, an approximate inverse of dPhi_T/dx - I at this period; x and y are states. Empty: P = -I.
using Preconditioner = std::function<void(double period, Vec x, Vec y)>;

void apply(const Preconditioner& preconditioner, double period, Vec x, Vec y);

/// A state made of copies of u and v.
Owned<Vec> state_of(Vec u, Vec v);

/// The parts of a state, borrowed.
Vec displacement(Vec state);
/// The second half, likewise.
Vec velocity(Vec state);

/// The degrees of freedom: half of the state's entries.
PetscInt dofs_of(Vec state);

/// image = (K u, M v)
void energy_image(const Flow& flow, Vec x, Vec image);

/// <a, b>
double energy_product(const Flow& flow, Vec a, Vec b);

/// sqrt(<a, a>)
double energy_norm(const Flow& flow, Vec a);

/// Scales x to an energy norm of 1.
void normalise(const Flow& flow, Vec x);

/// Appends to the energy-orthonormal base what `candidate` adds to its span. A candidate of which less than
/// `rank_tolerance` is new is dropped.
void extend_base(const Flow& flow, double rank_tolerance, std::vector<Owned<Vec>>& base, Vec candidate);

} // namespace squeal
