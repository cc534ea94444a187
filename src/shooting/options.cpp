#include "squeal/shooting/options.hpp"

namespace squeal
{

OptionList options_of(ShootingOptions& options)
{
  return {
      {"-cycle_subspace_newtons", &options.subspace_newtons, Range::not_negative,
       "Newton iterations on the period and the paper's six amplitudes; 0: they are not tried"},
      {"-cycle_finish", choice_of(options.finish), Range::any, "finish in the full space: multisecant or none"},
      {"-cycle_clamp", &options.clamp, Range::positive, "longest step of the finish over the fluctuation"},
      {"-cycle_stall", &options.stall, Range::not_negative,
       "iterations without progress before an attempt of the finish is given up"},
      {"-cycle_max_periods", &options.max_periods, Range::not_negative,
       "periods that one search integrates at most; another number of steps a period is another search"},
      {"-cycle_free_periods", &options.free_periods, Range::not_negative,
       "largest number of periods integrated freely while shooting finds no cycle that attracts"},
      {"-cycle_multipliers", &options.multipliers, Range::any,
       "columns of the exact tangent that the search for Floquet multipliers may take; 0: none; -1: as many as it "
       "needs, within limits. A number forces that many Arnoldi steps, or bounds the search beside the oblique "
       "projection"},
      {"-cycle_watched_periods", &options.watched_periods, Range::any,
       "periods integrated from beside the cycle found, 3 % of its fluctuation along the fastest motion, to see it "
       "grow or decay; again from a tenth and a hundredth of that where growth and multiplier differ; below 0: 200 "
       "where the whole tangent of a small model does not decide, else none"},
      {"-cycle_multiplier_method", choice_of(options.multiplier_method), Range::any,
       "whole: from the whole monodromy matrix; oblique: by projection on a reduced model's right and left vectors; "
       "arnoldi. auto is whole up to 100 degrees of freedom, else oblique, and Arnoldi where that does not serve"},
  };
}

} // namespace squeal
