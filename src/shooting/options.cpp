#include "squeal/shooting/options.hpp"

namespace squeal
{

OptionList options_of(ShootingOptions& options)
{
  return {
      {"-cycle_subspace_newtons", &options.subspace_newtons, Range::any,
       "iterations on the subspace of the mode's shapes; 0: not tried; below 0: 10 without a finish, else 0"},
      {"-cycle_base_growths", &options.base_growths, Range::any,
       "times the subspace may grow by what it missed; below 0: 4 without a finish, else 0"},
      {"-cycle_difference", &options.difference, Range::positive,
       "difference step over the fluctuation, in the energy norm"},
      {"-cycle_finish", choice_of(options.finish), Range::any, "full-space finish: multisecant or none"},
      {"-cycle_clamp", &options.clamp, Range::positive, "longest step of the finish over the fluctuation"},
      {"-cycle_stall", &options.stall, Range::not_negative,
       "iterations without progress before an attempt of the finish is given up"},
      {"-cycle_max_periods", &options.max_periods, Range::not_negative,
       "periods that one search integrates at most; another number of steps a period is another search"},
      {"-cycle_free_periods", &options.free_periods, Range::not_negative,
       "periods integrated freely at most, while shooting finds no cycle that attracts"},
      {"-cycle_multipliers", &options.multipliers, Range::any,
       "columns that the search for Floquet multipliers may take, 0: none; below 0: as many as it needs, within "
       "limits"},
      {"-cycle_watched_periods", &options.watched_periods, Range::any,
       "periods integrated from beside the cycle found, to see a small motion grow or decay; below 0: 200 where the "
       "whole tangent of a small model does not decide, else none"},
      {"-cycle_multiplier_method", choice_of(options.multiplier_method), Range::any,
       "of the Floquet multipliers: auto, whole, oblique or arnoldi"},
  };
}

} // namespace squeal
