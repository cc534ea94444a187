#include "squeal/cycle/options.hpp"

namespace squeal
{

OptionList options_of(CycleOptions& options)
{
  ReducedOptions& reduced = options.reduced;
  OptionList list = {
      {"-cycle_band_factor", &options.band_factor, Range::not_negative,
       "modes of the preconditioner reach this many times the mode's frequency"},
      {"-cycle_samples", &options.samples, Range::natural,
       "displacements kept over the last period, for the fields file"},
      {"-reduced_margin", &reduced.margin, Range::positive,
       "pairs that part at this many times the motion's amplitude keep their contact"},
      {"-reduced_threshold", &reduced.threshold, Range::not_negative,
       "an attachment shape is dropped when less than this part of it is new"},
      {"-reduced_attachments", &reduced.attachments, Range::not_negative,
       "attachment shapes at most, the leading ones; 0: 300 on recorded contact, else all, or as many as half of the "
       "free memory holds"},
      {"-reduced_band_factor", &reduced.band_factor, Range::any,
       "frictionless modes above the band reach this many times the mode's frequency; 0: none; negative: 4.5, and 3 "
       "beyond 10 000 degrees of freedom at fewer than 128 steps a period"},
      {"-reduced_modes", &reduced.modes, Range::natural,
       "complex modes taken, the followed one and the nearest in frequency"},
      {"-reduced_free_periods", &reduced.free_periods, Range::not_negative,
       "at most integrated on the reduced model until its motion is periodic"},
      {"-reduced_corrections", &reduced.corrections, Range::not_negative,
       "periods of the full model at most, while the steps a period are refined"},
  };
  for (Option& option : options_of(options.shooting)) list.push_back(std::move(option));
  return list;
}

} // namespace squeal
