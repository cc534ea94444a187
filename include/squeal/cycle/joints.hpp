#pragma once
/// Undriven pairs, the joints of a structure, along a period (src/README.md, section 6.13). A pair that sticks in every
/// step keeps its offset B_t u. One that slips both ways forgets it. One that slips one way alone is on its way to
/// another offset, or walks. Functions are collective.
#include "squeal/equilibrium/equilibrium.hpp"
#include "squeal/shooting/flow.hpp"
#include "squeal/transient/theta_step.hpp"

#include <memory>

namespace squeal
{

/// The motion of the pairs over a period.
struct JointMotion
{
  std::vector<char> held;        // undriven pairs that stuck in every step
  std::vector<double> offsets{}; // [m] means of B_t u, in a contact vector
  OffsetMotion slip{};
};

/// Flags of the undriven pairs that stuck in every recorded step, by pairs. Not collective.
std::vector<char> held_pairs(const Interface& interface, std::span<const StepRecord> records);

/// The motion in recorded steps from a state; Bu, Bv: B u and B v there. Not collective.
JointMotion joint_motion(const Interface& interface, const ThetaStep& step, std::span<const StepRecord> records,
                         const std::vector<double>& Bu, const std::vector<double>& Bv);

/// Takes from x its part along the tangential rows of these pairs, in the plain norm.
void take_out_tangents(const Interface& interface, const std::vector<char>& pairs, Vec x);

/// The use of friction in a period.
struct JointUse
{
  int held = 0, slipping = 0;              // undriven pairs that stuck in every step, and that slipped in some
  int at_edge = 0;                         // of the held ones, those whose use comes within 1e-3 of 1
  double largest = 0;                      // |r_t|/(mu r_n) of all of them
  std::vector<double> least{}, greatest{}; // of r_t/(mu r_n), of each undriven pair along each tangent
  std::vector<char> slipped{};             // of each of them: in some step
};

/// The change of a cycle by moving the held pairs of a contact along one tangent, and how far they may move.
struct OffsetSpread
{
  int contact = 0, direction = 0;
  double least = 0, greatest = 0;      // [m] range of the offset from where it is
  double by_period = 0, by_energy = 0; // [s/m], [J/m] of the fluctuating energy
};

/// The use over recorded steps. Not collective.
JointUse joint_use(const Interface& interface, std::span<const StepRecord> records);

/// The rest of a structure at the offsets of its motion, from period to period.
class OwnRest
{
public:
  /// Moves the rest to the offsets of a motion, once they have moved by more than a part 1e-4 of its swing.
  void follow(const SlidingEquilibrium& path, const FactorOptions& factor, const JointMotion& motion);

  /// The rest, else the path's equilibrium.
  SlidingEquilibrium about(const SlidingEquilibrium& path) const;

  /// The rest at any offsets.
  Equilibrium at(const SlidingEquilibrium& path, const FactorOptions& factor, const std::vector<double>& offsets);

private:
  std::unique_ptr<Equilibria> rests_{};
  std::vector<double> offsets_{}; // of the rest
  std::optional<Equilibrium> rest_{};
};

} // namespace squeal
