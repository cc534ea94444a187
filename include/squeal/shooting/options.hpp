#pragma once
/// Options of the shooting solver, prefix -cycle_.
#include "squeal/base/petsc.hpp"
#include "squeal/base/words.hpp"

#include <array>

namespace squeal
{

/// The solver of the full-space equations that ends a shooting.
enum class Finish
{
  multisecant,
  none, // the orbit of the subspace is the result
};

template <> inline constexpr std::array words_of<Finish> = {"multisecant", "none"};

/// How Floquet multipliers are found (src/README.md, section 6.9).
enum class MultiplierMethod
{
  automatic, // by the columns that each takes
  whole,     // from the whole monodromy matrix
  oblique,   // by projection on approximate right and left vectors
};

template <> inline constexpr std::array words_of<MultiplierMethod> = {"auto", "whole", "oblique"};

/// Options -cycle_... of the solver.
struct ShootingOptions
{
  Finish finish = Finish::multisecant;
  PetscInt subspace_newtons = 0; // iterations on the subspace; 0: it is not tried
  double rank_tolerance = 1e-7;  // of the subspace's base
  PetscInt secants = 60;         // kept
  double secant_drop = 1e-4;     // a secant is dropped when less than this part of it is new
  double clamp = 0.3;            // longest multisecant step over the fluctuation
  PetscInt stall = 12;           // iterations without progress before the multisecant stage gives up
  PetscInt max_periods = 400;    // integrated in all
  PetscInt free_periods = 320;   // integrated freely in all, where shooting finds no cycle that attracts
  PetscInt multipliers = -1;     // columns sought; 0: none; below 0: as many as find_multipliers says
  PetscInt watched_periods = -1; // integrated beside the orbit found, to see its stability in time; below 0: chosen
  MultiplierMethod multiplier_method = MultiplierMethod::automatic;
};

} // namespace squeal
