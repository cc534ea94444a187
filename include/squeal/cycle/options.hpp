#pragma once
/// Options of the cycle: prefix -cycle_, and -reduced_ for the way by the reduced model.
#include "squeal/shooting/options.hpp"

namespace squeal
{

/// Options -reduced_...
struct ReducedOptions
{
  double margin = 1.5;         // pairs that part at this many times the motion's amplitude keep their contact
  double threshold = 1e-5;     // an attachment shape is dropped when less than this part of it is new
  PetscInt attachments = 0;    // attachment shapes at most, the leading ones; 0: what half of the free memory holds
  double band_factor = -1;     // frictionless modes above the band reach this many times the squeal's frequency
  PetscInt modes = 100000;     // complex modes taken at most, the followed one and the nearest in frequency
  PetscInt free_periods = 100; // at most, until the reduced model's motion is periodic
  PetscInt corrections = 40;   // periods of the full model at most, while the steps a period are refined
};

/// Options -cycle_...
struct CycleOptions
{
  ShootingOptions shooting;
  double band_factor = 3; // the preconditioner's modes reach this many times the mode's frequency; 0: none
  PetscInt samples = 32;  // displacements kept over the last period
  ReducedOptions reduced;
};

/// Those of the shooting as well.
OptionList options_of(CycleOptions& options);

} // namespace squeal
