#pragma once
/// The reduced model beside the full one (cycle/fidelity.hpp): its active pairs, its cycles, its derivative.
#include "squeal/cycle/fidelity.hpp"
#include "squeal/reduction/reduced_model.hpp"
#include "squeal/shooting/shooting.hpp"

namespace squeal
{

struct ReducedOptions
{
  PetscReal margin = 1.5, threshold = 1e-5;
  PetscInt modes = 100000, free_periods = 100, corrections = 40;
};

/// The problem as given.
struct Full
{
  const Structure& structure;
  const Interface& interface;
  const Equilibrium& equilibrium;
  const std::vector<ComplexMode>& modes;
  std::span<const ComplexMode> unstable; // the followed one first
  const Estimate& estimate;
  const CycleSettings& settings;
  Mat probes = nullptr;
};

/// The reduced model, ready to be shot at.
struct Reduced
{
  ReducedModel model;
  Structure norm;
  Inside inside; // D of its shooting and of the full model's
};

struct ReducedOrbit
{
  bool converged = false;
  ReducedState state;
  double period = 0, energy = 0; // [s], [J] mean, fluctuating
};

/// The fitting so far.
struct Fitting
{
  explicit Fitting(const Full& problem);

  const Full& full;
  ReducedOptions options;
  FittedCycle result;
  std::vector<int> active; // pairs
  Reduced reduced;
  int steps = 0;
  double tolerance = 0; // of the reduced cycles' residual
};

/// The reduced model's first cycle, from the estimate, with as many active pairs as its motion needs: it runs free
/// until it has settled, and where it outgrows the amplitude that its pairs were chosen for they are chosen anew. Says
/// what is in the way, or nothing.
std::string first_orbit(Fitting& fitting, ReducedOrbit& orbit);

ReducedMap map_of(const Fitting& fitting, int steps);

/// The cycle of the reduced model near `start`. The same on every rank.
ReducedOrbit shoot_reduced(Fitting& fitting, const ReducedState& start, double period, int steps);

/// A motion of the reduced model as one of the full one, about the equilibrium: nest (du, v).
Owned<Vec> motion_of(const Full& full, const ReducedModel& model, const ReducedState& state);

} // namespace squeal
