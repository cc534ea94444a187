#pragma once
/// The checkpoint of a settled motion, made between two of its periods.
#include "squeal/settled/settled_motion.hpp"

namespace squeal
{

struct SettledProgress
{
  PeriodMap& map; // its warm start
  SettledMotion& motion;
  const MotionProgress& now;
};

/// Goes on from the checkpoint of the run that is restarted, if there is one of the same motion. Collective.
void restore_settled(const SettledProgress& progress);

/// Collective.
void keep_settled(const SettledProgress& progress);

} // namespace squeal
