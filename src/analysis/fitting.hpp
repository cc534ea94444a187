#pragma once
/// The reduced model beside the full one (analysis/fidelity.hpp): its cycle, and what a full period says of it.
#include "squeal/analysis/fidelity.hpp"
#include "squeal/analysis/reduced.hpp"
#include "squeal/analysis/shooting.hpp"

#include <deque>

namespace squeal
{

struct ReducedOptions
{
  PetscReal margin = 1, threshold = 1e-5;
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

  Flow norm() const { return {nullptr, structure.M, structure.K, {}}; }
};

/// The reduced model, ready to be shot at.
struct Reduced
{
  ReducedModel model;
  Structure norm;
  RealModes modes; // of the preconditioner
  std::vector<DenseEigenpair> sliding;
};

struct ReducedOrbit
{
  LimitCycle cycle;
  ReducedState state;
  double period = 0, energy = 0; // [s], [J] mean, fluctuating
};

/// A state of the full model, about the equilibrium, and its period.
struct Candidate
{
  Owned<Vec> state; // nest (u - u0, v)
  double period = 0;
};

/// The fitting so far.
struct Fitting
{
  explicit Fitting(const Full& problem);

  const Full& full;
  ReducedOptions options;
  PeriodMap map;
  FittedCycle result;
  std::vector<int> active; // pairs
  Reduced reduced;
  int steps = 0;
  double tolerance = 0; // of the reduced cycles' residual
  Candidate candidate;
  double frequency_move = 0, energy_move = 0; // of the last correction, relative
};

/// The reduced model of the active pairs.
void build(Fitting& fitting);

ReducedMap map_of(const Fitting& fitting, int steps);

/// The cycle of Phi_r + shift near `start`, after some free periods.
ReducedOrbit shoot_reduced(Fitting& fitting, const ReducedState& start, const ReducedState& shift, double period,
                           int steps, int free);

Candidate candidate_of(const Full& full, const Reduced& reduced, const ReducedOrbit& orbit);

/// Pairs taken as sliding, or as open, that were seen to do something else.
std::vector<int> surprises(const Full& full, const std::vector<int>& active, const LimitCycle& cycle);

/// Candidates and where one correction took them; the next one makes the remaining move least (Anderson).
struct Acceleration
{
  const Full& full;
  std::deque<std::pair<Candidate, Candidate>> tried{}; // newest first: candidate, corrected
  std::size_t memory = 6;
};

Candidate next_candidate(Acceleration& acceleration, Candidate from, Candidate to);

/// A full period from the candidate and the reduced model's answer to it.
struct Correction
{
  Candidate to;
  ReducedOrbit orbit; // of the shifted reduced model
  ReducedState shift;
};

Correction correct(Fitting& fitting);

} // namespace squeal
