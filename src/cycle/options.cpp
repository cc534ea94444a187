#include "squeal/cycle/options.hpp"

namespace squeal
{

OptionList options_of(CycleOptions& options)
{
  ReducedOptions& reduced = options.reduced;
  OptionList list = {
      {"-cycle_samples", &options.samples, Range::natural, "number of displacements over the last period in fields.h5"},
      {"-reduced_attachments", &reduced.attachments, Range::not_negative,
       "largest number of attachment shapes of a reduced model, the leading ones; 0: 300 for multipliers and for "
       "shooting from a coarse mesh's cycle, else all of them, but for the start of a cycle no more than half of the "
       "free memory holds, and none where too much is lost"},
      {"-reduced_band_factor", &reduced.band_factor, Range::any,
       "frictionless modes above the band join the reduced model up to this many times the mode's frequency, unless "
       "the band reaches nine tenths of that; 0: none; negative: 4.5, and 3 beyond 10 000 degrees of freedom at fewer "
       "than 128 steps a period"},
      {"-reduced_modes", &reduced.modes, Range::natural,
       "largest number of complex modes: the followed one and the nearest in frequency"},
  };
  for (Option& option : options_of(options.shooting)) list.push_back(std::move(option));
  return list;
}

} // namespace squeal
