#pragma once
/// The checkpoint of a search for a cycle: the orbit that it has reached. A restarted search begins there, and finds
/// the same cycle to its tolerance.
#include "squeal/cycle/limit_cycle.hpp"

#include <optional>

namespace squeal
{

/// The orbit of the run that is gone on with; nothing where there is none. Collective.
std::optional<ResumedOrbit> kept_cycle(const Structure& structure);

/// Keeps the orbit from this start. Collective.
void keep_cycle(const Structure& structure, Vec start, double period);

/// Keeps the last orbit near a cycle that a search integrates, when a checkpoint is due.
class CycleKeeper
{
public:
  explicit CycleKeeper(const Structure& structure) : structure_(structure) {}
  CycleKeeper(const CycleKeeper&) = delete;
  CycleKeeper& operator=(const CycleKeeper&) = delete;

  /// Wraps the flow, which borrows the keeper from here on.
  void watch(Flow& flow);

private:
  void note(double period, Vec start, Vec end);
  void keep_if_due();
  void keep() const;

  const Structure& structure_;
  Owned<Vec> start_; // of the last orbit near a cycle; null: none was met
  double period_ = 0;
};

} // namespace squeal
