#pragma once
/// The checkpoint of a march: its state, and what was recorded so far.
#include "squeal/base/checkpoint.hpp"
#include "squeal/transient/growth.hpp"
#include "squeal/transient/transient.hpp"

namespace squeal
{

/// The steps that a march makes, which distinguish its checkpoint from another one's.
struct MarchPlan
{
  long steps = 0;
  double step_size = 0, theta = 0; // [s], [-]
};

/// What a march has reached.
struct MarchProgress
{
  MarchSummary& summary;
  double& iterations; // of contact in all
  State& state;
  History& history;
};

/// Of a march that follows a mode (`amplitude`), as long as it slides.
class MarchCheckpoint
{
public:
  MarchCheckpoint(const Structure& structure, const MarchPlan& plan, ModeAmplitude& amplitude, bool& slides);

  /// Goes on from the checkpoint of the run that is restarted, if there is one of the same march. Collective.
  void restore(const MarchProgress& progress) const;

  /// Collective.
  void keep(const MarchProgress& progress) const;

private:
  bool describe(Checkpoint& checkpoint, const MarchProgress& progress) const; // false: it is of another march

  const Structure& structure_;
  MarchPlan plan_;
  ModeAmplitude& amplitude_;
  bool& slides_;
};

} // namespace squeal
