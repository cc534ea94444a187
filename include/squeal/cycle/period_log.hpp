#pragma once
/// The log of all periods that a run integrates with their rates: their starts' norms, ends and rates, in order.
///
/// Shooting, its free periods and a branch are functions of these periods. A run that is restarted therefore repeats
/// them as they are written, each period taken from the log instead of integrated, until the log ends.
#include "squeal/cycle/period_map.hpp"

namespace squeal
{

/// Begins the log of a run: it reads the periods of the run that is gone on with first. After open_checkpoints.
void begin_period_log();

/// Sets end, rate and what the map carries on from the log, if it holds this period next. Otherwise returns false. A
/// start or a length that differs from the log's by more than the rounding of other ranks ends the log here.
/// Collective.
bool replay_period(PeriodMap& map, double period, Vec start, Vec end, Vec rate);

/// Appends a period that was integrated, and writes the log when a checkpoint is due. Collective.
void log_period(const PeriodMap& map, double period, Vec start, Vec end, Vec rate);

/// Writes what was logged since the last time.
void keep_period_log();

} // namespace squeal
