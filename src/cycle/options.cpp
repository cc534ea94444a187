#include "squeal/cycle/options.hpp"

namespace squeal
{

OptionList options_of(CycleOptions& options)
{
  ReducedOptions& reduced = options.reduced;
  OptionList list = {
      {"-cycle_samples", &options.samples, Range::natural,
       "displacements kept over the last period, for the fields file"},
      {"-reduced_attachments", &reduced.attachments, Range::not_negative,
       "attachment shapes at most, the leading ones; 0: 300 on recorded contact, else all, or as many as half of the "
       "free memory holds"},
      {"-reduced_band_factor", &reduced.band_factor, Range::any,
       "frictionless modes above the band reach this many times the mode's frequency; 0: none; negative: 4.5, and 3 "
       "beyond 10 000 degrees of freedom at fewer than 128 steps a period"},
      {"-reduced_modes", &reduced.modes, Range::natural,
       "complex modes taken, the followed one and the nearest in frequency"},
  };
  for (Option& option : options_of(options.shooting)) list.push_back(std::move(option));
  return list;
}

} // namespace squeal
